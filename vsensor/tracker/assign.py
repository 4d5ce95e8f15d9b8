"""One image: known lines moved to now, seen ones matched to them, sides given, the unseen predicted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.match import distance_ahead, match, moved_on
from vsensor.tracker.moved import HERE
from vsensor.tracker.place import Path, Seen, distinct, placed
from vsensor.tracker.reports import measured, predicted
from vsensor.tracker.sides import is_left, lane_change, lefts, sides
from vsensor.tracker.state import MOST_TRACKS, Track, TrackerState
from vsensor.types import Boundary, EgoState, Side, Sighting, Tick


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """What one image reports, in the order of Side; `lane_change` is 1 to the left, -1 to the right.

    `predicted` is the marking id of every boundary that is not measured, -1 if it has none.
    """

    boundaries: tuple[Boundary, ...]
    lane_change: int
    predicted: Mapping[Side, int]

    @property
    def sides(self) -> dict[Side, int]:
        """Return side -> number k of the line seen there; a side without one is absent."""
        return {line.side: line.points for line in self.boundaries if line.measured}


def assign(
    config: TrackerConfig,
    state: TrackerState,
    sightings: Sequence[Sighting | None],
    ego: EgoState,
    tick: Tick,
) -> tuple[TrackerState, Assignment]:
    """Give every side its line: a seen one, or one that was seen before and is predicted."""
    before = moved_on(config, state, ego, tick)
    fits = {k: line.fit for k, line in enumerate(sightings) if line is not None}
    lines, path = placed(fits, ego, before.tracks)
    seen = distinct(config, lines, path)
    matched = match(config, seen, before)
    tracks, line_of, next_number = [], {}, before.next_number
    for n, line in enumerate(seen):
        known = before.tracks[matched[n]] if n in matched else None
        track = _seen(config, known, line, sightings, path, tick.t_ns, next_number)
        next_number += known is None
        line_of[track.number] = line.k
        tracks.append(track)
    known_places = set(matched.values())
    missed = [track for place, track in enumerate(before.tracks) if place not in known_places]
    tracks = _with_sides(config, [*tracks, *_missed(config, missed, tracks)])
    after = replace(before, next_number=next_number, tracks=tuple(tracks))
    return after, Assignment(
        boundaries=_reports(config, after, sightings, line_of),
        lane_change=lane_change(before.tracks, {track.number: track for track in tracks}),
        predicted={
            t.side: t.last.marking_id for t in tracks if t.side is not None and t.number not in line_of
        },
    )


def _seen(
    config: TrackerConfig,
    known: Track | None,
    line: Seen,
    sightings: Sequence[Sighting | None],
    path: Path,
    t_ns: int,
    next_number: int,
) -> Track:
    """Return the track of a line of this image: the known one, or a new one."""
    sighting = sightings[line.k]
    assert sighting is not None
    position_m = line.position_m
    near_ns = t_ns if line.is_near else known.near_ns if known else -1
    if known and not line.is_near and near_ns >= 0 and t_ns - near_ns <= config.coast_s * 1e9:
        position_m = known.position_m  # read beside the vehicle and moved: better than from far ahead
    images = min(known.images + 1 if known else 1, config.confirm_images)
    return Track(
        number=known.number if known else next_number,
        last=sighting,
        moved=HERE,
        position_m=position_m,
        slope=path.slope,
        is_near=line.is_near,
        near_ns=near_ns,
        is_left=is_left(config, position_m, known.is_left if known else None),
        side=known.side if known else None,
        seen_ns=t_ns,
        images=images,
        is_confirmed=images >= config.confirm_images or (known is not None and known.is_confirmed),
    )


def _missed(config: TrackerConfig, missed: list[Track], seen: list[Track]) -> list[Track]:
    """Return the known lines that this image does not show, as far as they are still of interest."""
    kept: list[Track] = []
    for track in sorted(missed, key=lambda track: (-track.seen_ns, track.number)):
        others = [*seen, *kept]
        is_known = any(_is_same(config, track, other) for other in others)
        if is_known or abs(track.position_m) > config.max_lateral_m or len(others) >= MOST_TRACKS:
            continue
        left = is_left(config, track.position_m, track.is_left)
        kept.append(replace(track, is_left=left, images=max(track.images - (not track.is_confirmed), 0)))
    return kept


def _is_same(config: TrackerConfig, missed: Track, other: Track) -> bool:
    """Whether a line that is missed is one that is seen: at its place, or within the gate all along."""
    apart_m = abs(missed.position_m - other.position_m)
    if apart_m < config.min_separation_m:
        return True
    if apart_m > config.gate_m or not other.is_confirmed or other.moved != HERE:
        return False
    ahead_m = distance_ahead(other.last.fit, missed)
    return ahead_m is None or ahead_m <= config.gate_m


def _with_sides(config: TrackerConfig, tracks: list[Track]) -> list[Track]:
    """Return the tracks from left to right with their sides."""
    tracks = sorted(tracks, key=lambda track: -track.position_m)
    tracks = [
        track if track.is_left is left else replace(track, is_left=left)
        for track, left in zip(tracks, lefts(tracks), strict=True)
    ]
    side_of = sides(config, tracks)
    return [
        track if track.side is side_of.get(track.number) else replace(track, side=side_of.get(track.number))
        for track in tracks
    ]


def _reports(
    config: TrackerConfig,
    state: TrackerState,
    sightings: Sequence[Sighting | None],
    line_of: Mapping[int, int],
) -> tuple[Boundary, ...]:
    """Return a boundary for every line that has a side, in the order of Side."""
    found = []
    for track in state.tracks:
        if track.side is None:
            continue
        k = line_of.get(track.number)
        line = (
            predicted(config, track.side, track, state.t_ns)
            if k is None
            else measured(track.side, k, track.last)
        )
        if line is not None:
            found.append(line)
    return tuple(sorted(found, key=lambda line: line.side))
