"""A profile at work: signals bound to quantities, and frames decoded into quantities."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vsensor.codec import BulkReader, Layout, unpack
from vsensor.e2e import Guard
from vsensor.profile.binding import Binding, Validity
from vsensor.profile.bursts import NOTHING_OPEN, Assembly, Burst, Image, assemble, left_over
from vsensor.profile.config import GeometryConfig
from vsensor.profile.pages import Page
from vsensor.profile.quantities import LINES
from vsensor.profile.sending import SendPlan
from vsensor.types import Array, BoolArray, CodeArray, Frame, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class MessagePlan:
    """One message of a profile.

    `bindings` are encoded, `told` of them are decoded. `constants` are the raw values of all other signals.
    `pages`: the multiplexers' values of its frames, sent as `mux` says; `padding` follows its data.
    """

    layout: Layout
    sending: SendPlan
    bindings: tuple[Binding, ...]
    told: tuple[Binding, ...]
    validities: tuple[Validity, ...]
    constants: Mapping[str, int]
    guard: Guard | None
    pages: tuple[Page, ...] = ({},)
    mux: str = "together"
    padding: bytes = b""
    bitrate_switch: bool = False

    @property
    def cycle_ns(self) -> int:
        """The cycle time, 0 if it has none."""
        return self.sending.cycle_ns

    def intact(self, data: bytes) -> bool:
        """Return whether the frame's CRC is right; True for a message without protection."""
        return self.guard is None or self.guard.check(data)


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A quantity over a log: `values` (M,) in the frames `rows` (M,), NaN = not available."""

    rows: IntArray
    values: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A bus as the model sees it: messages in the order they are sent. `geometry`: see signals.to_bus."""

    name: str
    path: Path
    role: str
    description: str
    database: Path
    geometry: GeometryConfig
    messages: tuple[MessagePlan, ...]
    by_id: Mapping[tuple[int, bool], MessagePlan]
    bursts: tuple[Burst, ...] = ()
    wide_ranges: str = "refuse"

    def decode(self, frame: Frame, *, check: bool = False) -> dict[str, float] | None:
        """Return the quantities of a frame in SI and model signs, NaN = not available.

        None if the frame is not of this profile, is too short, or (with `check`) its CRC is wrong. What
        needs a whole line (origin, edge, angle) is undone by signals.from_bus.
        """
        plan = self.by_id.get((frame.arbitration_id, frame.is_extended))
        if plan is None or len(frame.data) < plan.layout.length:
            return None
        data = frame.data[: plan.layout.length]
        if check and not plan.intact(data):
            return None
        raws = unpack(plan.layout, data)
        values: dict[str, float] = {}
        for binding in plan.told:
            raw = binding.raw_in(raws)
            if raw is not None:
                value = binding.value(raw)
                # One of several signals that share a quantity (solid bit, dashed bit) tells it.
                if binding.quantity not in values or math.isnan(values[binding.quantity]):
                    values[binding.quantity] = value
        for validity in plan.validities:
            if raws.get(validity.signal.name, validity.valid_raw) != validity.valid_raw:
                values |= dict.fromkeys(filter(validity.covers, values), math.nan)
        return values

    def assemble(self, state: Assembly, frame: Frame) -> tuple[Assembly, tuple[Image, ...]]:
        """Put the frames of bursts together: return the state after this one, and the images it ended.

        Start with NOTHING_OPEN. Frames that are foreign, too short or of no burst change nothing.
        """
        plan = self.by_id.get((frame.arbitration_id, frame.is_extended))
        if plan is None or len(frame.data) < plan.layout.length:
            return state, ()
        right = plan.intact(frame.data[: plan.layout.length])
        return assemble(self.bursts, plan.layout.name, state, frame, is_right=right)

    def decode_arrays(
        self,
        ids: NDArray[np.uint32],
        data: CodeArray,
        lengths: CodeArray,
        *,
        extended: BoolArray | None = None,
        check: bool = False,
    ) -> dict[str, Column]:
        """Decode many frames at once: `ids` (N,), `data` (N, 8 or 64), `lengths` (N,) bytes, `extended` (N,).

        Frames that are too short, or (with `check`) have a wrong CRC or are of a burst that is not intact,
        are left out. A quantity that several messages carry has the rows of all of them, in order.
        """
        parts: dict[str, list[Column]] = {}
        broken = self.broken_rows(ids, data, lengths, extended=extended) if check and self.bursts else None
        for plan in self.messages:
            rows = _rows(plan, ids, data, lengths, extended)
            if check and plan.guard is not None and len(rows):
                rows = rows[plan.guard.check_bulk(data[rows, : plan.layout.length])]
            if broken is not None:
                rows = rows[~broken[rows]]
            if len(rows):
                for quantity, column in _columns(plan, rows, data[rows, : plan.layout.length]).items():
                    parts.setdefault(quantity, []).append(column)
        return {quantity: _merged(columns) for quantity, columns in parts.items()}

    def broken_rows(
        self,
        ids: NDArray[np.uint32],
        data: CodeArray,
        lengths: CodeArray,
        *,
        extended: BoolArray | None = None,
    ) -> BoolArray:
        """Return which frames (N,) belong to a burst that is not intact; arguments as for decode_arrays."""
        broken = np.zeros(len(ids), dtype=bool)
        members = {name for burst in self.bursts for name in burst.layouts}
        plans = [plan for plan in self.messages if plan.layout.name in members]
        places = [_rows(plan, ids, data, lengths, extended) for plan in plans]
        state, images = NOTHING_OPEN, list[Image]()
        for row in np.sort(np.concatenate([*places, np.empty(0, dtype=np.int64)])).tolist():
            frame = Frame(
                due_ns=row,
                arbitration_id=int(ids[row]),
                data=data[row, : lengths[row]].tobytes(),
                is_extended=extended is not None and bool(extended[row]),
            )
            state, ended = self.assemble(state, frame)
            images += ended
        for image in (*images, *left_over(self.bursts, state)):
            broken[[frame.due_ns for frame in image.frames]] = not image.is_intact
        return broken

    def frame_kinds(
        self,
        ids: NDArray[np.uint32],
        data: CodeArray,
        lengths: CodeArray,
        *,
        extended: BoolArray | None = None,
    ) -> IntArray:
        """Return a number (N,) for each frame that those of another message or another page do not have."""
        kinds = ids.astype(np.int64)
        for plan in self.messages:
            rows = _rows(plan, ids, data, lengths, extended) if len(plan.pages) > 1 else np.empty(0, np.int64)
            if len(rows):
                reader = BulkReader(plan.layout, data[rows, : plan.layout.length])
                for number, page in enumerate(plan.pages):
                    mine = np.all([reader.raw(name) == raw for name, raw in page.items()], axis=0)
                    kinds[rows[mine]] += (number + 1) << 32
        return kinds

    def quantities(self) -> set[str]:
        """Return the quantities that the profile carries."""
        return {binding.quantity for plan in self.messages for binding in plan.bindings}


def _rows(
    plan: MessagePlan,
    ids: NDArray[np.uint32],
    data: CodeArray,
    lengths: CodeArray,
    extended: BoolArray | None,
) -> IntArray:
    layout = plan.layout
    if data.ndim != 2 or data.shape[1] < layout.length:
        return np.empty(0, dtype=np.int64)
    mine = (ids == layout.arbitration_id) & (lengths >= layout.length)
    if extended is not None:
        mine &= extended == layout.is_extended
    return np.flatnonzero(mine)


def _columns(plan: MessagePlan, rows: IntArray, data: CodeArray) -> dict[str, Column]:
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


def _merged(columns: Sequence[Column]) -> Column:
    if len(columns) == 1:
        return columns[0]
    rows = np.concatenate([column.rows for column in columns])
    order = np.argsort(rows, kind="stable")
    return Column(rows=rows[order], values=np.concatenate([column.values for column in columns])[order])


def quantisation_error_m(
    profile: Profile, ranges_m: Sequence[float] = (20.0, 50.0, 80.0, 100.0)
) -> dict[float, float]:
    """Return the worst lateral error that rounding on the bus adds at each range, over all lines.

    Half a step of each coefficient's signal times x^n / n! (or x^n where c2, c3 are sent), added up.
    """
    powers = {
        "offset_m": (0, 1),
        "heading": (1, 1),
        "c2_per_m": (2, 1),
        "curvature_per_m": (2, 2),
        "c3_per_m2": (3, 1),
        "curvature_rate_per_m2": (3, 6),
    }
    worst = dict.fromkeys(ranges_m, 0.0)
    for side in LINES:
        steps = [
            (abs(binding.signal.scale / binding.gain) / 2, *powers[name])
            for plan in profile.messages
            for binding in plan.bindings
            for line, _, name in [binding.quantity.partition(".")]
            if line == side and name in powers and not binding.signal.is_float
        ]
        for x in worst:
            worst[x] = max(worst[x], sum(half * x**power / divisor for half, power, divisor in steps))
    return worst
