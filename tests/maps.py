"""Small OpenDRIVE maps for tests, written as text, and the shared real ones."""

from tests.shared import SHARED_DATA
from vsensor.world.opendrive import load_map

REAL_MAPS = sorted((SHARED_DATA / "xodr").glob("*.xodr"))
MALFORMED_MAPS = sorted((SHARED_DATA / "xodr" / "malformed").glob("*.xodr"))

LINE = '<geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry>'


def geometry(inner, length, s=0.0, x=0.0, y=0.0, hdg=0.0):
    """Return one geometry record."""
    return f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{hdg!r}" length="{length!r}">{inner}</geometry>'


def lane(number, width="3.5", marks='<roadMark sOffset="0" type="solid"/>', kind="driving", links=""):
    """Return a lane of constant width; lane 0 has none."""
    record = "" if number == 0 else f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
    return f'<lane id="{number}" type="{kind}"><link>{links}</link>{record}{marks}</lane>'


def section(left=(), centre=None, right=(), s=0.0, attributes=""):
    """Return a lane section of lanes given as text."""
    centre = lane(0) if centre is None else centre
    parts = [f"<left>{''.join(left)}</left>" if left else "", f"<center>{centre}</center>"]
    parts.append(f"<right>{''.join(right)}</right>" if right else "")
    return f'<laneSection s="{s!r}" {attributes}>{"".join(parts)}</laneSection>'


TWO_LANES = section(left=[lane(1)], right=[lane(-1)])


def road(
    plan=None,
    sections=TWO_LANES,
    length=100.0,
    number=1,
    elevation="",
    lateral="",
    offset="",
    link="",
    more="",
):
    """Return one road, straight along x unless said otherwise."""
    plan = LINE.format(length=length) if plan is None else plan
    return (
        f'<road id="{number}" length="{length!r}" junction="-1"><link>{link}</link>'
        f"<planView>{plan}</planView><elevationProfile>{elevation}</elevationProfile>"
        f"<lateralProfile>{lateral}</lateralProfile><lanes>{offset}{sections}</lanes></road>"
    )


def document(*roads, junctions=""):
    """Return the text of a map."""
    return f'<OpenDRIVE><header revMajor="1" revMinor="7"/>{"".join(roads)}{junctions}</OpenDRIVE>'


def loaded(folder, *roads, junctions=""):
    """Write and load a map of these roads."""
    path = folder / "map.xodr"
    path.write_text(document(*roads, junctions=junctions))
    return load_map(path)


def real(name):
    """Load a shared map by its name without suffix."""
    return load_map(SHARED_DATA / "xodr" / f"{name}.xodr")
