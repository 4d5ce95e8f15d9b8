"""A profile at work: frames decoded into quantities, one by one and in bulk, and put together to images."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vsensor.codec import BulkReader, unpack
from vsensor.profile.bursts import NOTHING_OPEN, Assembly, Burst, Image, assemble, left_over
from vsensor.profile.columns import Column, columns_of, merged, rows_of
from vsensor.profile.config import GeometryConfig
from vsensor.profile.plan import MessagePlan
from vsensor.types import BoolArray, CodeArray, Frame, IntArray


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
            rows = rows_of(plan, ids, data, lengths, extended)
            if check and plan.guard is not None and len(rows):
                rows = rows[plan.guard.check_bulk(data[rows, : plan.layout.length])]
            if broken is not None:
                rows = rows[~broken[rows]]
            if len(rows):
                for quantity, column in columns_of(plan, rows, data[rows, : plan.layout.length]).items():
                    parts.setdefault(quantity, []).append(column)
        return {quantity: merged(columns) for quantity, columns in parts.items()}

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
        places = [rows_of(plan, ids, data, lengths, extended) for plan in plans]
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
            rows = (
                rows_of(plan, ids, data, lengths, extended) if len(plan.pages) > 1 else np.empty(0, np.int64)
            )
            if len(rows):
                reader = BulkReader(plan.layout, data[rows, : plan.layout.length])
                for number, page in enumerate(plan.pages):
                    mine = np.all([reader.raw(name) == raw for name, raw in page.items()], axis=0)
                    kinds[rows[mine]] += (number + 1) << 32
        return kinds

    def quantities(self) -> set[str]:
        """Return the quantities that the profile carries."""
        return {binding.quantity for plan in self.messages for binding in plan.bindings}
