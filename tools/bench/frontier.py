"""What a tick costs against what it is worth: time and lateral error over the settings that trade them.

The error of a reported line is its polynomial less the true line at x = 20, 50, 80 m, where the
polynomial reaches; the true line is the chain of exact points, 0.05 m apart, of the same instant, in
float64, without camera, pixel grid and error model. All settings run without the error model.
"""

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from msgspec import structs

from tools.bench.measure import one_core
from tools.bench.scene import ticks_at
from vsensor import lanefit
from vsensor.camera import CameraConfig
from vsensor.config import Scenario, load_scenario
from vsensor.error_model import ErrorModelConfig
from vsensor.lanefit import LaneFitConfig
from vsensor.line import Line, LineState, build_line
from vsensor.scene import near
from vsensor.sources import Inputs
from vsensor.sources.map_drive import MapDrive
from vsensor.types import Array, LinePoints, Snapshot, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map

RANGES_M = (20.0, 50.0, 80.0)
DENSE_M = 0.05
SPACINGS_M = (0.1, 0.2, 0.5, 1.0, 2.0)
WIDTHS_PX = (320, 640, 1280, 2560)
ORDERS = (1, 2, 3, 4, 5)
OCCLUSIONS = ("none", "boxes", "embree")
WEIGHTINGS = ("uniform", "sigma", "range")
_NOWHERE = np.full(len(RANGES_M), np.nan)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One point of the frontier; `width_px` 0 = the camera is bypassed."""

    spacing_m: float = 0.1
    width_px: int = 1280
    occlusion: str = "boxes"
    order: int = 3
    weighting: str = "uniform"

    def on(self, line: Line) -> Line:
        """Return the line with this setting; its source is not touched."""
        camera = (
            CameraConfig(width_px=self.width_px, height_px=self.width_px * 5 // 8, occlusion=self.occlusion)
            if self.width_px
            else CameraConfig(model="none")
        )
        fit = LaneFitConfig(order=self.order, weighting=self.weighting)
        errors = ErrorModelConfig(mode="none")
        config = structs.replace(line.sensor.config, camera=camera, fit=fit, error_model=errors)
        return replace(line, sensor=type(line.sensor).of(config))


@dataclass(frozen=True)
class Row:
    """What one setting gave: time of each image, errors by range, which true lines were answered there."""

    times_ms: list[float] = field(default_factory=list)
    errors_m: dict[float, list[float]] = field(default_factory=lambda: {x: [] for x in RANGES_M})
    answered: list[bool] = field(default_factory=list)


class Still:
    """A source whose truth stands still."""

    notes: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    duration_s = float("inf")

    def __init__(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot

    def initial_state(self) -> None:
        """Return the state, which is nothing."""
        return None

    def advance(self, state: None, tick: Tick, inputs: Inputs) -> tuple[None, Snapshot]:
        """Return the one snapshot."""
        return None, self.snapshot


def settings() -> list[Setting]:
    """Return what is tried: spacing x resolution x order, the others around the defaults."""
    found = [
        Setting(spacing_m=spacing, width_px=width, order=order)
        for spacing, width, order in product(SPACINGS_M, (0, *WIDTHS_PX), ORDERS)
    ]
    found += [Setting(spacing_m=s, occlusion=o) for s, o in product(SPACINGS_M, OCCLUSIONS)]
    found += [Setting(weighting=w, width_px=n) for w, n in product(WEIGHTINGS, WIDTHS_PX)]
    return list(dict.fromkeys(found))


def frontier(looks: int = 24, chosen: Sequence[Setting] | None = None) -> dict[str, object]:
    """Measure every setting on both drives, `looks` images each, spread over the drive.

    The time is the CPU time from the truth of a tick to its frames, without that of the map; image by
    image all settings take their turn.
    """
    chosen = settings() if chosen is None else chosen
    rows = {setting: Row() for setting in chosen}
    with tempfile.TemporaryDirectory() as folder, one_core():
        for scenario, seconds in drives(Path(folder)):
            line = build_line(scenario)
            lines = {setting: setting.on(line) for setting in chosen}
            sources = {s: drive_of(scenario, s) for s in {DENSE_M, *(c.spacing_m for c in chosen)}}
            for tick in ticks_at([round(k * seconds / looks * 25) for k in range(looks)]):
                shots = {s: source.advance(None, tick, ())[1] for s, source in sources.items()}
                truth = _truth(line, shots[DENSE_M])
                for setting, at_work in lines.items():
                    _measure(at_work, tick, shots[setting.spacing_m], truth, rows[setting])
    points = [_point(setting, row) for setting, row in rows.items()]
    sees = [point for point in points if point["width_px"] and point["occlusion"] != "none"]
    for x in RANGES_M:
        mark_front(points, x, "front")
        mark_front(sees, x, "front_of_cameras")
    return {"ranges_m": RANGES_M, "images_a_drive": looks, "drives": ["highway", "bends"], "points": points}


def drives(folder: Path) -> Iterator[tuple[Scenario, float]]:
    """Yield the shipped drive and one over bends of 200 to 400 m radius, and how long each is."""
    yield load_scenario("highway"), 88.0
    path = folder / "bends.toml"
    (folder / "bends.xodr").write_text(bends_map())
    path.write_text(
        'schema = "vsensor.scenario/1"\nsource = "bends.xodr"\n[ego]\nspeed_kmh = 90\n'
        '[[traffic]]\nahead_m = 45\n[[traffic]]\nahead_m = 30\nkind = "van"\nlanes_left = 1\n'
    )
    yield load_scenario(str(path)), 36.0


def bends_map() -> str:
    """Return a road of 1000 m whose curvature goes linearly between 0, 1/200, -1/300 and 1/400."""
    curvatures = (0.0, 0.0, 1 / 200, 1 / 200, -1 / 300, -1 / 300, 1 / 400, 1 / 400, 0.0, 0.0)
    lengths = (60.0, 100.0, 100.0, 160.0, 120.0, 120.0, 100.0, 140.0, 100.0)
    x = y = heading = s = 0.0
    plan = []
    for length, (start, end) in zip(lengths, pairwise(curvatures), strict=True):
        shape = f'<spiral curvStart="{start!r}" curvEnd="{end!r}"/>' if start or end else "<line/>"
        if start == end and start:
            shape = f'<arc curvature="{start!r}"/>'
        plan.append(f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{heading!r}" length="{length!r}">{shape}')
        steps = (np.arange(4000) + 0.5) * length / 4000  # the midpoint rule: to 1e-7 m
        angles = heading + start * steps + (end - start) * steps**2 / (2 * length)
        x += float(np.cos(angles).sum()) * length / 4000
        y += float(np.sin(angles).sum()) * length / 4000
        heading += (start + end) / 2 * length
        s += length
    mark = '<roadMark sOffset="0" type="solid" width="0.15" color="white"/>'
    lanes = {n: f'<lane id="{n}" type="driving"><link/>{{}}{mark}</lane>' for n in (2, 1, -1, -2)}
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    left, right = ("".join(lanes[n].format(width) for n in side) for side in ((2, 1), (-1, -2)))
    centre = f'<lane id="0" type="none"><link/>{mark}</lane>'
    return (
        f'<OpenDRIVE><header revMajor="1" revMinor="7"/><road id="1" length="{s!r}" junction="-1"><link/>'
        f"<planView>{'</geometry>'.join(plan)}</geometry></planView><elevationProfile/><lateralProfile/>"
        f'<lanes><laneSection s="0"><left>{left}</left><center>{centre}</center><right>{right}</right>'
        "</laneSection></lanes></road></OpenDRIVE>"
    )


def drive_of(scenario: Scenario, spacing_m: float) -> MapDrive:
    """Return the scenario's drive with points so far apart."""
    config = scenario.config
    start = structs.replace(config.ego.corridor(), spacing_m=spacing_m)
    corridor = Corridor(load_map(scenario.source), start)
    environment = config.environment.weather()
    return MapDrive(corridor, config.ego, config.traffic, environment, config.scene.range_m)


def _truth(line: Line, dense: Snapshot) -> dict[int, Array]:
    """Return for each marking's id its y at RANGES_M, NaN where it does not reach."""
    return ys_at_ranges(near(line.sensor.config.scene, dense.ego, dense.scene), dense)


def ys_at_ranges(lines: LinePoints, snapshot: Snapshot) -> dict[int, Array]:
    """Return for each line, by its marking's id, y at RANGES_M between its points."""
    found = {}
    for place, (start, stop) in zip(lines.marking.tolist(), pairwise(lines.starts.tolist()), strict=True):
        points = lines.points_ego_m[start:stop]
        y = np.interp(RANGES_M, points[:, 0], points[:, 1], left=np.nan, right=np.nan)
        found[snapshot.scene.markings[place].id] = y
    return found


def _measure(line: Line, tick: Tick, shot: Snapshot, truth: dict[int, Array], row: Row) -> None:
    """Add one image to `row`."""
    at_work = replace(line, source=Still(shot))
    state = at_work.initial_state()
    best_ns = min(_cpu_ns(at_work, state, tick) for _ in range(2))  # the first finds the caches cold
    row.times_ms.append(best_ns / 1e6)
    output = at_work.compute(state, tick).output
    seen = output.detections
    fits = lanefit.fit_lines(line.sensor.config.fit, seen.lines, seen.sigma_y_m)
    for place, fit in zip(seen.lines.marking.tolist(), fits, strict=True):
        true_m = truth.get(shot.scene.markings[place].id, _NOWHERE)
        for x, y_m in zip(RANGES_M, true_m.tolist(), strict=True):
            reaches = fit is not None and fit.x_min_m - 0.5 <= x <= fit.x_max_m + 0.5
            if y_m == y_m:
                row.answered.append(reaches)
                if reaches:
                    row.errors_m[x].append(fit.y_at(x) - y_m)


def _cpu_ns(line: Line, state: LineState, tick: Tick) -> int:
    began = time.thread_time_ns()
    line.compute(state, tick)
    return time.thread_time_ns() - began


def _point(setting: Setting, row: Row) -> dict[str, object]:
    point = {name: getattr(setting, name) for name in setting.__dataclass_fields__}
    point |= {"p50_ms": float(np.median(row.times_ms)), "answered": float(np.mean(row.answered))}
    for x, values in row.errors_m.items():
        point[f"rms_{x:.0f}m"] = float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")
        point[f"worst_{x:.0f}m"] = float(np.abs(values).max()) if values else float("nan")
    return point


def mark_front(points: list[dict], x_m: float, name: str) -> None:
    """Mark which points no other beats in both time and error at x."""
    best, at = float("inf"), f"{x_m:.0f}m"
    for point in sorted(points, key=lambda point: (point["p50_ms"], point[f"rms_{at}"])):
        point[f"{name}_{at}"] = bool(point[f"rms_{at}"] < best)
        best = min(best, point[f"rms_{at}"])
