"""Files of every kind: load everything, say which models are on and what they cost, audit, send nothing."""

import time
from dataclasses import dataclass
from math import atan, degrees, inf
from pathlib import Path
from statistics import median

import numpy as np

from vsensor import motion
from vsensor.camera import Camera
from vsensor.check.busload import DEFAULT_SPEED, BusSpeed
from vsensor.check.errors import error_findings, error_lines
from vsensor.check.profile import profile_findings, profile_lines
from vsensor.clock import SimulatedClock
from vsensor.codec import Database, audit, load_database
from vsensor.config import SHIPPED, Scenario, load_scenario
from vsensor.errors import ConfigError
from vsensor.line import Line, build_line
from vsensor.logs import read_log
from vsensor.motion import MotionConfig
from vsensor.pitfalls import pitfalls
from vsensor.profile import load_profile, shipped_profiles
from vsensor.runner import STAGES, run_loop
from vsensor.schema import read_toml, user_path
from vsensor.sources import LOG_SUFFIXES, MAP_SUFFIXES
from vsensor.sources.storyboard import StoryDrive
from vsensor.types import EgoState, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.road import is_road_file

DATABASE_SUFFIXES = (".dbc", ".arxml", ".kcd", ".sym")
TRACE_SUFFIXES = (".npz", ".parquet")
TRIAL_TICKS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a check prints; `findings` are what an ECU or a run would stumble over."""

    lines: tuple[str, ...]
    findings: tuple[str, ...]


def check_file(
    file: str, profile: str | None = None, dbc: Path | None = None, bus: BusSpeed = DEFAULT_SPEED
) -> Report:
    """Check a scenario, profile, map, database or log by its suffix and content; raises VsensorError.

    `bus`: the bit rates at which the load of a sensor's profile is told.
    """
    path = user_path(file)
    suffix = path.suffix.lower()
    if suffix in DATABASE_SUFFIXES:
        return _report([], audit(load_database(path)), _database_lines(load_database(path)))
    if suffix in MAP_SUFFIXES or is_road_file(path):
        return _check_map(path)
    if suffix in LOG_SUFFIXES:
        return _check_log(path)
    if _is_profile(path, file):
        loaded = load_profile(file, dbc)
        return _report([], profile_findings(loaded, bus), profile_lines(loaded, bus))
    if suffix in TRACE_SUFFIXES and path.exists():
        raise ConfigError(
            f"{file}: not a scenario, profile, map, database or log; vsensor score takes traces"
        )
    return _check_scenario(load_scenario(file), profile, dbc, bus)


def _is_profile(path: Path, name: str) -> bool:
    if path.suffix == ".toml":
        return str(read_toml(path).get("schema", "")).startswith("vsensor.profile/")
    return name in shipped_profiles() and not (SHIPPED / f"{name}.toml").exists()


def _report(head: list[str], findings: list[str], tail: list[str]) -> Report:
    lines = [*head, *tail, *(f"finding: {text}" for text in findings)]
    lines.append(f"{len(findings)} findings" if findings else "no findings")
    return Report(lines=tuple(lines), findings=tuple(findings))


def _database_lines(database: Database) -> list[str]:
    count = sum(len(layout.signals) for layout in database.layouts.values())
    return [f"{len(database.layouts)} messages, {count} signals"]


def _check_map(path: Path) -> Report:
    road_map = load_map(path)
    corridor = Corridor(road_map)
    length_m = corridor.length_m
    length = "closed circuit" if length_m == inf else f"{length_m:.1f} m"
    start = corridor.start
    lines = [
        f"map {path}: {len(road_map.roads)} roads",
        f"drive from road {start.road_id}, lane {start.lane_id}: {length}",
    ]
    return _report(lines, list(road_map.warnings), [])


def _check_log(path: Path) -> Report:
    report = read_log(path).report
    problems = report.problems()
    return _report([], problems, [line for line in report.lines() if line not in problems])


def _check_scenario(scenario: Scenario, profile: str | None, dbc: Path | None, bus: BusSpeed) -> Report:
    from vsensor.run import RunOptions, with_profile

    scenario = with_profile(scenario, RunOptions(profile=profile, dbc=dbc))
    line = build_line(scenario)
    uneven = line.uneven(scenario.config.cycle_ms * 1_000_000)
    findings = [*line.source.findings, *uneven, *profile_findings(line.profile, bus)]
    findings += [*pitfalls(scenario, line), *error_findings(scenario, line)]
    head = [f"scenario {scenario.name}: source {scenario.source}", *line.source.notes]
    head += error_lines(scenario, line.sensor.law)
    head += [f"fault planned: {fault.text()}" for fault in line.timeline]
    return _report(head, findings, [*_model_lines(scenario, line), *profile_lines(line.profile, bus)])


def _motion_lines(line: Line, config: MotionConfig, period_ns: int) -> list[str]:
    """Say what moves the camera, and its part of the camera's time; nothing if nothing does."""
    if line.sensor.motion is None:
        return []
    state, ego = motion.initial_state(), EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=30.0)
    times_ms = []
    for index in range(TRIAL_TICKS):
        tick = Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)
        began_ns = time.perf_counter_ns()
        state, _ = motion.advance(line.sensor.motion, state, ego, line.sensor.draws, tick)
        times_ms.append((time.perf_counter_ns() - began_ns) / 1e6)
    springs = f"springs on, {len(config.bumps)} bumps" if config.body else "springs off"
    vibration = config.vibration_file or config.vibration
    return [f"    of it motion {median(times_ms):7.3f} ms  {springs}, vibration {vibration}"]


def _optics(camera: Camera) -> str:
    """Say which models of the camera are on."""
    config, lens = camera.config, camera.distortion
    if config.model == "none":
        return "bypassed"
    words: list[str] = [config.model]
    words.append(f"{config.width_px} x {config.height_px} px" if config.pixel_grid else "no pixel grid")
    if lens is not None:
        values = ((name, getattr(lens, name)) for name in ("k1", "k2", "k3", "p1", "p2"))
        words.append("lens " + " ".join(f"{name} {value:g}" for name, value in values if value))
        if lens.radius < inf:
            words[-1] += f" to {degrees(atan(lens.radius)):.0f} deg off axis"
    if config.max_range_m is not None:
        words.append(f"sight {config.max_range_m:g} m")
    if config.min_width_px:
        words.append(f"paint from {config.min_width_px:g} px")
    if camera.assumed_from_ego is not None:
        words.append("ground plane")
    return ", ".join([*words, f"occlusion {config.occlusion}"])


def _others(scenario: Scenario, line: Line) -> int:
    """Return how many vehicles are beside the one with the sensor."""
    source = line.source
    return source.others if isinstance(source, StoryDrive) else len(scenario.config.traffic)


def _model_lines(scenario: Scenario, line: Line) -> list[str]:
    """Say which models are on, and measure what they cost over the first ticks."""
    config = scenario.config
    models = {
        "world": f"{others} vehicles" if (others := _others(scenario, line)) else "no traffic",
        "camera": _optics(line.sensor.camera),
        "region+error": f"range by speed {'on' if config.region.enabled else 'off'}, "
        f"errors {config.error_model.mode}",
        "fit+track": f"order {config.fit.order}, {config.fit.weighting} weights",
        "signals+codec": f"{len(line.profile.messages)} messages",
    }
    summary = run_loop(
        line,
        SimulatedClock(),
        period_ns=config.cycle_ms * 1_000_000,
        ticks=TRIAL_TICKS,
        real_time=False,
    )
    p50_ms = summary.stopwatch.p50_ms()
    lines = [f"  {stage:<14} {p50_ms[stage]:7.3f} ms  {models[stage]}" for stage in STAGES if stage in models]
    lines[2:2] = _motion_lines(line, config.motion, config.cycle_ms * 1_000_000)
    total = sum(p50_ms[stage] for stage in models)
    return [
        f"models that are on, and their time per tick (p50 of {summary.ticks} ticks):",
        *lines,
        f"  {'total':<14} {total:7.3f} ms of {config.cycle_ms} ms",
    ]
