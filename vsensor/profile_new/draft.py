"""A profile while it is guessed: what stands on each line of the file, and which lines are open."""

import re
from dataclasses import dataclass, field

from vsensor.codec import Layout, SignalLayout
from vsensor.profile import QUANTITIES
from vsensor.profile_new.codes import YES_NO, named_raw, special_raws, table_of
from vsensor.profile_new.protect import protection_of
from vsensor.profile_new.rules import Guess, guess_of
from vsensor.profile_new.units import contradicts, unit_said
from vsensor.profile_new.vocabulary import SAYS_INVALID, SAYS_VALID
from vsensor.profile_new.words import has, words_of


@dataclass
class Entry:
    """One signal: what the profile would say of it, or why it does not; with a `doubt` it is open."""

    signal: SignalLayout
    guess: Guess | None
    said: dict[str, object] | None = None
    doubt: str = ""
    why_not: str = ""


@dataclass
class Draft:
    """One message: protection, and its signals in the database's order; `seal`: a checksum over a burst."""

    layout: Layout
    entries: list[Entry]
    e2e: dict[str, object] = field(default_factory=dict[str, object])
    e2e_doubt: str = ""
    seal: str = ""

    @property
    def guesses(self) -> list[Guess]:
        """The guesses that stand."""
        return [entry.guess for entry in self.entries if entry.guess is not None and entry.said is not None]

    def signals(self, role: str) -> list[SignalLayout]:
        """Return the signals that seem to protect the message."""
        return [e.signal for e in self.entries if e.guess is not None and e.guess.role == role]


def draft_of(layout: Layout) -> Draft:
    """Return what is guessed of a message."""
    draft = Draft(layout=layout, entries=[_entry(layout, signal) for signal in layout.signals.values()])
    for entry in draft.entries:
        if entry.guess is not None and entry.guess.role == "valid":
            entry.said, entry.doubt = _validity(entry.signal, entry.guess, _told_of(draft))
    _protect(draft)
    return draft


def _entry(layout: Layout, signal: SignalLayout) -> Entry:
    if signal.name in layout.muxers:
        return Entry(signal=signal, guess=None, why_not="multiplexer: chooses the signals of the frame")
    guess = guess_of(layout, signal)
    entry = Entry(signal=signal, guess=guess)
    if guess is None or guess.role != "quantity":
        return entry
    if not guess.quantity and not guess.line:
        entry.doubt = f"which line? LINE.{guess.what}"
    elif guess.quantity in QUANTITIES and contradicts(signal, QUANTITIES[guess.quantity].unit):
        entry.doubt = f"{guess.quantity}? of that unit it is not"
    else:
        entry.said, entry.doubt = _carried(signal, guess)
    return entry


def _carried(signal: SignalLayout, guess: Guess) -> tuple[dict[str, object], str]:
    what, line = guess.what, guess.line
    doubts = [guess.doubt] * bool(guess.doubt)
    if what in ("solid", "dashed"):
        return _kind_bit(what, line), guess.doubt
    said: dict[str, object] = {"quantity": guess.quantity}
    quantity = QUANTITIES[guess.quantity]
    if what.startswith("image."):
        said["wrap"] = True
    elif quantity.codes is not None or (what in ("quality", *YES_NO) and not _is_share(signal)):
        table, doubt = table_of(what, guess.quantity, signal)
        said |= {"table": table} if table else {}
        said |= {"error": raw} if table and (raw := named_raw(signal, "error", "fault")) is not None else {}
        doubts += [doubt] * bool(doubt)
    elif what == "quality":
        said["factor"] = 0.25 if signal.unit == "%" else (signal.raw_max // 4) * signal.scale
        doubts.append("a share, taken as 0 to 4 in even steps")
    else:
        said |= special_raws(signal)
    if what in ("offset_m", "lane_offset_m") and signal.physical(signal.raw_min) >= 0 and not signal.signed:
        said["magnitude"] = True
        doubts.append("never negative, so taken as a distance without sign")
    unit, doubt = unit_said(signal, quantity.unit)
    said |= {"unit": unit} if unit else {}
    return said, "; ".join([*doubts, *([doubt] if doubt else [])])


def _is_share(signal: SignalLayout) -> bool:
    return not signal.choices and (
        signal.unit == "%" or abs(signal.physical(signal.raw_max)) <= 1.001 < signal.raw_max
    )


def _kind_bit(what: str, line: str) -> dict[str, object]:
    kinds = (what, f"double_{what}", "solid_dashed", "dashed_solid")
    return {"quantity": f"{line}.kind", "table": {**dict.fromkeys(kinds, 1), "other": 0}}


_POLARITY = re.compile(r"\b([01])\s*(?:=|:|->|is|means)\s*(not valid|invalid|valid|not ok|ok)", re.IGNORECASE)


def _told_of(draft: Draft) -> list[str]:
    """Return the lines and other quantities that a message tells of."""
    guesses = [guess for guess in draft.guesses if guess.role == "quantity"]
    names = [guess.line or guess.what for guess in guesses if not guess.what.startswith("image.")]
    return list(dict.fromkeys(names))


def _validity(signal: SignalLayout, guess: Guess, others: list[str]) -> tuple[dict[str, object] | None, str]:
    """Return what a validity bit says: of what (else all that is beside it), and which value means valid."""
    if not guess.what and not others:
        return None, guess.doubt and "valid_of which line or quantity?"
    good, sure = _good_raw(signal)
    said: dict[str, object] = {"valid_of": guess.what or (others if len(others) > 1 else others[0])}
    said |= {"valid_raw": 0, "invalid_raw": 1} if good == 0 else {}
    doubts = ["" if guess.what else "of all in this message", guess.doubt if guess.what else ""]
    doubts.append("" if sure else f"{good} taken as valid")
    return said, "; ".join(filter(None, doubts))


def _good_raw(signal: SignalLayout) -> tuple[int, bool]:
    """Return the raw value that says valid, and whether the database says so."""
    for raw, name in signal.choices.items():
        if has(words_of(name), *SAYS_VALID) and not has(words_of(name), *SAYS_INVALID, "no"):
            return int(raw), True
    if told := _POLARITY.search(signal.comment):
        says_good = told[2].lower() in ("valid", "ok")
        return int(told[1]) if says_good else 1 - int(told[1]), True
    own = words_of(signal.name)
    return (0 if has(own, *SAYS_INVALID) else 1), False


def _protect(draft: Draft) -> None:
    """Guess the protection; a checksum over a whole burst is none of the message."""
    checksums = draft.signals("crc")
    draft.seal = next((s.name for s in checksums if has(words_of(f"{s.name} {s.comment}"), "burst")), "")
    alone = [signal for signal in checksums if signal.name != draft.seal]
    draft.e2e, draft.e2e_doubt = protection_of(draft.layout, alone, draft.signals("counter"))
