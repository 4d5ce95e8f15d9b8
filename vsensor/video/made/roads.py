"""Roads of made events, drawn: lanes, paint, bends, hills, gaps, wear, old lines, crosswalks, bumps."""

from typing import Any, Literal, NamedTuple

import numpy as np

Place = Literal["motorway", "rural", "town", "track", "highway"]

SHIPPED: dict[Place, str] = {"track": "p3_track.toml", "highway": "highway.xodr"}
"""Places that are no drawn roads but shipped ones, each with bends, gaps, crests or traffic of its own."""

_YAW_RATE_RADPS = 0.13
"""No bend is driven through faster: P2's events have at most 10 deg/s."""
_LATERAL_MPS2 = {"motorway": 2.2, "rural": 3.0, "town": 3.0}
_TIGHT, _TIGHTER = 0.5, 1.2
"""So many bends are as tight as the speed allows, within this factor: from 5 deg/s on P2 calls it curvy."""
_BANKED = 0.3  # of the lateral acceleration is taken by the road's fall
_BEND_M = (70.0, 240.0)
_NOT_BEFORE_M = 60.0  # the first gap, crosswalk: the sensor has seen both lines by then


class Drawn(NamedTuple):
    """A road file's `[[road]]`, the ego's lane on it, how wide that is, how many lanes are to its left."""

    road: dict[str, Any]
    lane: int
    width_m: float
    lanes_left: int


def drawn_road(rng: np.random.Generator, place: Place, speed_mps: float, length_m: float) -> Drawn:
    """Return a road of at least this length that can be driven at this speed."""
    build = {"motorway": _motorway, "rural": _rural, "town": _town}[place]
    drawn = build(rng, length_m)
    road = {
        "name": place,
        "type": place,
        "line": _line(rng, place, speed_mps, length_m),
        "elevation": _hills(rng, length_m, steepest=0.015 if place == "motorway" else 0.03),
        **drawn.road,
    }
    borders = [0, -1] if drawn.lane == -1 else [-1, -2]
    road["gap"] = [*road.get("gap", []), *_gaps(rng, length_m, borders)]
    if rng.random() < 0.2:
        road["ghost"] = [_ghost(rng, length_m, borders)]
    if rng.random() < 0.4:
        road["bump"] = _bumps(rng, length_m)
    return drawn._replace(road=road)


def _motorway(rng: np.random.Generator, length_m: float) -> Drawn:
    """Return two lanes one way and a shoulder; the ego drives on the right one or on the left one."""
    width_m = float(rng.choice([3.5, 3.75]))
    between = {"kind": "dashed", "dash_m": 6.0, "gap_m": float(rng.choice([9.0, 12.0])), "width_m": 0.15}
    edge = {"kind": "solid", "width_m": 0.2}
    colour = "yellow" if rng.random() < 0.3 else "white"
    road = {
        "centre": {**edge, "colour": colour, "wear": _wear(rng)},
        "right": [
            {"width_m": width_m, "paint": {**between, "wear": _wear(rng), "contrast": _contrast(rng)}},
            {"width_m": width_m, "paint": {**edge, "wear": _wear(rng), "contrast": _contrast(rng)}},
            {"width_m": 2.5, "kind": "shoulder"},
        ],
    }
    lane = -2 if rng.random() < 0.6 else -1
    return Drawn(road, lane, width_m, lanes_left=1 if lane == -2 else 0)


def _rural(rng: np.random.Generator, length_m: float) -> Drawn:
    """Return a lane each way; the edge is solid, dashed, or not painted."""
    width_m = float(rng.choice([3.0, 3.25, 3.5]))
    centres: list[dict[str, Any]] = [
        {"kind": "dashed", "dash_m": 3.0, "gap_m": 6.0, "width_m": 0.12},
        {"kind": "dashed", "dash_m": 4.0, "gap_m": 8.0, "width_m": 0.12},
        {"kind": "solid", "width_m": 0.12},
        {"kind": "double_solid", "width_m": 0.12, "colour": "yellow"},
        {"kind": "solid_dashed", "dash_m": 3.0, "gap_m": 6.0, "width_m": 0.12},
    ]
    edges: list[dict[str, Any]] = [
        {"kind": "solid", "width_m": 0.12},
        {"kind": "solid", "width_m": 0.12},
        {"kind": "dashed", "dash_m": 3.0, "gap_m": 3.0, "width_m": 0.12},
        {"kind": "none"},
    ]
    centre, edge = centres[rng.integers(len(centres))], edges[rng.integers(len(edges))]
    road = {
        "centre": {**centre, "wear": _wear(rng), "contrast": _contrast(rng)},
        "left": [{"width_m": width_m, "paint": edge}],
        "right": [
            {"width_m": width_m, "paint": {**edge, "wear": _wear(rng), "contrast": _contrast(rng)}},
            {"width_m": 0.75, "kind": "shoulder"},
        ],
    }
    return Drawn(road, -1, width_m, lanes_left=1)


def _town(rng: np.random.Generator, length_m: float) -> Drawn:
    """Return a street with crosswalks, each with its stop line; lines end before them."""
    width_m = float(rng.choice([3.0, 3.25]))
    edge = {"kind": "solid", "width_m": 0.12} if rng.random() < 0.75 else {"kind": "none"}
    first_m = rng.uniform(_NOT_BEFORE_M, 200.0)
    places_m = [round(float(at), 1) for at in np.arange(first_m, length_m - 10.0, rng.uniform(120.0, 260.0))]
    road = {
        "centre": {"kind": "dashed", "dash_m": 3.0, "gap_m": 3.0, "width_m": 0.12, "wear": _wear(rng)},
        "left": [{"width_m": width_m, "paint": edge}],
        "right": [
            {"width_m": width_m, "paint": {**edge, "wear": _wear(rng), "contrast": _contrast(rng)}},
            {"width_m": 2.0, "kind": "sidewalk"},
        ],
        "crosswalk": [{"at_m": at} for at in places_m],
        "stop_line": [{"at_m": round(at - 2.0, 1)} for at in places_m],
        "gap": [{"borders": [0, -1, 1], "at_m": round(at - 1.0, 1), "length_m": 6.0} for at in places_m],
    }
    return Drawn(road, -1, width_m, lanes_left=1)


def _line(rng: np.random.Generator, place: Place, speed_mps: float, length_m: float) -> list[dict[str, Any]]:
    """Return straights and bends in turn, each bend as wide as the speed asks for."""
    straight_m = (200.0, 500.0) if place == "motorway" else (50.0, 200.0)
    least_m = max(speed_mps / _YAW_RATE_RADPS, speed_mps**2 / _LATERAL_MPS2[place])
    pieces: list[dict[str, Any]] = []
    done_m = 0.0
    while done_m < length_m:
        straight = rng.uniform(*straight_m)
        widest = _TIGHTER if rng.random() < _TIGHT else max(3.0, 1500.0 / least_m)
        radius = least_m * float(np.exp(rng.uniform(0.0, np.log(widest))))
        clothoid, arc = rng.uniform(30.0, 90.0), rng.uniform(*_BEND_M)
        turn_deg = float(np.degrees((clothoid + arc) / radius)) * float(rng.choice([-1.0, 1.0]))
        pieces.append({"kind": "straight", "length_m": round(straight, 1)})
        pieces.append(
            {
                "kind": "bend",
                "radius_m": round(radius, 1),
                "turn_deg": round(turn_deg, 3),
                "clothoid_m": round(clothoid, 1),
                "superelevation_percent": round(min(6.0, _BANKED * 100.0 * speed_mps**2 / radius / 9.81), 2),
            }
        )
        done_m += straight + 2.0 * clothoid + arc
    return pieces


def _hills(rng: np.random.Generator, length_m: float, steepest: float) -> list[dict[str, float]]:
    """Return the corners of the line of tangents: crests and sags; half of the roads are level."""
    if rng.random() < 0.5:
        return []
    corners = [{"at_m": 0.0, "z_m": 0.0}]
    while corners[-1]["at_m"] < length_m + 200.0:
        step_m = rng.uniform(250.0, 450.0)
        before = corners[-1]
        corners.append(
            {
                "at_m": round(before["at_m"] + step_m, 1),
                "z_m": round(before["z_m"] + step_m * rng.uniform(-steepest, steepest), 2),
                "radius_m": 5000.0,
            }
        )
    corners[-1].pop("radius_m")
    return corners


def _gaps(rng: np.random.Generator, length_m: float, borders: list[int]) -> list[dict[str, Any]]:
    """Return stretches without paint, on one border or on both, as in P3 and some longer ones."""
    count = int(rng.integers(0, 4))
    places = np.sort(rng.uniform(_NOT_BEFORE_M, length_m, count))
    gaps: list[dict[str, Any]] = []
    end_m = 0.0
    for at in places.tolist():
        if at <= end_m + 10.0:
            continue
        length = min(float(rng.choice([10.0, 20.0, 50.0, 90.0, 150.0])), round(length_m - at - 1.0, 1))
        which = borders if rng.random() < 0.3 else [borders[int(rng.integers(2))]]
        if length >= 5.0:
            gaps.append({"borders": which, "at_m": round(at, 1), "length_m": length})
            end_m = at + length
    return gaps


def _ghost(rng: np.random.Generator, length_m: float, borders: list[int]) -> dict[str, Any]:
    """Return an old line, removed but still faintly there, inside of the lane."""
    start = rng.uniform(_NOT_BEFORE_M, 0.6 * length_m)
    is_left = rng.random() < 0.5
    inside_m = rng.uniform(0.4, 0.9)
    return {
        "border": borders[0 if is_left else 1],
        "from_m": round(start, 1),
        "to_m": round(min(start + rng.uniform(80.0, 250.0), length_m - 1.0), 1),
        "offset_m": round(-inside_m if is_left else inside_m, 2),
        "contrast": 0.15,
    }


def _bumps(rng: np.random.Generator, length_m: float) -> list[dict[str, float]]:
    places = rng.uniform(_NOT_BEFORE_M, length_m, int(rng.integers(1, 4)))
    return [
        {
            "at_m": round(float(at), 1),
            "length_m": round(float(rng.uniform(0.5, 4.0)), 1),
            "height_m": round(float(rng.uniform(-0.03, 0.06)), 3),
        }
        for at in np.sort(places)
    ]


def _wear(rng: np.random.Generator) -> float:
    """Return how much of the paint is gone: mostly little."""
    return round(float(rng.beta(1.5, 4.0)) * 0.8, 2)


def _contrast(rng: np.random.Generator) -> float:
    return round(float(rng.uniform(0.6, 1.0)), 2)
