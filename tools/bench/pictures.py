"""The pictures of the report."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tools.bench.timing import CYCLES_MS as CYCLE_PLACES
from tools.bench.timing import NAMES, PLACES

COLOURS = {0: "#7a7a7a", 320: "#d1495b", 640: "#edae49", 1280: "#00798c", 2560: "#30638e"}
MARKERS = {0.1: "o", 0.2: "s", 0.5: "^", 1.0: "D", 2.0: "v"}


def frontier(found: Mapping[str, Any], path: Path) -> None:
    """Draw time per tick against lateral error, one panel per range, the Pareto front joined."""
    plt = _pyplot()
    ranges = [f"{x:.0f}m" for x in found["ranges_m"]]
    figure, panels = plt.subplots(1, len(ranges), figsize=(16, 6), sharey=True, layout="constrained")
    for panel, at in zip(panels, ranges, strict=True):
        for point in found["points"]:
            panel.scatter(
                point["p50_ms"],
                1000 * point[f"rms_{at}"],
                s=14 + 14 * (point["order"] - 1),
                marker=MARKERS.get(point["spacing_m"], "x"),
                facecolor=COLOURS.get(point["width_px"], "black"),
                edgecolor="none",
                alpha=0.65,
            )
        for front, dashes in (("front", "-"), ("front_of_cameras", "--")):
            chosen = [point for point in found["points"] if point.get(f"{front}_{at}")]
            steps = sorted((point["p50_ms"], 1000 * point[f"rms_{at}"]) for point in chosen)
            x, y = zip(*steps, strict=True)
            panel.plot(x, y, dashes, drawstyle="steps-post", color="black", lw=1, zorder=0)
            panel.scatter(x, y, s=110, ls=dashes, facecolor="none", edgecolor="black")
        panel.set(yscale="log", xlabel="CPU time per tick, ms", title=f"at x = {at[:-1]} m")
        panel.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("lateral error, root mean square, mm")
    handles = [_dot(plt, colour, "o", f"{width} px wide" if width else "camera bypassed")
               for width, colour in COLOURS.items()]  # fmt: skip
    handles += [
        _dot(plt, "black", marker, f"{spacing} m between points") for spacing, marker in MARKERS.items()
    ]
    handles += [_dot(plt, "black", "o", f"order {order}", 14 + 14 * (order - 1)) for order in (1, 3, 5)]
    for dashes, label in (("-", "Pareto front"), ("--", "the same, obstacles hide")):
        line = plt.Line2D([], [], ls=dashes, color="black", marker="o", mfc="none", ms=10, label=label)
        handles.append(line)
    figure.legend(handles=handles, loc="outside right center", fontsize=9, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def growth(found: Mapping[str, Any], path: Path) -> None:
    """Draw time over size on log-log axes, with the fitted powers."""
    plt = _pyplot()
    figure, panels = plt.subplots(1, len(found), figsize=(5.4 * len(found), 5), layout="constrained")
    for panel, (what, curves) in zip(panels, found.items(), strict=True):
        for name, times in curves["ms"].items():
            panel.loglog(curves["sizes"], times, "o-", label=f"{name}: power {curves['exponents'][name]:.2f}")
        panel.set(xlabel=f"number of {what}", ylabel="time, ms", title=f"over {what}")
        panel.grid(alpha=0.3, which="both")
        panel.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def timing(found: Mapping[str, Any], path: Path) -> None:
    """Draw lateness over the cycle: p50 to max of every sender, one panel per place."""
    plt = _pyplot()
    places = list(dict.fromkeys(row["bus"] for row in found["rows"]))
    figure, panels = plt.subplots(
        1, len(places), figsize=(7 * len(places), 6), sharey=True, squeeze=False, layout="constrained"
    )
    for panel, place in zip(panels[0], places, strict=True):
        rows = [row for row in found["rows"] if row["bus"] == place]
        senders = list(dict.fromkeys(row["who"] for row in rows))
        for row in rows:
            x = CYCLE_PLACES.index(row["cycle_ms"]) + 0.12 * (senders.index(row["who"]) - len(senders) / 2)
            y = [max(row["lateness"][name], 1e-4) for name in ("p50", "p99", "p99.9", "max")]
            colour = f"C{list(NAMES).index(row['who'])}"
            panel.plot([x] * 4, y, "-", color=colour, alpha=0.5)
            for value, marker in zip(y, "osd^", strict=True):
                panel.plot(x, value, marker, color=colour, ms=5)
        panel.set(yscale="log", title=PLACES[place], xlabel="cycle, ms")
        panel.set_xticks(range(len(CYCLE_PLACES)), map(str, CYCLE_PLACES))
        panel.grid(alpha=0.3, which="both")
    panels[0][0].set_ylabel("lateness of the first frame, ms: p50 o, p99 square, p99.9 diamond, max triangle")
    used = dict.fromkeys(row["who"] for row in found["rows"])
    handles = [_dot(plt, f"C{list(NAMES).index(who)}", "o", NAMES[who]) for who in used]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _pyplot():
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt


def _dot(plt, colour, marker, label, size=40):
    return plt.Line2D([], [], ls="", color=colour, marker=marker, ms=size**0.5, label=label)
