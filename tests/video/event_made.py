"""A made event of a straight road, small and quick, for what reads events."""

from pathlib import Path

from vsensor.video.made.drives import planned
from vsensor.video.made.event import write_event


def straight_event(folder: Path, seconds=1.0, offset_m=0.2, light="day"):
    """Write an event: one lane of 3.5 m, both edges solid of 0.2 m: insides 1.65 m from its middle."""
    edge = {"kind": "solid", "width_m": 0.2}
    scenario = {
        **planned("eor", 1, 0).scenario,
        "duration_s": seconds,
        "ego": {"road": "1", "speed_kmh": 72.0, "offset_m": offset_m},
        "traffic": [],
        "environment": {"light": light},
        "motion": {},
        "image": {"noise_std": 0.0, "texture": 0.0, "wear": 0.0, "blur_px": 0.5},
    }
    road = {
        "line": [{"kind": "straight", "length_m": 500.0}],
        "centre": edge,
        "right": [{"width_m": 3.5, "paint": edge}],
    }
    folder.mkdir(parents=True)
    plan = planned("eor", 1, 0)._replace(scenario=scenario, road=road)
    write_event(folder, "eor", plan._replace(conditions={"light": light}))
    return folder
