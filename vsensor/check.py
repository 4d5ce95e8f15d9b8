"""`vsensor check FILE`: load everything, say which models are on and what they cost, audit, send nothing."""

import time
from dataclasses import dataclass
from math import atan, degrees, inf
from pathlib import Path
from statistics import median

import numpy as np

from vsensor import motion
from vsensor.camera import Camera
from vsensor.clock import SimulatedClock
from vsensor.codec import Database, audit, load_database
from vsensor.config import SHIPPED, Scenario, load_scenario
from vsensor.errors import ConfigError
from vsensor.line import Line, build_line
from vsensor.logs import read_log
from vsensor.motion import MotionConfig
from vsensor.pitfalls import pitfalls
from vsensor.profile import (
    QUANTITIES,
    MessagePlan,
    Profile,
    load_profile,
    quantisation_error_m,
    shipped_profiles,
)
from vsensor.runner import STAGES, run_loop
from vsensor.schema import read_toml, user_path
from vsensor.sources import LOG_SUFFIXES, MAP_SUFFIXES
from vsensor.types import SIDE_NAMES, EgoState, Tick
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map

DATABASE_SUFFIXES = (".dbc", ".arxml", ".kcd", ".sym")
TRACE_SUFFIXES = (".npz", ".parquet")
TRIAL_TICKS = 100
BITS_PER_FRAME = 47 + 64 * 1.2  # classic frame of 8 bytes: overhead, and data with a fifth of stuff bits


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What a check prints; `findings` are what an ECU or a run would stumble over."""

    lines: tuple[str, ...]
    findings: tuple[str, ...]


def check_file(file: str, profile: str | None = None, dbc: Path | None = None) -> Report:
    """Check a scenario, profile, map, database or log by its suffix and content; raises VsensorError."""
    path = user_path(file)
    suffix = path.suffix.lower()
    if suffix in DATABASE_SUFFIXES:
        return _report([], audit(load_database(path)), _database_lines(load_database(path)))
    if suffix in MAP_SUFFIXES:
        return _check_map(path)
    if suffix in LOG_SUFFIXES:
        return _check_log(path)
    if _is_profile(path, file):
        return _check_profile(load_profile(file, dbc))
    if suffix in TRACE_SUFFIXES and path.exists():
        raise ConfigError(
            f"{file}: not a scenario, profile, map, database or log; vsensor score takes traces"
        )
    return _check_scenario(load_scenario(file), profile, dbc)


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


def _check_profile(profile: Profile) -> Report:
    findings = [*audit(load_database(profile.database)), *_sending_findings(profile)]
    return _report([], findings, _profile_lines(profile))


def _rhythm(plan: MessagePlan) -> str:
    """Return when a message leaves, as a person says it."""
    sending = plan.sending
    words = [f"every {sending.cycle_ns / 1e6:g} ms"] if sending.cycle_ns or not sending.is_event else []
    words += ["at every image"] * sending.on_write + ["on change"] * sending.on_change
    words += [f"every {sending.fast_cycle_ns / 1e6:g} ms while active"] if sending.active else []
    return " and ".join(words)


def _sending_findings(profile: Profile) -> list[str]:
    return [text for plan in profile.messages for text in plan.sending.findings]


def _profile_lines(profile: Profile) -> list[str]:
    lines = [f"profile {profile.name} ({profile.path}), role {profile.role}, database {profile.database}"]
    frames_per_s = 0.0
    for plan in profile.messages:
        guard = "" if plan.guard is None else f", E2E {plan.guard.label}"
        layout, cycle_ms = plan.layout, plan.cycle_ns / 1e6
        frames_per_s += 1e3 / cycle_ms if cycle_ms else 0.0
        lines.append(
            f"  0x{layout.arbitration_id:03X} {layout.name:<24} {layout.length} bytes {_rhythm(plan)}"
            f", {len(plan.bindings)} quantities{guard}"
        )
    errors = quantisation_error_m(profile)
    if profile.role == "sensor":
        lines += _without_sna(profile)
        shown = ", ".join(f"{1e3 * error:.1f} mm at {x:g} m" for x, error in errors.items())
        lines.append(f"  quantisation adds at most {shown}")
        load = frames_per_s * BITS_PER_FRAME / 500e3
        lines.append(f"  {frames_per_s:.0f} frames/s, about {100 * load:.1f} % of a bus of 500 kbit/s")
    return lines


def _needs_line(quantity: str) -> bool:
    """Return whether a quantity is a measure that there is none of where no line is seen."""
    return quantity.split(".")[0] in (*SIDE_NAMES.values(), "lane") and QUANTITIES[quantity].unit != ""


def _without_sna(profile: Profile) -> list[str]:
    """Say which numbers go out as their start value while there is none, for want of an SNA value."""
    found = [
        f"{plan.layout.name}.{signal.name} ({binding.signal.physical(signal.start_raw):g})"
        for plan in profile.messages
        for binding in plan.bindings
        for signal in (binding.signal,)
        if _needs_line(binding.quantity) and signal.sna_raw is None and binding.raw_of_code is None
    ]
    return [
        f"  no SNA value, so sent as their start value while there is no line: {', '.join(found)}"
    ] * bool(found)


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


def _check_scenario(scenario: Scenario, profile: str | None, dbc: Path | None) -> Report:
    from vsensor.run import RunOptions, with_profile

    scenario = with_profile(scenario, RunOptions(profile=profile, dbc=dbc))
    line = build_line(scenario)
    uneven = line.uneven(scenario.config.cycle_ms * 1_000_000)
    findings = [*line.source.findings, *uneven, *audit(load_database(line.profile.database))]
    findings += [*_sending_findings(line.profile), *pitfalls(scenario, line)]
    head = [f"scenario {scenario.name}: source {scenario.source}", *line.source.notes]
    head += [f"fault planned: {fault.text()}" for fault in line.timeline]
    return _report(head, findings, [*_model_lines(scenario, line), *_profile_lines(line.profile)])


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


def _model_lines(scenario: Scenario, line: Line) -> list[str]:
    """Say which models are on, and measure what they cost over the first ticks."""
    config = scenario.config
    models = {
        "world": f"{len(config.traffic)} vehicles" if config.traffic else "no traffic",
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
