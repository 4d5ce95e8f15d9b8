"""The draft as a TOML file with its open places marked."""

import re
from collections.abc import Mapping, Sequence

from vsensor.profile_new.draft import Draft, Entry
from vsensor.profile_new.geometry import Answer
from vsensor.profile_new.marks import MARK, unmarked
from vsensor.profile_new.toml import about, short, toml_key, toml_value

_FIELDS = ("crc", "counter")


def profile_text(
    drafts: Sequence[Draft],
    geometry: Sequence[Answer],
    *,
    title: str,
    database: str,
    role: str,
    node: str | None,
    saturate: bool,
    cycle_ms: float,
) -> str:
    """Return the whole file."""
    lines = [
        f"# {unmarked(title)}",
        f"# A skeleton, guessed from names, units and comments. `{MARK}` marks what is uncertain or open:",
        "# answer it, then delete the mark. `vsensor check` lists what is left.",
        "# All keys: dbc/README.md, Writing a profile.",
        'schema = "vsensor.profile/1"',
        f"description = {toml_value(title)}",
        f'role = "{role}"',
        f"database = {toml_value(database)}",
    ]
    if node is not None:
        lines.append(
            f"node = {toml_value(node)}    # its other messages with a cycle time: sent with start values"
        )
    if saturate:
        lines.append(f'wide_ranges = "saturate"    {MARK} some declared ranges are wider than the bits')
    if geometry:
        lines += ["", "[geometry]", *(_answer(*answer) for answer in geometry)]
    for draft in drafts:
        lines += ["", *_message(draft, role, cycle_ms)]
    if role == "sensor":
        lines += _burst_hint(drafts)
    return "\n".join(lines) + "\n"


def _answer(key: str, value: str, question: str) -> str:
    return f'{key} = "{value}"' + (f"    {MARK} {question}" if question else "")


def _message(draft: Draft, role: str, cycle_ms: float) -> list[str]:
    layout = draft.layout
    sender = f", from {unmarked(', '.join(layout.senders))}" if layout.senders else ""
    fd = " CAN FD" if layout.is_fd else ""
    head = f"[messages.{toml_key(layout.name)}]"
    lines = [
        f"# 0x{layout.arbitration_id:X}, {layout.length} bytes{fd}{sender}{_quoted(layout.comment)}",
        head,
    ]
    if role == "sensor" and not layout.cycle_ms and not layout.sending.cycle_ms:
        by_name = re.search(r"(\d+) ?ms", layout.name, re.IGNORECASE)
        guessed_ms, why = (int(by_name[1]), "by its name") if by_name else (cycle_ms, "not in the database")
        lines.append(f"cycle_ms = {guessed_ms:g}    {MARK} {why}")
    if len({entry.signal.mux_ids for entry in draft.entries if entry.said and entry.signal.mux_signal}) > 1:
        lines.append(f'mux = "together"    {MARK} all its frames at once; or "rotate", one after another')
    if draft.e2e or draft.e2e_doubt:
        said = f"e2e = {toml_value(draft.e2e)}" if draft.e2e else "# e2e ="
        lines.append(said + (f"    {MARK} {unmarked(draft.e2e_doubt)}" if draft.e2e_doubt else ""))
    lines += ["", f"[messages.{toml_key(layout.name)}.signals]"]
    protecting = {draft.e2e.get(key) for key in _FIELDS} | {draft.seal}
    return [*lines, *(_signal(e) for e in draft.entries if e.signal.name not in protecting)]


def _quoted(comment: str) -> str:
    return f": {said}" if (said := short(comment, 140)) else ""


def _signal(entry: Entry) -> str:
    key, told, doubt = toml_key(entry.signal.name), about(entry.signal), unmarked(entry.doubt)
    if entry.said is None:
        said = f"{key} =" if entry.doubt or entry.why_not else key
        if entry.doubt:
            return f"# {said}    {MARK} {doubt}; {told}"
        return f"# {key}    {entry.why_not + '; ' if entry.why_not else ''}{told}"
    value: object = entry.said
    if set(entry.said) == {"quantity"}:
        value = entry.said["quantity"]
    mark = f"    {MARK} {doubt}; {told}" if doubt else f"    # {told}"
    return f"{key} = {toml_value(value)}{mark}"


def _burst_hint(drafts: Sequence[Draft]) -> list[str]:
    """Say how the frames of an image could be declared to belong together, where each of several names it."""
    ids = {d.layout.name: _image_signal(d) for d in drafts}
    members = {name: signal for name, signal in ids.items() if signal}
    if len(members) < 2:
        return []
    lines = [
        "",
        f"{MARK} These frames carry the number of their image. If the receiver uses an image only as a",
        "# whole, or one of them has a checksum over all, say so (README, Bursts); else delete this.",
        "# [bursts.image]",
        f"# messages = {toml_value(list(members))}",
        f"# id = {_one_or_each(members)}",
    ]
    counters = {d.layout.name: str(d.e2e.get("counter", "")) for d in drafts if d.layout.name in members}
    if all(counters.values()):
        lines.append(f"# count = {_one_or_each(counters)}    # if all frames of an image have the same")
    for draft in drafts:
        if draft.seal:
            lines += [
                "# [bursts.image.checksum]",
                f"# message = {toml_value(draft.layout.name)}",
                f"# signal = {toml_value(draft.seal)}",
                '# algorithm = "crc16_ccitt"    # which? and its data_id, or before and after',
            ]
    return lines


def _one_or_each(names: Mapping[str, str]) -> str:
    """Return a signal's name that all messages have, or that of each."""
    one = len(set(names.values())) == 1
    return toml_value(next(iter(names.values())) if one else dict(names))


def _image_signal(draft: Draft) -> str:
    found = [e for e in draft.entries if e.said is not None and e.said.get("quantity") == "image.index"]
    return min(found, key=lambda e: e.signal.length).signal.name if found else ""
