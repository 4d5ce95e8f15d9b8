"""The error model of a scenario: which one, from what data, and where the drive leaves what it knows."""

from math import inf, isfinite

import numpy as np

from vsensor.config import Scenario
from vsensor.error_model import Conditions, ErrorLaw, ErrorModel, Rule
from vsensor.line import Line
from vsensor.sources.drive import RecordedDrive
from vsensor.sources.driven import DrivenDrive
from vsensor.sources.map_drive import MapDrive
from vsensor.types import NANOSECONDS_PER_SECOND, Array, BoolArray, Light

KMH = 3.6
AT_MOST = 2000
"""Places of a drive that are looked at."""
LONGEST_S = 3600.0


def error_lines(scenario: Scenario, law: ErrorLaw | None) -> list[str]:
    """Say which models there are, from what data, and which one holds when."""
    if law is None:
        return []
    file = scenario.config.error_model.file or "shipped"
    rule = law.library.rule
    lines = [f"error model {file}: {law.library.source}"]
    for name, model in law.library.models.items():
        lines.append(f"  model {name}: {_said(model)}")
    if len(rule) > 1:
        lines.append(f"  rule: {'; '.join(map(_condition, rule))}")
    return lines


def _said(model: ErrorModel) -> str:
    ranges, speeds = model.range_m, KMH * model.speed_mps
    blind = int(model.blind.sum())
    learned = f"{model.hours:.4g} h in {model.log_count:.0f} logs" if model.hours else "no recorded data"
    fitted = {
        "region": len(model.region_range_m),
        "losses": len(model.dwell_levels),
        "range": len(model.range_share),
        "quality": len(model.quality_step),
    }
    has = ", ".join(name for name, size in fitted.items() if size)
    return (
        f"{learned}, {ranges[0]:g} to {ranges[-1]:g} m, {speeds[0]:.0f} to {speeds[-1]:.0f} km/h, "
        f"{blind} of {model.blind.size} cells blind, fitted too: {has or 'nothing'}"
    )


def _condition(rule: Rule) -> str:
    words = []
    for column, asked in rule.when.items():
        if isinstance(asked, bool):
            words.append(column if asked else f"not {column}")
        else:
            low, high = ("" if end is None else f"{end:g}" for end in asked)
            words.append(f"{column} {low}..{high}")
    return f"{rule.model} when {' and '.join(words)}" if words else f"else {rule.model}"


def error_findings(scenario: Scenario, line: Line) -> list[str]:
    """Say where the drive leaves what the model knows; nothing of a drive that a bus moves."""
    law, found = line.sensor.law, []
    times, speeds = _speeds_mps(scenario, line)
    if law is None or not len(speeds):
        return []
    weather = [scenario.config.environment.weather().at(t_s) for t_s in times.tolist()]
    names = [
        law.name_at(Conditions(speed_mps=speed, night=seen.light is Light.NIGHT, rain=seen.rain))
        for speed, seen in zip(speeds.tolist(), weather, strict=True)
    ]
    for name in dict.fromkeys(names):
        model, mine = law.library.models[name], speeds[[one == name for one in names]]
        low, high = float(model.speed_mps[0]), float(model.speed_mps[-1])
        beyond = (mine < low) | (mine > high)
        if beyond.any():
            found.append(
                f"error_model: {_part(beyond, len(speeds))} at {_kmh(mine[beyond])}, beyond the speeds of "
                f"model {name}, {KMH * low:.0f} to {KMH * high:.0f} km/h: the nearest ones are used"
            )
        found += _blind(scenario, law, name, mine, len(speeds))
    return found


def _blind(scenario: Scenario, law: ErrorLaw, name: str, speeds_mps: Array, count: int) -> list[str]:
    """Say where cells that are blind lie within the range of the drive."""
    region, given = law.models[name].region, scenario.config.region.is_given
    if region is None:
        return []
    hit, start_m, end_m = np.zeros(len(speeds_mps), bool), inf, 0.0
    for k, speed in enumerate(speeds_mps.tolist()):
        reach = region.at(speed)
        for low, high in reach.blind_m.tolist():
            if max(low, 0.0) < reach.points_m and high > 0.0:
                hit[k] = True
                start_m, end_m = min(start_m, max(low, 0.0)), max(end_m, min(high, reach.points_m))
    if not hit.any():
        return []
    to = f"{end_m:.0f} m" if isfinite(end_m) else "the end"
    then = "they are used all the same, as [region] says" if given else "points there are dropped"
    return [
        f"error_model: {_part(hit, count)} at {_kmh(speeds_mps[hit])} has cells of which model {name} knows "
        f"too little, from {start_m:.0f} m to {to}: {then}"
    ]


def _part(mask: BoolArray, count: int) -> str:
    return f"{max(1, round(100 * int(mask.sum()) / count))} % of the drive"


def _kmh(speeds_mps: Array) -> str:
    low, high = KMH * speeds_mps.min(), KMH * speeds_mps.max()
    return f"{low:.0f} km/h" if round(low) == round(high) else f"{low:.0f} to {high:.0f} km/h"


def _speeds_mps(scenario: Scenario, line: Line) -> tuple[Array, Array]:
    """Return times of the drive, evenly, and its speeds; none where what moves it is not known before."""
    source = line.source
    end_s = scenario.config.duration_s or source.duration_s
    times = np.linspace(0.0, min(end_s, LONGEST_S), AT_MOST)
    if isinstance(source, MapDrive | DrivenDrive):
        drive = source.drive if isinstance(source, DrivenDrive) else source
        return times, np.array([drive.speed_mps(t_s) for t_s in times.tolist()])
    if isinstance(source, RecordedDrive):
        path = source.drive.path
        at_ns = path.t_ns[0] + (times * NANOSECONDS_PER_SECOND).astype(np.int64)
        known = at_ns <= path.t_ns[-1]
        return times[known], np.array([path.at(int(t_ns)).speed_mps for t_ns in at_ns[known]])
    return np.zeros(0), np.zeros(0)
