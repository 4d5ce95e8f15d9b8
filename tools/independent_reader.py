"""Judge a candump log of lane frames without any of vsensor's code: python3 independent_reader.py LOG DBC.

Checks that every message of the DBC's lane sensor is there on its cycle, that no alive counter skips,
and that every CRC is the one of AUTOSAR E2E Profile 01, computed here bit by bit from the standard's
polynomial. Prints one line per message and a JSON line with the sums; exit 1 if anything is wrong.
"""

import json
import re
import sys
from collections import defaultdict
from pathlib import Path

import cantools

LINE = re.compile(r"\((\d+)\.(\d+)\) \S+ ([0-9A-F]+)#([0-9A-F]*)")


def crc8_j1850(data: bytes, crc: int) -> int:
    """CRC-8 with polynomial 0x1D, most significant bit first, no final XOR."""
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x1D if crc & 0x80 else crc << 1
            crc &= 0xFF
    return crc


def e2e_profile_01(data: bytes, data_id: int, crc_byte: int) -> int:
    """CRC of Profile 01, data id mode BOTH: low and high byte of the id, then the data without the CRC.

    AUTOSAR PRS E2E: Profile 01 starts the CRC routine at 0xFF xor 0xFF = 0 and cancels its final XOR.
    """
    rest = data[:crc_byte] + data[crc_byte + 1 :]
    return crc8_j1850(bytes([data_id & 0xFF, data_id >> 8]) + rest, 0x00)


def read(path: Path) -> dict[int, list[tuple[float, bytes]]]:
    """Return the frames of a candump -L log by identifier."""
    frames = defaultdict(list)
    for text in path.read_text().splitlines():
        match = LINE.match(text)
        if match:
            t_s = int(match[1]) + int(match[2]) / 10 ** len(match[2])
            frames[int(match[3], 16)].append((t_s, bytes.fromhex(match[4])))
    return frames


def judge(path: Path, dbc: Path) -> dict[str, int]:
    """Return the sums over all messages of the DBC's sender; see the module's first lines."""
    database = cantools.database.load_file(dbc)
    frames = read(path)
    sums = {"messages": 0, "frames": 0, "counter_errors": 0, "crc_errors": 0, "absent": 0, "unknown": 0}
    known = {message.frame_id: message for message in database.messages}
    sums["unknown"] = sum(len(rows) for identifier, rows in frames.items() if identifier not in known)
    for identifier, message in known.items():
        rows = frames.get(identifier, [])
        sums["messages"] += 1
        sums["frames"] += len(rows)
        sums["absent"] += not rows
        counter, crc = _protection(message)
        data_id = message.dbc.attributes["E2EDataId"].value
        expected = None
        for _, data in rows:
            alive = message.decode(data, decode_choices=False)[counter.name]
            sums["counter_errors"] += expected is not None and alive != expected
            expected = (alive + 1) % 15
            sums["crc_errors"] += data[crc.start // 8] != e2e_profile_01(data, data_id, crc.start // 8)
        if rows:
            seconds = rows[-1][0] - rows[0][0]
            cycle_ms = 1e3 * seconds / max(len(rows) - 1, 1)
            print(f"{identifier:03X} {message.name:<24} {len(rows):6d} frames, cycle {cycle_ms:.3f} ms")
    return sums


def _protection(message):
    counter = next(s for s in message.signals if re.search("counter|alive|sqc", s.name, re.IGNORECASE))
    crc = next(s for s in message.signals if re.search("crc", s.name, re.IGNORECASE))
    return counter, crc


if __name__ == "__main__":
    result = judge(Path(sys.argv[1]), Path(sys.argv[2]))
    print(json.dumps(result))
    sys.exit(any(result[key] for key in ("counter_errors", "crc_errors", "absent", "unknown")))
