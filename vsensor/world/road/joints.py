"""Where the end of one road meets the start of another: which, and which of their lanes go on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, pi, remainder
from typing import TYPE_CHECKING

from vsensor.errors import ConfigError
from vsensor.world.road.config import LinkConfig, RoadFile
from vsensor.world.road.layout import PlannedSection
from vsensor.world.road.rows import value_at

if TYPE_CHECKING:
    from vsensor.world.road.plan import Body

MEETS_M, MEETS_RAD = 1e-6, 1e-9
SAME_Z_M = 1e-3
SAME_BORDER_M = 0.01


@dataclass(frozen=True, slots=True)
class Joint:
    """The end of `incoming` at the start of `outgoing` (places in the file), whose t is `shift_m` less."""

    incoming: int
    outgoing: int
    shift_m: float
    lanes: tuple[tuple[int, int], ...] | None
    where: str


def joints_of(file: RoadFile) -> tuple[Joint, ...]:
    """Return all joints; raises ConfigError for a road that is not there."""
    names = [config.name for config in file.road]
    for number, name in enumerate(names):
        if name and name in names[:number]:
            raise ConfigError(f'road[{number}].name = "{name}": two roads of one name')
    found: dict[tuple[int, int], Joint] = {}
    for number, config in enumerate(file.road):
        if config.closed:
            found[number, number] = Joint(number, number, 0.0, None, f"road[{number}].closed")
        for key, link in (("after", config.after), ("before", config.before)):
            if link is None:
                continue
            where = f"road[{number}].{key}"
            if config.closed:
                raise ConfigError(f"{where}: a closed road has no other before or after it")
            joint = _joint(number, _named(link, names, where), link, key, where)
            found[joint.incoming, joint.outgoing] = joint
    return tuple(found.values())


def _named(link: LinkConfig, names: Sequence[str], where: str) -> int:
    if link.road not in names or not link.road:
        known = ", ".join(name for name in names if name) or "none has a name"
        raise ConfigError(f'{where}.road = "{link.road}": no such road; roads: {known}')
    return names.index(link.road)


def _joint(number: int, other: int, link: LinkConfig, key: str, where: str) -> Joint:
    if key == "after":
        return Joint(other, number, link.shift_m, link.lanes, where)
    lanes = None if link.lanes is None else tuple((mine, theirs) for theirs, mine in link.lanes)
    return Joint(number, other, -link.shift_m, lanes, where)


def check_joint(joint: Joint, incoming: "Body", outgoing: "Body") -> None:
    """Raise ConfigError where the two ends do not meet."""
    end, start = incoming.line.end.shifted(joint.shift_m), outgoing.line.start
    gap = hypot(end.x_m - start.x_m, end.y_m - start.y_m)
    turn = abs(remainder(end.heading_rad - start.heading_rad, 2.0 * pi))
    if gap > MEETS_M or turn > MEETS_RAD:
        raise ConfigError(f"{joint.where}: the roads miss each other by {gap:.6g} m and {turn:.3g} rad")
    z_in = value_at(incoming.elevation, incoming.length_m)
    rise = value_at(outgoing.elevation, 0.0) - z_in
    if joint.shift_m == 0.0 and abs(rise) > SAME_Z_M:
        raise ConfigError(f"{joint.where}: the road goes on {rise:g} m higher; check elevation of both")


def lanes_joined(joint: Joint, incoming: "Body", outgoing: "Body") -> tuple[tuple[int, int], ...]:
    """Return the pairs of lanes (of the file) that go on; raises ConfigError for one that is not there."""
    last, first = incoming.layout.sections[-1], outgoing.layout.sections[0]
    if joint.lanes is None:
        return _meeting(joint, incoming, outgoing)
    for a, b in joint.lanes:
        for lane, section, what in ((a, last, "ends"), (b, first, "starts")):
            if lane == 0 or lane not in section.ids:
                raise ConfigError(f"{joint.where}.lanes: there is no lane {lane} where the road {what}")
    return joint.lanes


def _meeting(joint: Joint, incoming: "Body", outgoing: "Body") -> tuple[tuple[int, int], ...]:
    ends = _borders(incoming, incoming.layout.sections[-1], incoming.length_m, -joint.shift_m)
    starts = _borders(outgoing, outgoing.layout.sections[0], 0.0, 0.0)
    pairs = []
    for a, (inner_a, outer_a, kind_a) in ends.items():
        for b, (inner_b, outer_b, kind_b) in starts.items():
            meets = max(abs(inner_a - inner_b), abs(outer_a - outer_b)) < SAME_BORDER_M
            if meets and kind_a == kind_b and a * b > 0:
                pairs.append((a, b))
    return tuple(pairs)


def _borders(
    body: "Body", section: PlannedSection, s_m: float, shift_m: float
) -> dict[int, tuple[float, float, str]]:
    """Return t of the inner and outer border, and kind, of each lane with a width at s."""
    layout = body.layout
    found: dict[int, tuple[float, float, str]] = {}
    for number in section.ids:
        if number != 0 and value_at(layout.lanes[number].width, s_m) > SAME_BORDER_M:
            inner = number - (1 if number > 0 else -1)
            t = [value_at(layout.t(border), s_m) + shift_m for border in (inner, number)]
            found[number] = (t[0], t[1], layout.lanes[number].config.kind)
    return found
