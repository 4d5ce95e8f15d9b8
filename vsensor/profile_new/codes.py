"""Value tables of a database against the codes of the model."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

from vsensor.codec import SignalLayout
from vsensor.profile import QUANTITIES
from vsensor.profile_new.vocabulary import DASHED, SOLID
from vsensor.profile_new.words import has, words_of

Table = dict[str, int | str]

YES_NO = ("available", "measured", "ego.low_beam", "ego.high_beam")

_NOT_AVAILABLE = ("sna", "na", "unavailable", "invalid", "nodata", "notavailable", "notvalid")
_FAULT = ("error", "err", "fault", "failure", "malfunction")
_STARTING = ("init*",)
_NEGATIVE = ("no", "not", "none", "false", "off", "un*", "in*", "rejected*", "lost", "without", "inactive")
_CODE_WORDS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "kind": {
        "double_solid": SOLID,
        "double_dashed": DASHED,
        "solid": SOLID,
        "dashed": DASHED,
        "botts_dots": ("bott*",),
        "curb": ("curb", "kerb"),
        "road_edge": ("edge", "barrier", "roadedge"),
        "unknown": ("unknown", "undefined", "undecided", "other"),
        "none": ("none", "no", "nolane", "noline"),
    },
    "colour": {
        name: (name, *also)
        for name, also in {
            "white": (), "yellow": (), "blue": (), "red": (), "green": (), "orange": (),
            "unknown": ("undefined", "undecided", "other", "none"),
        }.items()
    },
    "state": {
        "init": ("init*", "start*", "boot*"),
        "calibrating": ("calib*",),
        "degraded": ("degrad*", "limit*", "reduced"),
        "blocked": ("block*", "blind*", "dirty"),
        "failed": ("fail*", "error", "fault", "defect*"),
        "available": ("available", "ok", "normal", "active", "on", "operational", "ready"),
    },
    "light": {"day": ("day", "bright"), "dusk": ("dusk", "dawn", "twilight"), "night": ("night", "dark")},
    "change": {"left": ("left",), "right": ("right",), "none": ("none", "no")},
    "indicator": {
        "both": ("both", "hazard"),
        "left": ("left",),
        "right": ("right",),
        "off": ("off", "none", "no", "inactive", "idle"),
    },
    "wiper": {
        "interval": ("int", "intermittent", "interval", "auto"),
        "slow": ("slow", "low", "normal", "lo"),
        "fast": ("fast", "high", "hi"),
        "off": ("off", "none", "no", "inactive", "stopped"),
    },
}  # fmt: skip
_SHADES = (
    (0, ("none", "no", "invalid", "bad")),
    (3, ("mediumhigh",)),
    (2, ("medium", "mid", "middle", "moderate", "fair")),
    (1, ("low", "poor", "weak")),
    (4, ("high", "good", "strong", "full")),
)


def named_raw(signal: SignalLayout, *words: str) -> int | None:
    """Return the raw value whose name has one of the words, as the signal's bits are read."""
    for raw, name in signal.choices.items():
        told = words_of(name)
        if has([*told, *map("".join, pairwise(told))], *words):
            return raw - (1 << signal.length) if raw > signal.raw_max else raw
    return None


def special_raws(signal: SignalLayout) -> dict[str, int]:
    """Return the raw values of a number that are no numbers: error, init, sna unless an attribute says it."""
    found = {
        "sna": named_raw(signal, *_NOT_AVAILABLE) if signal.sna_raw is None else None,
        "error": named_raw(signal, *_FAULT),
        "init": named_raw(signal, *_STARTING),
    }
    return {key: raw for key, raw in found.items() if raw is not None}


def table_of(what: str, quantity: str, signal: SignalLayout) -> tuple[Table | None, str]:
    """Return the table of an enumeration and why it is uncertain; None where raw values are the codes."""
    if what in YES_NO:
        return _yes_no(signal)
    if what == "quality":
        return _levels(signal)
    codes = QUANTITIES[quantity].codes
    assert codes is not None
    found = _matched(_CODE_WORDS[what.rpartition(".")[2]], signal)
    names = {code.name.lower(): int(code) for code in codes}
    if not found:
        table: Table = {name: raw for name, raw in names.items() if raw <= signal.raw_max}
        return (
            ({**table, "other": 0}, "no value table in the database")
            if what != "change"
            else (table, "no value table")
        )
    if all(
        signal.choices.get(code, "").lower().replace("_", "").replace(" ", "") == name.replace("_", "")
        for name, code in names.items()
    ):
        return None, ""
    rest = next((found[name] for name in ("unknown", "none") if name in found), next(iter(found.values())))
    missing = [name for name in names if name not in found]
    return ({**found, "other": rest}, "what has no value of its own") if missing else (found, "")


def _matched(words: Mapping[str, tuple[str, ...]], signal: SignalLayout) -> Table:
    """Return code name -> value name, each once."""
    found: Table = {}
    for raw, name in signal.choices.items():
        if raw > signal.raw_max:
            continue
        told = words_of(name)
        double = has(told, "double", "dbl", "twin")
        for code, wanted in words.items():
            if code in found or not has(told, *wanted) or double != code.startswith("double"):
                continue
            found[code] = name
            break
    return found


def _yes_no(signal: SignalLayout) -> tuple[Table | None, str]:
    if not signal.choices:
        return None, ""
    no = [raw for raw, name in signal.choices.items() if has(words_of(name), *_NEGATIVE)]
    yes = [raw for raw in signal.choices if raw not in no and raw != signal.sna_raw]
    if not no or not yes or (no[0], yes[0]) == (0, 1):
        return None, ""
    return {"no": signal.choices[no[0]], "yes": signal.choices[yes[0]]}, "which value says yes"


def _levels(signal: SignalLayout) -> tuple[Table | None, str]:
    """Return confidence 0 to 4 as the database's steps."""
    steps = sorted((_shade(name), raw) for raw, name in signal.choices.items() if _shade(name) is not None)
    raws = [raw for _, raw in steps]
    if raws == [0, 1, 2, 3, 4]:
        return None, ""
    if not raws and signal.length > 2:
        return None, f"a number of {signal.length} bits, taken as 0 to 4" if signal.length > 3 else ""
    raws = raws or list(range(1 << signal.length))
    names = [signal.choices.get(raw, raw) for raw in raws]
    last = len(names) - 1
    return {str(level): names[(level * last + 2) // 4] for level in range(5)}, "which confidence is which"


def _shade(name: str) -> float | None:
    told = words_of(name)
    if has(told, "reserved", "sna", *_FAULT):
        return None
    base: float | None = next((float(shade) for shade, words in _SHADES if has(told, *words)), None)
    if base is None:
        return None
    if has(told, "medium") and has(told, "high"):
        return 3.0
    return base + (0.5 if base > 2 else -0.5) * has(told, "very")


def shown_choices(signal: SignalLayout, most: int = 8) -> str:
    """Return the value table as a comment."""
    items: Sequence[tuple[int, str]] = list(signal.choices.items())
    return ", ".join(f"{raw} {name}" for raw, name in items[:most]) + (" ..." if len(items) > most else "")
