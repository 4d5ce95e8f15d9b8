"""What was measured as a page of tables; a section that was not measured has none."""

from collections.abc import Mapping, Sequence
from typing import Any

from tools.bench import errors, looking, loop, report_replay, report_timing, scans, tuning, world
from tools.bench.tables import table

Report = Mapping[str, Any]
_KEPT = {True: "yes", False: "no", None: ""}


def markdown(report: Report) -> str:
    """Return the report as Markdown."""
    machine = report["machine"]
    parts = [
        "# Measured",
        f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}, "
        f"numpy {machine['numpy']}; load average at the start {machine['load_average']:.1f}",
        _targets(report),
    ]
    parts += [
        write(report[name])
        for name, write in SECTIONS.items()
        if name in report and "error" not in report[name]
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def number(value: float) -> str:
    """Return a number with three digits that count."""
    return "-" if value != value else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _targets(report: Report) -> str:
    rows: list[Sequence[object]] = []
    for name, write in TARGETS.items():
        if name in report and "error" not in report[name]:
            rows += write(report[name])
    if not rows:
        return ""
    shown = [(what, target, measured, _KEPT[kept]) for what, target, measured, kept in rows]
    missed = sum(1 for *_, kept in rows if kept is False)
    text = f"{missed} of {sum(kept is not None for *_, kept in rows)} targets missed"
    if missed:
        text += "; the tables of stages below say where the time goes"
    return f"{text}.\n\n{table(('figure', 'target', 'measured', 'kept'), shown)}"


def _demo(demo: Report) -> list[Sequence[object]]:
    measured = (
        f"{demo['p50_ms']:.2f} ms (p99 {demo['p99_ms']:.2f}); "
        f"{demo['p50_per_yardstick']:.2f} x sorting 100,000 numbers"
    )
    return [("demo tick, one core, p50", "2 ms", measured, demo["p50_ms"] <= demo["target_p50_ms"])]


def _fast(fast: Report) -> list[Sequence[object]]:
    plain = fast["plain"]
    times = plain["times_real_time"]
    return [
        ("`--fast`, the loop", "20 x real time", f"{times:.1f} x", times >= fast["target_times_real_time"]),
        (
            "the same with BLF log and trace",
            "",
            f"{fast['with_log_and_trace']['times_real_time']:.1f} x",
            None,
        ),
        ("`--fast`, whole process", "", f"{plain['with_start_and_end_of_the_process']:.1f} x", None),
    ]


def _vcan(vcan: Report) -> list[Sequence[object]]:
    late = vcan["lateness_ms"]
    dropped, lost = vcan["slots_dropped"], vcan["frames_lost"]
    errors = vcan["counter_errors"], vcan["crc_errors"]
    times = f"{late['p50']}, {late['p99']}, {late['max']} ms"
    return [
        (f"vcan ({vcan['kernel']}), {vcan['seconds']} s: slots dropped", "0", dropped, dropped == 0),
        ("the same: frames lost", "0", f"{lost} of {vcan['frames_sent']}", lost == 0),
        ("the same: counter, CRC errors", "0, 0", f"{errors[0]}, {errors[1]}", errors == (0, 0)),
        ("the same: lateness p50, p99, max", "", times, None),
    ]


def _memory(memory: Report) -> list[Sequence[object]]:
    measured = (
        f"{memory['growth_mb']:+.1f} MB, from {memory['after_warm_up_mb']:.0f} MB "
        f"(largest {memory['largest_mb']:.0f})"
    )
    kept = abs(memory["growth_mb"]) <= memory["target_growth_mb"]
    return [
        (f"memory over {memory['simulated_s'] / 60:.0f} simulated minutes", "within 5 MB", measured, kept)
    ]


def _reference(found: Report) -> list[Sequence[object]]:
    frame = (
        f"{found['ratio']:.0f} x ({found['p1_p50_ms']:.1f} ms against {found['ours_p50_ms']:.2f}; "
        f"CPU time {found['ratio_of_cpu_time']:.0f} x)"
    )
    tail = f"{found['p99_per_p50']:.2f} (CPU time {found['p99_per_p50_of_cpu_time']:.2f})"
    unlike = found["points_seen_by_one_only"]
    return [
        (
            "reference scene, a whole frame against P1's algorithms in numpy",
            "40 x faster",
            frame,
            found["ratio"] >= found["target_ratio"],
        ),
        ("the same: p99 / p50", "2.5", tail, found["p99_per_p50"] <= found["target_p99_per_p50"]),
        ("the same: points that only one of both sees", "0.1 %", f"{unlike:.3%}", unlike <= 1e-3),
    ]


def _reference_page(found: Report) -> str:
    scene = (
        f"4 lines of 1000 points, {found['boxes']} vehicles on the move, at least "
        f"{found['boxes_in_view_at_least']} of them in view, at least {found['hidden_at_least']:.0%} of the "
        f"points hidden, UTM coordinates, {found['frames_a_tick']} frames a tick. Ours makes errors and "
        "tracks, P1's side does not. Other processes lengthen the p99 on the clock, hardly that of "
        "CPU time."
    )
    return f"## The reference scene\n\n{scene}\n\n{_stages(found['stages_p50_ms'])}"


def _occlusion(found: Report) -> list[Sequence[object]]:
    rows = []
    for name, times in found["times_faster_than"].items():
        least = found["targets"].get(name)
        target, kept = (f"{least:.0f} x faster", times >= least) if least else ("", None)
        measured = f"{times:.2f} x ({found['ms'][name]:.2f} ms against {found['ms']['ours']:.2f})"
        rows.append(
            (f"occlusion with rebuild, 50 boxes, 4000 points, against {name}", target, measured, kept)
        )
    return rows


def _frontier_page(found: Report) -> str:
    at = [f"{x:.0f}m" for x in found["ranges_m"]]
    points = [
        p for p in found["points"] if any(p[f"front_{x}"] or p.get(f"front_of_cameras_{x}") for x in at)
    ]
    rows = []
    for p in sorted(points, key=lambda p: p["p50_ms"]):
        camera = f"{p['width_px']} px, {p['occlusion']}" if p["width_px"] else "bypassed"
        errors = [f"{1000 * p[f'rms_{x}']:.1f} ({1000 * p[f'worst_{x}']:.0f})" for x in at]
        fronts = [x for x in at if p[f"front_{x}"]], [x for x in at if p.get(f"front_of_cameras_{x}")]
        names = (", ".join(front) or "-" for front in fronts)
        fit = f"{p['order']}, {p['weighting']}"
        seen = f"{p['answered']:.0%}"
        rows.append((p["spacing_m"], camera, fit, f"{p['p50_ms']:.2f}", *errors, seen, *names))
    errors = [f"error at {x[:-1]} m, mm: rms (worst)" for x in at]
    fronts = ("front at", "front of cameras at")
    head = ("spacing, m", "camera, occlusion", "order, weighting", "ms", *errors, "answered", *fronts)
    text = (
        f"frontier.png: {len(found['points'])} settings, each on {found['images_a_drive']} images of "
        f"{' and of '.join(found['drives'])}: CPU time from the truth of a tick to its frames, without the "
        "map's, and the reported polynomial less the true line (points 0.05 m apart, float64). Without the "
        "error model. *answered*: share of the true lines that were reported there; without occlusion or "
        "camera it is larger, and those lines are errors of another kind. The front of cameras leaves such "
        "settings out. All settings are in bench.json; here those of a front:"
    )
    return f"## Time against error\n\n{text}\n\n{table(head, rows)}"


def _growth_page(found: Report) -> str:
    rows = []
    for what, curves in found.items():
        sizes = curves["sizes"]
        for name, times in curves["ms"].items():
            ends = f"{number(times[0])} to {number(times[-1])}"
            rows.append((name, f"{sizes[0]} to {sizes[-1]} {what}", ends, f"{curves['exponents'][name]:.2f}"))
    head = ("what", "over", "ms", "power, larger half of the sizes")
    text = (
        "growth.png. Targets: linear in points; the query of obstacles below linear, the rebuild linear. "
        "The camera's power is above 1 where its arrays outgrow the processor's caches, from some 100,000 "
        "points on. Obstacles: 4000 points; a shape of triangles is built once, then only its rays move."
    )
    return f"## Growth\n\n{text}\n\n{table(head, rows)}"


def _hard_page(found: Report) -> str:
    rows = [
        (
            row["case"],
            row["quantity"],
            f"{row['worst']:.1e} {row['unit']}",
            f"{row['bound']:.1e}",
            row["reference"],
        )
        for row in found["rows"]
    ]
    return "## Hard cases\n\n" + table(("case", "quantity", "worst error", "bound", "against"), rows)


def _stages(stages: Report) -> str:
    return table(("stage", "p50 ms"), [(stage, f"{ms:.3f}") for stage, ms in stages.items()])


TARGETS = {
    "demo_tick": _demo,
    "fast": _fast,
    "encoding": report_timing.encoding,
    "decoding": report_timing.decoding,
    "errors": errors.targets,
    "vcan": _vcan,
    "closed_loop": loop.targets,
    "timing": report_timing.timing,
    "replay": report_replay.targets,
    "reference": _reference,
    "occlusion": _occlusion,
    "memory": _memory,
    "scan": scans.targets,
    "tune": tuning.targets,
    "world": world.targets,
    "examine": looking.targets,
}
SECTIONS = {
    "demo_tick": lambda demo: "## The demo tick\n\n" + _stages(demo["stages_p50_ms"]),
    "timing": report_timing.timing_page,
    "replay": report_replay.page,
    "reference": _reference_page,
    "occlusion": lambda found: "## Occlusion in the reference scene\n\n" + _stages(found["parts_p50_ms"]),
    "frontier": _frontier_page,
    "growth": _growth_page,
    "hard_cases": _hard_page,
    "scan": scans.page,
    "tune": tuning.page,
    "world": world.page,
}
