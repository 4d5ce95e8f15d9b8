"""How a bus describes a line, as far as its comments and units tell."""

import re
from collections.abc import Iterable, Sequence

from vsensor.profile_new.draft import Draft, Entry

_POLYNOMIAL = {"offset_m", "heading", "curvature_per_m", "c2_per_m"}

Answer = tuple[str, str, str]
"""Key, value, and the question that stays open ("" = the database answers it)."""


def geometry_of(drafts: Sequence[Draft]) -> list[Answer]:
    """Return the keys of [geometry] for what is mapped."""
    entries = [e for d in drafts for e in d.entries if e.said is not None and e.guess is not None]
    lateral = [
        e for e in entries if e.guess is not None and (e.guess.of_line or e.guess.what.startswith("lane."))
    ]
    if not lateral:
        return []
    text = " ".join([*(e.signal.comment for e in lateral), *(d.layout.comment for d in drafts)]).lower()
    answers = [_positive(text)]
    whats = {e.guess.what for e in entries if e.guess is not None}
    if whats & _POLYNOMIAL:
        answers.append(_origin(text))
    if "offset_m" in whats:
        offsets = " ".join(
            e.signal.comment for e in entries if e.guess and e.guess.what == "offset_m"
        ).lower()
        answers.append(_edge(offsets))
    if "heading" in whats:
        answers.append(_heading([e for e in entries if e.guess and e.guess.what == "heading"]))
    if whats & {"curvature_per_m"}:
        answers.append(_curvature(text))
    return answers


def _positive(text: str) -> Answer:
    for side in ("left", "right"):
        other = "right" if side == "left" else "left"
        says = re.search(
            rf"positive (?:to|towards?) (?:the )?{side}|{side}(?: is)? positive|y {side}\b", text
        )
        denies = re.search(rf"positive (?:to|towards?) (?:the )?{other}", text)
        if says and not denies:
            return "positive", side, ""
    return "positive", "left", 'which side counts up? or "right"'


def _origin(text: str) -> Answer:
    for word, pattern in (
        ("rear_axle", r"rear axle"),
        ("front_axle", r"front axle"),
        ("bumper", r"bumper"),
        ("camera", r"from (?:the )?camera|camera cent(?:er|re)"),
    ):
        if re.search(pattern, text):
            return "origin", word, ""
    return (
        "origin",
        "camera",
        'where is x = 0? or "rear_axle", "front_axle", "bumper", or origin_x_m = metres before the rear axle',
    )


def _edge(text: str) -> Answer:
    if re.search(r"inner edge|inside|inner side", text):
        return "edge", "inner", ""
    if re.search(r"cent(?:re|er) of the (?:marking|line)|middle of the (?:marking|line)", text):
        return "edge", "centre", ""
    return "edge", "centre", 'of the marking; or "inner", its edge towards the vehicle'


def _heading(entries: Iterable[Entry]) -> Answer:
    entries = list(entries)
    if any("slope" in e.signal.comment.lower() for e in entries):
        return "heading", "slope", ""
    units = {e.signal.unit.lower() for e in entries}
    if units & {"deg", "degree", "degrees", "mrad", "°"}:
        return "heading", "angle", ""
    if units & {"rad", "radian", "radians"} or any("angle" in e.signal.comment.lower() for e in entries):
        return "heading", "angle", 'or "slope"'
    return "heading", "slope", 'or "angle"'


def _curvature(text: str) -> Answer:
    known = re.search(r"second derivative|2 c2|x\^2 / 2", text)
    return "curvature", "2c2", "" if known else 'or "true", of the curve: they differ with the heading'
