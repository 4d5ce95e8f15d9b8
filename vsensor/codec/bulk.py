"""Many frames of one message at once, in numpy."""

from typing import Any

import numpy as np

from vsensor.codec.layout import Layout, SignalLayout
from vsensor.types import Array, CodeArray


def decode_bulk(layout: Layout, data: CodeArray, names: tuple[str, ...] | None = None) -> dict[str, Array]:
    """Return the physical values (N,) of the named (default: all) signals of frames `data` (N, >= length).

    NaN where a multiplexed signal is not in the frame.
    """
    reader = BulkReader(layout, data)
    return {name: reader.physical(name) for name in (names if names is not None else layout.signals)}


class BulkReader:
    """Reads columns of one message; 8-byte windows are read once per place and byte order."""

    def __init__(self, layout: Layout, data: CodeArray) -> None:
        if data.ndim != 2 or data.shape[1] < layout.length:
            raise ValueError(f"{layout.name}: data of shape {data.shape}, (N, {layout.length}) expected")
        self.layout = layout
        width = max(layout.length, 8)
        self.data = np.zeros((len(data), width), dtype=np.uint8)
        self.data[:, : layout.length] = data[:, : layout.length]
        self.words: dict[tuple[int, bool], Any] = {}

    def raw(self, name: str) -> Any:
        """Return the raw values (N,), int64 if signed, uint64 otherwise."""
        signal = self.layout.signals[name]
        end = 8 * self.layout.length - signal.shift if signal.big_endian else signal.shift + signal.length
        first, last = (end - signal.length) // 8, (end - 1) // 8
        at = min(first, self.data.shape[1] - 8)
        word = self._word(at, signal.big_endian)
        low = 8 * (at + 8) - end if signal.big_endian else end - signal.length - 8 * at
        if low >= 0 and last < at + 8:
            bits = word >> np.uint64(low) if low else word
        elif signal.big_endian:  # nine bytes: the last one holds the lowest bits
            bits = (word << np.uint64(-low)) | (self.data[:, last].astype(np.uint64) >> np.uint64(8 + low))
        else:
            bits = (word >> np.uint64(low)) | (self.data[:, last].astype(np.uint64) << np.uint64(64 - low))
        if signal.length == 64:
            return bits.view(np.int64) if signal.signed else bits
        spare = np.uint64(64 - signal.length)
        if signal.signed:
            return (bits << spare).view(np.int64) >> np.int64(spare)
        return bits & np.uint64((1 << signal.length) - 1)

    def _word(self, at: int, big: bool) -> Any:
        if (at, big) not in self.words:
            window = np.ascontiguousarray(self.data[:, at : at + 8])
            self.words[at, big] = window.view(">u8" if big else "<u8")[:, 0].astype(np.uint64)
        return self.words[at, big]

    def physical(self, name: str) -> Array:
        """Return the physical values (N,), NaN where the signal is not in the frame."""
        signal = self.layout.signals[name]
        raw = self.raw(name)
        if signal.is_float:
            raw = raw.astype(f"u{signal.length // 8}").view(f"f{signal.length // 8}")
        values: Array = raw.astype(np.float64) * signal.scale + signal.offset
        if signal.mux_signal is not None:
            values[~self.selected(signal)] = np.nan
        return values

    def selected(self, signal: SignalLayout) -> Any:
        """Return where (N,) a multiplexed signal is in the frame."""
        if signal.mux_signal is None:
            return np.ones(len(self.data), dtype=bool)
        parent = self.layout.signals[signal.mux_signal]
        return np.isin(self.raw(parent.name), list(signal.mux_ids)) & self.selected(parent)
