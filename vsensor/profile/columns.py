"""Many frames of one message at once, into columns of quantities."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsensor.codec import BulkReader
from vsensor.profile.plan import MessagePlan
from vsensor.types import Array, BoolArray, CodeArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A quantity over a log: `values` (M,) in the frames `rows` (M,), NaN = not available."""

    rows: IntArray
    values: Array


def rows_of(
    plan: MessagePlan,
    ids: NDArray[np.uint32],
    data: CodeArray,
    lengths: CodeArray,
    extended: BoolArray | None,
) -> IntArray:
    """Return the rows of a message among frames (N,): of its id, and long enough."""
    layout = plan.layout
    if data.ndim != 2 or data.shape[1] < layout.length:
        return np.empty(0, dtype=np.int64)
    mine = (ids == layout.arbitration_id) & (lengths >= layout.length)
    if extended is not None:
        mine &= extended == layout.is_extended
    return np.flatnonzero(mine)


def columns_of(plan: MessagePlan, rows: IntArray, data: CodeArray) -> dict[str, Column]:
    """Return the quantities of the frames `rows` (N,) of a message, `data` (N, L), where they carry them."""
    reader = BulkReader(plan.layout, data)
    values = _bulk_values(plan, reader)
    if not plan.layout.muxers:
        return {quantity: Column(rows=rows, values=column) for quantity, column in values.items()}
    carried = {quantity: np.zeros(len(rows), dtype=bool) for quantity in values}
    for binding in plan.told:
        carried[binding.quantity] |= np.all([reader.selected(s) for s in binding.signals], axis=0)
    columns = {q: Column(rows=rows[mask], values=values[q][mask]) for q, mask in carried.items()}
    return {quantity: column for quantity, column in columns.items() if len(column.rows)}


def _bulk_values(plan: MessagePlan, reader: BulkReader) -> dict[str, Array]:
    values: dict[str, Array] = {}
    for binding in plan.told:
        told, before = binding.column(reader), values.get(binding.quantity)
        values[binding.quantity] = told if before is None else np.where(np.isnan(before), told, before)
    for validity in plan.validities:
        signal = validity.signal
        valid = (reader.raw(signal.name) == validity.valid_raw) | ~reader.selected(signal)
        for quantity in filter(validity.covers, list(values)):
            values[quantity] = np.where(valid, values[quantity], np.nan)
    return values


def merged(columns: Sequence[Column]) -> Column:
    """Return one column of those of several messages, its rows in order."""
    if len(columns) == 1:
        return columns[0]
    rows = np.concatenate([column.rows for column in columns])
    order = np.argsort(rows, kind="stable")
    return Column(rows=rows[order], values=np.concatenate([column.values for column in columns])[order])
