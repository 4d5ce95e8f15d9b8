"""The world: loading maps, asking near a pose, a tick with traffic, a huge map, cubics through bends.

`python -m tools.bench.world MAP` prints what one map costs in a process of its own, as a line of JSON.
"""

import json
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests import stories
from tests.shared import SHARED_DATA
from tools.bench.measure import PERIOD_NS, ROOT, elapsed_ms, median, one_core, yardstick_ms
from tools.bench.tables import table
from vsensor.config import SHIPPED, load_scenario
from vsensor.line.build import build_source
from vsensor.scene import SceneConfig
from vsensor.sources import Source
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.storyboard import StoryboardConfig, StoryDrive
from vsensor.sources.traffic import TrafficConfig
from vsensor.types import Environment, Side, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.route import CorridorConfig

LARGEST, SMALL = "Town04", "straight_500m"
VEHICLES = 50
STORIES = ("keep their lanes", "change lanes")
COPIES = 100
AHEAD_M = 100.0
RADII_M = (250, 400, 600, 800, 1000, 1500)


def world(copies: int = COPIES, step_m: float = 5.0) -> dict[str, Any]:
    """Measure all; the huge map is `copies` times the largest shared one, side by side."""
    maps = SHARED_DATA / "xodr"
    with one_core():
        found: dict[str, Any] = {"yardstick_ms": yardstick_ms(), "vehicles": VEHICLES}
        found["largest"] = costs(maps / f"{LARGEST}.xodr")
        found["small"] = costs(maps / f"{SMALL}.xodr")
        found["tick_us"] = tick_us(maps / f"{LARGEST}.xodr")
        found["story_us"] = {kind: story_tick_us(kind) for kind in STORIES}
        found["driven_us"] = driven_tick_us("p3_hold")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "huge.xodr"
            side_by_side(maps / f"{LARGEST}.xodr", path, copies)
            found["huge"] = {"copies": copies, **costs(path)}
        found["fit"] = fits(step_m)
    return found


def costs(path: Path) -> dict[str, float]:
    """Return what a map costs in a process of its own."""
    words = [sys.executable, "-m", "tools.bench.world", str(path)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    return dict(json.loads(done.stdout))


def cost_here(path: Path) -> dict[str, float]:
    """Return size in MB, seconds to load, memory in MB that stays, us of a pose and of a window."""
    before_mb = _memory_mb()
    kept: list[Any] = []
    load_s = elapsed_ms(lambda: kept.append(load_map(path))) / 1e3
    corridor = Corridor(kept[0])
    s = np.array([33.3])
    corridor.poses(s)
    corridor.markings_window(0.0, 140.0)
    return {
        "mb": path.stat().st_size / 1e6,
        "load_s": load_s,
        "memory_mb": _memory_mb() - before_mb,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
        "pose_us": _us(lambda: corridor.poses(s)),
        "window_us": _us(lambda: corridor.markings_window(13.3, 140.0)),
    }


def _memory_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def _us(work: Any, times: int = 200, rounds: int = 9) -> float:
    def some() -> None:
        for _ in range(times):
            work()

    return median(np.array([elapsed_ms(some) for _ in range(rounds)])) / times * 1e3


def tick_us(path: Path) -> float:
    """Return the median tick of a drive with 50 vehicles in view."""
    traffic = tuple(TrafficConfig(lanes_left=k % 3 - 1, ahead_m=2.0 + 2.2 * k) for k in range(VEHICLES))
    drive = MapDrive(Corridor(load_map(path)), EgoConfig(speed_kmh=60.0), traffic)
    ticks = [Tick(index=k, t_ns=k * PERIOD_NS, period_ns=PERIOD_NS) for k in range(400)]
    assert len(drive.advance(None, ticks[0], ())[1].scene.obstacles) == VEHICLES
    return median(np.array([elapsed_ms(lambda t=t: drive.advance(None, t, ())) for t in ticks])) * 1e3


def story_tick_us(kind: str) -> float:
    """Return the median tick of a storyboard with 50 vehicles, all of which do what `kind` says."""
    with tempfile.TemporaryDirectory() as folder:
        path = stories.written(Path(folder), story_of(kind))
        drive = StoryDrive.load(path, StoryboardConfig(), Environment(), rehearsal_s=0.1)
    return _ticks_us(drive, first=50)  # from 2 s on


def story_of(kind: str) -> str:
    """Return a storyboard of 50 vehicles in two lanes, which from 1 s on change lanes, or do not."""
    names = [f"V{k}" for k in range(VEHICLES)]
    places = {name: stories.lane_position(60 + 6 * (k // 2), -1 - k % 2) for k, name in enumerate(names)}
    places["Ego"] = stories.lane_position(50)
    init = "".join(
        stories.private(name, stories.teleport(place), stories.speed(25)) for name, place in places.items()
    )
    if kind == "keep their lanes":
        return stories.text(init, entities=("Ego", *names))
    changes = [
        stories.group(
            stories.event(
                f"e{lane}", stories.trigger(stories.after(1)), stories.lane_change(-3 - lane, value=60)
            ),
            actors=[name for k, name in enumerate(names) if -1 - k % 2 == lane],
            name=f"g{lane}",
        )
        for lane in (-1, -2)
    ]
    return stories.text(init, stories.story(*changes), entities=("Ego", *names))


def driven_tick_us(scenario: str) -> float:
    """Return the median tick of a shipped drive by a vehicle and its driver."""
    return _ticks_us(build_source(load_scenario(scenario)), first=0)


def _ticks_us(source: Source, first: int) -> float:
    """Return the median of the source's ticks from one on."""
    state, spent = source.initial_state(), []
    for k in range(first + 400):
        tick = Tick(index=k, t_ns=k * PERIOD_NS, period_ns=PERIOD_NS)
        start_ns = time.perf_counter_ns()
        state, snapshot = source.advance(state, tick, ())
        spent.append(time.perf_counter_ns() - start_ns)
        assert snapshot is not None
    return median(np.array(spent[first:])) / 1e3


def side_by_side(source: Path, target: Path, copies: int) -> None:
    """Write a map of so many copies of another, 2 km apart, their ids moved on."""
    text = source.read_text()
    start, end = text.index("<road "), text.rindex("</OpenDRIVE>")
    body = text[start:end]
    ids = re.findall(r'<(?:road|junction) [^>]*?\bid="(\d+)"', body)
    step = 10 ** max(len(name) for name in ids)
    refers = re.compile(r'\b(elementId|incomingRoad|connectingRoad|linkedRoad|junction)="(\d+)"')
    named = re.compile(r'(<(?:road|junction) [^>]*?\bid)="(\d+)"')
    placed = re.compile(r'(<geometry [^>]*?\bx)="([^"]+)"')
    with target.open("w") as file:
        file.write(text[:start])
        for k in range(copies):
            moved = refers.sub(lambda m, k=k: f'{m[1]}="{int(m[2]) + k * step}"', body)
            moved = named.sub(lambda m, k=k: f'{m[1]}="{int(m[2]) + k * step}"', moved)
            file.write(placed.sub(lambda m, k=k: f'{m[1]}="{float(m[2]) + 2000.0 * k!r}"', moved))
        file.write("</OpenDRIVE>\n")


def fits(step_m: float) -> list[dict[str, float]]:
    """Return per bend of P3's track what a cubic over 100 m leaves: on its arc, at least, at its worst."""
    from tests.truths import output_on
    from vsensor.world.truth import line_truths

    corridor = Corridor(load_map(SHIPPED / "p3_track.toml"), CorridorConfig(road="1", lane=-2))
    s = np.arange(25.0, corridor.lap_m, step_m)
    curvature = np.abs(corridor.poses(s).curvature_per_m)
    ahead = np.abs(corridor.poses(s + AHEAD_M).curvature_per_m)
    truths = [line_truths(output_on(corridor, float(at)), 2.8)[Side.LEFT] for at in s]
    std_m = np.array([truth.whole.std_m for truth in truths])
    _, slope, half_bend, _ = np.array([truth.taylor for truth in truths]).T
    line_m = 1.0 / np.maximum(np.abs(2.0 * half_bend) / (1.0 + slope**2) ** 1.5, 1e-9)
    rows = []
    for radius in RADII_M:
        near = np.abs(1.0 / np.maximum(np.maximum(curvature, ahead), 1e-9) - radius) < 0.03 * radius
        arc = near & (np.abs(curvature - ahead) < 1e-6)
        rows.append(
            {
                "radius_m": radius,
                "std_m": float(np.median(std_m[arc])),
                "limit_m": arc_limit_m(float(np.median(line_m[arc])), SceneConfig().range_m),
                "worst_m": float(std_m[near].max()),
            }
        )
    return rows


def arc_limit_m(radius_m: float, length_m: float) -> float:
    """Return the least that a cubic leaves of an arc over x from 0: its Legendre terms from the fourth on."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = length_m / 2 * (1.0 + nodes)
    y = radius_m - np.sqrt(radius_m**2 - x**2)
    order = 2 * np.arange(25) + 1
    terms = order / 2 * ((weights * y) @ np.polynomial.legendre.legvander(nodes, 24))
    return float(np.sqrt((terms[4:] ** 2 / order[4:]).sum()))


def targets(found: Mapping[str, Any]) -> list[Sequence[object]]:
    """Return the rows of the table of targets."""
    largest, small, huge = found["largest"], found["small"], found["huge"]
    poses = max(largest["pose_us"], huge["pose_us"])
    return [
        (
            f"loading the largest shared map ({largest['mb']:.1f} MB)",
            "2 s",
            f"{largest['load_s']:.2f} s",
            largest["load_s"] <= 2.0,
        ),
        ("a pose on it, and on the huge one", "50 us", f"{poses:.0f} us", poses <= 50.0),
        ("the same against a straight road of 500 m", "", f"{poses / small['pose_us']:.2f} x", None),
        (
            f"a tick of the world with {found['vehicles']} vehicles",
            "1 ms",
            f"{found['tick_us'] / 1e3:.2f} ms",
            found["tick_us"] <= 1000.0,
        ),
        *(
            (
                f"a tick of a storyboard whose {found['vehicles']} vehicles {kind}",
                "1 ms",
                f"{us / 1e3:.2f} ms",
                us <= 1000.0,
            )
            for kind, us in found["story_us"].items()
        ),
        ("a tick of a vehicle and its driver (`p3_hold`)", "", f"{found['driven_us'] / 1e3:.2f} ms", None),
        (
            f"memory of a map of {huge['mb']:.0f} MB, {huge['copies']} times as large",
            "bounded",
            f"{huge['memory_mb']:.0f} MB (the plain one {largest['memory_mb']:.0f} MB)",
            None,
        ),
    ]


def page(found: Mapping[str, Any]) -> str:
    """Return the table of fits."""
    rows = [
        (row["radius_m"], *(f"{1e3 * row[name]:.3f}" for name in ("std_m", "limit_m", "worst_m")))
        for row in found["fit"]
    ]
    header = ("R, m", "std on the arc, mm", "least of any cubic, mm", "std at its worst, clothoids ahead, mm")
    return "## What a cubic over 100 m leaves of the bends of P3's track\n\n" + table(header, rows)


if __name__ == "__main__":
    print(json.dumps(cost_here(Path(sys.argv[1]))))
