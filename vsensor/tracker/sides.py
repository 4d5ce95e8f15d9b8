"""Which of the known lines is on which side, and when the vehicle crosses one.

next left   left      right   next right        position = y of the line at the rear axle, left +
    |         |    ^    |         |
    |         |   [ ]   |         |             a line keeps its side until it is `hysteresis_m`
   5.2       1.7   0  -1.8      -5.3  m         past the vehicle's centre on the other one
"""

from collections.abc import Iterable

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.state import Track
from vsensor.types import Side


def is_left(config: TrackerConfig, position_m: float, was_left: bool | None) -> bool:
    """Whether a line is on the left; a known one changes only past the hysteresis."""
    limit_m = 0.0 if was_left is None else -config.hysteresis_m if was_left else config.hysteresis_m
    return position_m >= limit_m


def lefts(tracks: list[Track]) -> list[bool]:
    """Return for each track, they stand from left to right, whether it is on the left of the vehicle.

    What lies left of a left line is left. A line that is not confirmed moves no other, but is moved.
    """
    confirmed = max((n for n, track in enumerate(tracks) if track.is_confirmed and track.is_left), default=-1)
    first_right = next((n for n, track in enumerate(tracks) if n > confirmed and track.is_confirmed), None)
    new = (
        n
        for n, track in enumerate(tracks)
        if track.is_left and not track.is_confirmed and (first_right is None or n < first_right)
    )
    last_left = max(confirmed, max(new, default=-1))
    return [n <= last_left for n in range(len(tracks))]


def sides(config: TrackerConfig, tracks: Iterable[Track]) -> dict[int, Side]:
    """Return number -> side of confirmed lines, outwards from the vehicle."""
    found: dict[int, Side] = {}
    lines = [track for track in tracks if track.is_confirmed]
    for on_left, own, beyond in ((True, Side.LEFT, Side.NEXT_LEFT), (False, Side.RIGHT, Side.NEXT_RIGHT)):
        sign = 1.0 if on_left else -1.0
        outwards = sorted((sign * line.position_m, line.number) for line in lines if line.is_left is on_left)
        is_bounded = bool(outwards) and abs(outwards[0][0]) <= config.max_own_m
        for side, (_, number) in zip((own, beyond)[not is_bounded :], outwards, strict=False):
            found[number] = side
    return found


def lane_change(before: Iterable[Track], now: dict[int, Track]) -> int:
    """Return 1 if the left line now is right of the vehicle, -1 if the right one now is left."""
    for track in before:
        line = now.get(track.number)
        if line is None:
            continue
        if track.side is Side.LEFT and not line.is_left:
            return 1
        if track.side is Side.RIGHT and line.is_left:
            return -1
    return 0
