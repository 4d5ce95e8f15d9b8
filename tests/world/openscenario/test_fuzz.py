"""Broken copies of the shared scenarios: whatever is changed, only VsensorError comes out, and soon."""

import random
import re
import shutil
import time

import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import VsensorError
from vsensor.sources.storyboard import StoryboardConfig, StoryDrive
from vsensor.types import Environment

FOLDER = SHARED_DATA / "xosc"
NAMES = ("cut-in", "lane_change", "slow-lead-vehicle", "alks_cut-out", "alks_cut-in", "straight_500m")
VALUES = (
    "",
    "nan",
    "inf",
    "-1",
    "0",
    "1e300",
    "-0.0",
    "$x",
    "${1/0}",
    "Ego",
    "true",
    "\u00e9",
    "99999999999",
)
MUTANTS = 16


def mutated(document, draw):
    """Change a few things: values, tags, order; cut or double a stretch; replace characters."""
    for _ in range(draw.randint(1, 3)):
        kind = draw.randrange(6)
        if kind <= 2:
            spots = list(re.finditer(r'="([^"]*)"', document))
            spot = draw.choice(spots)
            value = draw.choice((*VALUES, draw.choice(spots)[1]))
            document = document[: spot.start(1)] + value + document[spot.end(1) :]
        elif kind == 3:
            elements = list(re.finditer(r"<(\w+)[^<>]*/>", document))
            one, other = draw.choice(elements), draw.choice(elements)
            document = document[: one.start()] + draw.choice(("", other[0])) + document[one.end() :]
        elif kind == 4:
            start = draw.randrange(len(document))
            document = document[:start] + document[start + draw.randint(1, 200) :]
        else:
            tags = list(re.finditer(r"<(\w+)", document))
            one, other = draw.choice(tags), draw.choice(tags)
            document = document[: one.start(1)] + other[1] + document[one.end(1) :]
    return document


def outcome(path):
    """Return what a scenario is refused with, nothing if it plays; any other exception comes out."""
    try:
        StoryDrive.load(path, StoryboardConfig(), Environment(), rehearsal_s=8.0)
    except VsensorError as error:
        return str(error)
    return ""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder beside which the catalogs and maps lie as the scenarios say."""
    base = tmp_path_factory.mktemp("fuzz")
    shutil.copytree(FOLDER / "Catalogs", base / "xosc" / "Catalogs")
    (base / "xodr").symlink_to(SHARED_DATA / "xodr")
    return base / "xosc"


@needs_shared
@pytest.mark.parametrize("name", NAMES)
def test_a_broken_scenario_is_played_or_refused_by_a_vsensor_error(place, name):
    document = (FOLDER / f"{name}.xosc").read_text()
    outcomes = set()
    for seed in range(MUTANTS):
        draw = random.Random(f"{name} {seed}")
        path = place / "mutant.xosc"
        path.write_text(mutated(document, draw), encoding="utf-8")
        began = time.monotonic()
        said = outcome(path)
        assert "\n" not in said, seed
        outcomes.add(said and "refused")
        assert time.monotonic() - began < 60.0, seed
    assert outcomes == {"", "refused"}
