"""A table in words: its logs, hours, rows, what is masked, road width and view range."""

from collections.abc import Mapping, Sequence
from typing import Any

from vsensor.field.table import Info, Table, need_polars

HEADER = ("log", "hours", "km", "rows", "used %", "reference", "width m", "left to m", "right to m")


def log_lines(infos: Sequence[Info]) -> list[str]:
    """Return an aligned table, a line for each log and one for all; ranges: the median of the view range."""
    rows = [HEADER, *(_row(info) for info in infos)]
    if len(infos) > 1:
        rows.append(_total(infos))
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEADER))]
    return [
        "  ".join(
            cell.ljust(w) if k == 0 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def table_lines(table: Table) -> list[str]:
    """Return what `vsensor table` shows; the rows and masks are counted anew, the rest is as scanned."""
    polars = need_polars()
    counted = (
        table.scan().group_by("log", "masked").agg(polars.len().alias("rows")).collect(engine="streaming")
    )
    counts: dict[str, dict[str, int]] = {}
    for log, masked, rows in counted.iter_rows():
        counts.setdefault(str(log), {})[masked or "used"] = rows
    infos = []
    for file in table.files:
        masked = counts.get(file.log, {})
        infos.append({**file.info, "masked": masked, "rows": sum(masked.values())})
    return [*log_lines(infos), "", *mask_lines(infos)]


def mask_lines(infos: Sequence[Info]) -> list[str]:
    """Return a line for each reason: rows, and their share."""
    sums: dict[str, int] = {}
    for info in infos:
        for name, count in info.get("masked", {}).items():
            sums[name] = sums.get(name, 0) + count
    total = max(sum(sums.values()), 1)
    ordered = sorted(sums.items(), key=lambda item: -item[1])
    return [f"{name:14} {count:>12} rows  {count / total:6.1%}" for name, count in ordered]


def _row(info: Info) -> tuple[str, ...]:
    rows = int(info.get("rows", 0))
    used = info.get("masked", {}).get("used", 0)
    return (
        str(info.get("log", "")),
        f"{info.get('seconds', 0.0) / 3600:.2f}",
        f"{info.get('metres', 0.0) / 1000:.1f}",
        str(rows),
        f"{100 * used / max(rows, 1):.1f}",
        str(info.get("reference", "")).rsplit("/", 1)[-1],
        _middle(info.get("width_m")),
        *(_middle(info.get("sides", {}).get(side, {}).get("x_max_m")) for side in ("left", "right")),
    )


def _total(infos: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    rows = sum(int(info.get("rows", 0)) for info in infos)
    used = sum(info.get("masked", {}).get("used", 0) for info in infos)
    return (
        f"{len(infos)} logs",
        f"{sum(info.get('seconds', 0.0) for info in infos) / 3600:.2f}",
        f"{sum(info.get('metres', 0.0) for info in infos) / 1000:.1f}",
        str(rows),
        f"{100 * used / max(rows, 1):.1f}",
        *("",) * 4,
    )


def _middle(quantiles: Sequence[float] | None) -> str:
    return "-" if quantiles is None else f"{quantiles[1]:.2f}"
