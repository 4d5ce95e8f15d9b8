"""Writes columns of numbers as signals of an MDF 4.1 file: one group, the first column is the time.

ID ─ HD ─► DG ─► CG ─► CN (time) ─► CN ─► CN ...      DG ─► DT: rows of float64
"""

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import LogError
from vsensor.logs.mf4_parts import block, channel, file_mark, text_bytes

_FLOAT, _MASTER, _TIME = 4, 2, 1  # data type little-endian IEEE 754; channel type; its synchronisation


def write_signals(path: Path, columns: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Write columns (N,) of one length, the first of them seconds; NaN stays NaN. Raises LogError."""
    table = np.column_stack([np.asarray(column, dtype="<f8") for column in columns.values()])
    beside = path.with_name(f".{path.name}.part")
    try:
        beside.write_bytes(signals_bytes(list(columns), units, table))
        beside.replace(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be written: {error.strerror or error}") from None


def signals_bytes(names: list[str], units: Mapping[str, str], table: Any) -> bytes:
    """Return the file of a table (N, len(names)) of float64; `units` of those names that have one."""
    content = bytearray(file_mark())

    def put(kind: str, links: tuple[int, ...], data: bytes) -> int:
        at = len(content)
        content.extend(block(kind, links, data))
        return at

    header_at = put("HD", (0,) * 6, struct.pack("<QhhBBBxdd", 0, 0, 0, 0, 0, 0, 0.0, 0.0))
    comment = "<FHcomment><TX>signals</TX><tool_id>vsensor</tool_id><tool_vendor>vsensor</tool_vendor>"
    comment_at = put("MD", (), text_bytes(comment + "<tool_version>1</tool_version></FHcomment>"))
    history_at = put("FH", (0, comment_at), struct.pack("<QhhB3x", 0, 0, 0, 0))
    below = 0
    for place in reversed(range(len(names))):
        name_at = put("TX", (), text_bytes(names[place]))
        unit = units.get(names[place])
        unit_at = put("TX", (), text_bytes(unit)) if unit else 0
        kind, sync = (_MASTER, _TIME) if place == 0 else (0, 0)
        links = (below, 0, name_at, 0, 0, 0, unit_at)
        below = len(content)
        content += channel(links, kind, _FLOAT, 8 * place, 64, 0, sync=sync)
    counts = struct.pack("<QQHH4xLL", 0, len(table), 0, 0, 8 * len(names), 0)
    group_at = put("CG", (0, below, 0, 0, 0, 0), counts)
    data_at = put("DT", (), np.ascontiguousarray(table, dtype="<f8").tobytes())
    list_at = put("DG", (0, group_at, data_at, 0), bytes(8))
    struct.pack_into("<QQ", content, header_at + 24, list_at, history_at)
    return bytes(content)
