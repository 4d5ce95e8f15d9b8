"""What a signal carries, by the words of its name and comment, its unit and its bits: guesses."""

from dataclasses import dataclass

from vsensor.codec import Layout, SignalLayout
from vsensor.profile import QUANTITIES
from vsensor.profile_new import vocabulary as known
from vsensor.profile_new.units import is_of
from vsensor.profile_new.words import LANE, has, side_of, words_of

_MOST_COUNTER_BITS = 16
_LONG_COMMENT = 30  # words; a comment that tells more names too many things
_LEAST_OFFSET_BITS = 5
_LEAST_NUMBER_BITS = 6
_ONE_BIT = ("available", "measured", "solid", "dashed")
_NOT_OF_CENTRE = ("kind", "colour", "width_m", "lane_offset_m", "solid", "dashed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """What a signal seems to carry.

    `role`: "quantity", "valid", "crc", "counter"; `what` the quantity, of a line without its side, or with
    `line`, "" where nothing says which. `doubt`: why it is uncertain, "" if name and unit agree.
    """

    role: str
    what: str = ""
    line: str = ""
    doubt: str = ""

    @property
    def quantity(self) -> str:
        """The whole name of the quantity; "" while the line is not known."""
        if not self.of_line:
            return self.what
        return f"{self.line}.{self.what}" if self.line else ""

    @property
    def of_line(self) -> bool:
        """Whether it belongs to one of the lines."""
        return self.role == "quantity" and "." not in self.what


def guess_of(layout: Layout, signal: SignalLayout) -> Guess | None:
    """Return what a signal seems to carry; None if nothing is known of it."""
    name, comment = words_of(signal.name), words_of(signal.comment)
    if has(name, *known.CRC):
        return Guess(role="crc")
    if _is_counter(name, signal) and not _counts_images(layout, name, comment):
        return Guess(role="counter")
    shaped = bool(side_of(signal.name, frozenset())) and has(name, *known.SHAPE)
    in_lane = shaped or bool(LANE & {*name, *words_of(layout.name)})
    if signal.length <= 2 and (has(name, *known.VALID) or _tells_valid(name, signal, in_lane)):
        return _validity(layout, signal, in_lane)
    if what := _what(name, signal, in_lane):
        return _placed(what, layout, signal, "")
    if in_lane and signal.length > 1 and known.names_kinds(signal.choices.values()):
        return _placed("kind", layout, signal, "by its values")
    if len(comment) >= _LONG_COMMENT or has(name, *known.FOREIGN, *known.FOREIGN_TO_LINES):
        return None
    plain = tuple(w for w in comment if w not in ("c0", "c1", "c2", "c3"))  # formulas name them all
    what = _what(plain, signal, bool(LANE & set(comment)))
    return _placed(what, layout, signal, "by its comment alone") if what else None


def _tells_valid(words: tuple[str, ...], signal: SignalLayout, in_lane: bool) -> bool:
    """Return whether a bit's values are called valid and not, and it is named after that or a number."""
    said = [words_of(name) for name in signal.choices.values()]
    named = {word for name in said for word in name}
    if has(named, *known.SAYS_VALID) and has(named, *known.SAYS_INVALID):
        rest = tuple(w for w in words if w not in (*known.SAYS_VALID, *known.SAYS_INVALID))
        return has(named, "valid", "ok", "good") or (in_lane and known.first_of(known.LANE, rest) != "")
    return False


def _is_counter(words: tuple[str, ...], signal: SignalLayout) -> bool:
    return has(words, *known.COUNTER) and signal.length <= _MOST_COUNTER_BITS


def _counts_images(layout: Layout, words: tuple[str, ...], comment: tuple[str, ...]) -> bool:
    """Return whether a counter is that of images, not of frames: the message has another that is alive."""
    if not known.first_of(known.IMAGE, words) or has(comment, "alive"):
        return False
    others = [words_of(other) for other in layout.signals]
    return any(o != words and has(o, *known.COUNTER) for o in others) or not any(
        has(o, *known.CRC) for o in others
    )


def _what(words: tuple[str, ...], signal: SignalLayout, in_lane: bool) -> str:
    """Return a quantity, of a line without its side; "" if the words say none."""
    if what := known.first_of(known.IMAGE, words) or known.first_of(known.SENSOR, words):
        return what
    if has(words, *known.FOREIGN):
        return ""
    what = known.first_of(known.LANE, words) if in_lane and not has(words, *known.FOREIGN_TO_LINES) else ""
    if what:
        return _sharpened(what, words, signal)
    return "" if has(words, "wheel", "whl") and has(words, "speed*") else _of_vehicle(words, signal)


def _of_vehicle(words: tuple[str, ...], signal: SignalLayout) -> str:
    """Return a quantity of the vehicle; "" for bits or a value table that cannot carry it."""
    what = _by_unit(words, signal) or known.first_of(known.EGO, words)
    if what == "ego.indicator" and signal.choices:
        return what if any(has(words_of(name), "left", "right") for name in signal.choices.values()) else ""
    is_number = bool(what) and bool(QUANTITIES[what].unit)
    return "" if is_number and signal.length < _LEAST_NUMBER_BITS else what


def _by_unit(words: tuple[str, ...], signal: SignalLayout) -> str:
    """Return the motion that unit and words name together; "" if they name none."""
    for what, si, wanted in known.MOTION:
        if is_of(signal, si) and has(words, *wanted):
            return what
    return ""


def _sharpened(what: str, words: tuple[str, ...], signal: SignalLayout) -> str:
    """Return what the words leave open: whose width, which offset; "" for bits that cannot carry it."""
    if what in _ONE_BIT and signal.length > 2:
        return ""
    if what == "width":
        of_lane = has(words, "lane", "ln") and not has(words, "line", "mark*", "mrk", "stripe")
        return "lane.width_m" if of_lane else "width_m"
    if what == "offset_m" and (signal.length < _LEAST_OFFSET_BITS or has(words, "time")):
        return ""
    if what == "offset_m" and has(words_of(signal.comment), "inner", "inside"):
        return "lane_offset_m"
    return what


_UNIT_OF = {
    **dict.fromkeys(("offset_m", "lane_offset_m", "x_min_m", "x_max_m", "width_m"), "m"),
    **dict.fromkeys(("curvature_per_m", "c2_per_m"), "1/m"),
    **dict.fromkeys(("curvature_rate_per_m2", "c3_per_m2"), "1/m^2"),
}


def _placed(what: str, layout: Layout, signal: SignalLayout, doubt: str) -> Guess:
    """Return the guess with the line that names or comment tell."""
    if "." in what:
        by_name = "by its name" if what.startswith("ego.") else ""
        return Guess(role="quantity", what=what, doubt=doubt or by_name)
    line, unsure = _line(layout, signal)
    if line == "centre" and what in _NOT_OF_CENTRE:
        line, unsure = "", "which line?"
    unsure = doubt or unsure
    if not unsure and _UNIT_OF.get(what) and not signal.unit:
        unsure = f"no unit in the database, taken as {_UNIT_OF[what]}"
    return Guess(role="quantity", what=what, line=line, doubt=unsure)


def _validity(layout: Layout, signal: SignalLayout, in_lane: bool) -> Guess:
    """Return what a validity bit is of: a quantity that its other words name, else a whole line, else ""."""
    told = (*known.VALID, *known.SAYS_VALID, *known.SAYS_INVALID)
    words = tuple(w for w in words_of(signal.name) if w not in told)
    what = first if (first := known.first_of(known.SENSOR, words)) else ""
    what = what or (known.first_of(known.LANE, words) if in_lane else known.first_of(known.EGO, words))
    if what in (*_ONE_BIT, "quality", "kind") or (not what and not in_lane):
        what = ""
    if what == "width":
        what = _sharpened(what, words, signal)
    if "." in what:
        return Guess(role="valid", what=what)
    line, doubt = _line(layout, signal)
    if not in_lane and not line:
        return Guess(role="valid")
    return Guess(role="valid", what=f"{line}.{what}" if line and what else line, doubt=doubt)


def _line(layout: Layout, signal: SignalLayout) -> tuple[str, str]:
    """Return which line a signal belongs to, and why that is uncertain."""
    side, inherited = side_of(signal.name, frozenset(layout.signals)), side_of(layout.name, frozenset())
    if side and side != "centre":
        return (f"next_{side}", "") if inherited == f"next_{side}" else (side, "")
    if own := side or inherited:
        return own, ""
    by_comment = side_of(signal.comment, frozenset()) or side_of(layout.comment, frozenset())
    return by_comment, "which line, by a comment" if by_comment else "which line?"
