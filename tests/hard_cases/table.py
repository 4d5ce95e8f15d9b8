"""The worst error of every hard case: `rows()` for the tests and for reports, `text()` to look at."""

from functools import cache

from tests.hard_cases import attitudes, crests, edges, far_out, fits, mesh_edges, times
from tests.hard_cases.exact import Row

PARTS = {
    "far_out": far_out,
    "attitudes": attitudes,
    "edges": edges,
    "mesh_edges": mesh_edges,
    "crests": crests,
    "fits": fits,
    "times": times,
}


@cache
def rows_of(part: str) -> list[Row]:
    """Return the rows of one part, measured once."""
    return PARTS[part].rows()


def rows() -> list[Row]:
    """Return (case, quantity, worst error, unit, bound, reference) of every case; takes some seconds."""
    return [row for part in PARTS for row in rows_of(part)]


def text(found: list[Row]) -> str:
    """Return the rows as a table in Markdown."""
    lines = ["| case | quantity | worst error | bound | against |", "|---|---|---|---|---|"]
    for case, quantity, worst, unit, bound, reference in found:
        lines.append(f"| {case} | {quantity} | {worst:.1e} {unit} | {bound:.1e} | {reference} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(text(rows()))
