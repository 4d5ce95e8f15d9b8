"""Settings that load, but do nothing, or what nobody wants: `vsensor check` says them as findings."""

from math import atan, degrees

import numpy as np

from vsensor.camera import Camera, normalised
from vsensor.config import Scenario
from vsensor.line import Line
from vsensor.sources.drive import RecordedDrive
from vsensor.sources.driven import DrivenDrive
from vsensor.sources.live import LiveDrive
from vsensor.sources.map_drive import MapDrive

ASSUMED = ("assumed_height_m", "assumed_pitch_deg", "assumed_roll_deg")
GRID = (129, 81)


def pitfalls(scenario: Scenario, line: Line) -> list[str]:
    """Return what the scenario's settings do not do though they seem to, one sentence each."""
    return [
        *_fold_in_image(line.sensor.camera),
        *_assumed_without_effect(scenario),
        *_without_map(scenario, line),
        *_lanes_that_are_not_there(scenario, line),
        *_bumps_that_nobody_feels(scenario, line),
        *_faults_after_the_end(scenario),
    ]


def _fold_in_image(camera: Camera) -> list[str]:
    """Say which part of the image no ray reaches, as the lens's polynomial folds back before its edge."""
    lens, config = camera.distortion, camera.config
    if lens is None or config.model == "none":
        return []
    u = np.linspace(-0.5, config.width_px - 0.5, GRID[0])
    v = np.linspace(-0.5, config.height_px - 0.5, GRID[1])
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    empty = float(np.isnan(normalised(camera, pixels)[0]).mean())
    if not empty:
        return []
    return [
        f"camera.distortion: the lens folds back at {degrees(atan(lens.radius)):.0f} deg off axis, inside "
        f"the image: {max(1, round(100 * empty))} % of it shows nothing"
    ]


def _assumed_without_effect(scenario: Scenario) -> list[str]:
    camera = scenario.config.camera
    if camera.inverse == "ground_plane":
        return []
    given = [name for name in ASSUMED if getattr(camera, name) is not None]
    return [f'camera.{name}: without effect, as camera.inverse is "{camera.inverse}"' for name in given]


def _without_map(scenario: Scenario, line: Line) -> list[str]:
    if not isinstance(line.source, RecordedDrive):
        return []
    given = [name for name in ("traffic", "obstacle") if getattr(scenario.config, name)]
    return [f"[[{name}]]: without effect, as source is a log and not a map" for name in given]


def _lanes_that_are_not_there(scenario: Scenario, line: Line) -> list[str]:
    """Name the vehicles that start on a lane that the road has not; they drive where one would be."""
    drive = line.source.drive if isinstance(line.source, LiveDrive | DrivenDrive) else line.source
    if not isinstance(drive, MapDrive):
        return []
    corridor, found = drive.corridor, []
    for number, one in enumerate(scenario.config.traffic):
        ahead_m, lanes = (
            points if isinstance(points, int | float) else points[0][1]
            for points in (one.ahead_m, one.lanes_left)
        )
        if not corridor.reaches(ahead_m) or corridor.lane_beside(max(ahead_m, 0.0), round(lanes)) is not None:
            continue
        found.append(
            f"traffic[{number}].lanes_left = {lanes:g}: no such lane where it starts, "
            "so it drives beside the road's lanes"
        )
    return found


def _bumps_that_nobody_feels(scenario: Scenario, line: Line) -> list[str]:
    drive = line.source.drive if isinstance(line.source, LiveDrive) else line.source
    if not isinstance(drive, MapDrive) or scenario.config.motion.body:
        return []
    if not drive.corridor.road_map.has_swells:
        return []
    return ["motion.body = false: the road's bumps and roughness are without effect"]


def _faults_after_the_end(scenario: Scenario) -> list[str]:
    """Name the faults that are planned for a time that the run does not reach."""
    end_s = scenario.config.duration_s
    return [
        f"fault[{number}].at_s = {fault.at_s:g}: without effect, as duration_s is {end_s:g}"
        for number, fault in enumerate(scenario.config.fault)
        if fault.at_s is not None and end_s is not None and fault.at_s >= end_s
    ]
