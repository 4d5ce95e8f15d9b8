"""One made event as files say it: its road, its drive, its camera, all drawn from (seed, number)."""

from typing import Any, NamedTuple

import numpy as np

from vsensor.video.made.kinds import KINDS, VEHICLE, Kind, camera_table
from vsensor.video.made.roads import SHIPPED, Drawn, Place, drawn_road

EVENT_S = 31.0
"""P2's events: 1 s near a marking, 15 s before and after."""
MIDDLE_S = 15.5
CYCLE_MS = 50
"""Of the vehicle's own lane sensor; 10 Hz and 4 Hz are whole parts of its 20."""

LIGHTS = ("day", "night", "day", "night", "dusk")
PLACES: tuple[Place, ...] = ("motorway", "rural", "town", "track", "rural", "highway", "motorway")
"""In turn; as 5 and 7 have no common divisor, 35 events have each place in each light."""

_SPEED_KMH = {
    "motorway": (85.0, 125.0),
    "rural": (55.0, 90.0),
    "town": (30.0, 50.0),
    "track": (70.0, 95.0),
    "highway": (90.0, 125.0),
}
_STARTS_M = {"track": 5000.0, "highway": 1300.0}  # of the road that a drive begins on
_VIEW_M = 260.0  # of road beyond the last place of the vehicle
_CLOSEST_M = 0.15  # the wheel stays so far inside of the marking


class Plan(NamedTuple):
    """What an event is made from: scenario, road (None: `shipped` is the file), video camera, conditions."""

    scenario: dict[str, Any]
    road: dict[str, Any] | None
    shipped: str | None
    camera: dict[str, Any]
    conditions: dict[str, Any]


def planned(kind_name: str, seed: int, number: int, duration_s: float = EVENT_S) -> Plan:
    """Return the plan of event `number`: the same for the same seed, whatever else is made."""
    rng = np.random.default_rng([seed, number, sorted(KINDS).index(kind_name)])
    kind = KINDS[kind_name]
    light, place = LIGHTS[number % len(LIGHTS)], PLACES[number % len(PLACES)]
    speed_kmh = _speeds(rng, place, duration_s)
    fastest_mps = max(speed for _, speed in speed_kmh) / 3.6
    drawn = _drawn(rng, place, fastest_mps, fastest_mps * duration_s + _VIEW_M)
    rain = round(float(rng.uniform(0.2, 1.0)), 2) if rng.random() < 0.25 else 0.0
    traffic = _traffic(rng, drawn, speed_kmh[0][1])
    shipped = SHIPPED.get(place)
    scenario = {
        "source": "road.toml" if shipped is None or shipped.endswith(".toml") else "road.xodr",
        "name": f"{kind_name}_{number:04d}",
        "duration_s": duration_s,
        "seed": (seed * 1_000_003 + number) % 2**31,
        "cycle_ms": CYCLE_MS,
        "ego": {
            "road": "1",
            "lane": drawn.lane,
            "s_m": round(float(rng.uniform(0.0, _STARTS_M[place])), 1) if shipped else 0.0,
            "speed_kmh": speed_kmh,
            "offset_m": _offsets(rng, drawn.width_m, duration_s),
        },
        "traffic": traffic,
        "environment": {"light": light, "rain": rain},
        "vehicle": {"wheelbase_m": VEHICLE.wheelbase_m, "width_m": VEHICLE.width_m},
        "motion": {"body": True, "vibration": str(rng.choice(["smooth", "normal", "rough"]))},
        "image": _image(rng, kind, light),
        "output": {"profile": "p2"},
    }
    conditions = {"light": light, "rain": rain, "place": place, "vehicles": len(traffic)}
    return Plan(scenario, drawn.road or None, shipped, camera_table(kind, rng), conditions)


def _drawn(rng: np.random.Generator, place: Place, speed_mps: float, length_m: float) -> Drawn:
    if place == "track":
        return Drawn({}, -2, 3.75, lanes_left=1)
    if place == "highway":
        return Drawn({}, -3, 3.75, lanes_left=1)
    return drawn_road(rng, place, speed_mps, length_m)


def _speeds(rng: np.random.Generator, place: Place, duration_s: float) -> list[list[float]]:
    """Return the speed over time: steady stretches and others with up to 1.2 m/s^2, within what is usual."""
    low, high = _SPEED_KMH[place]
    t_s, speed = 0.0, float(rng.uniform(low, high))
    points = [[0.0, round(speed, 1)]]
    while t_s < duration_s:
        t_s += float(rng.uniform(4.0, 9.0))
        if rng.random() < 0.5:
            change = 3.6 * float(rng.uniform(-1.2, 1.2)) * (t_s - points[-1][0])
            speed = float(np.clip(speed + change, low, high))
        points.append([round(t_s, 1), round(speed, 1)])
    return points


def _offsets(rng: np.random.Generator, width_m: float, duration_s: float) -> list[list[float]]:
    """Return the way about the lane's middle: wandering, and in the middle of the event near a marking."""
    room_m = 0.5 * (width_m - VEHICLE.width_m) - _CLOSEST_M - 0.1
    side = float(rng.choice([-1.0, 1.0]))
    near = side * room_m * float(rng.uniform(0.6, 1.0))
    times = [0.0, *np.arange(4.0, max(duration_s, 8.0), 3.5).tolist()]
    wander = rng.normal(0.0, 0.12, len(times)).clip(-0.3, 0.3).tolist()
    return [
        [round(t, 2), round(near if abs(t - MIDDLE_S) < 1.8 else offset, 3)]
        for t, offset in zip(times, wander, strict=True)
    ]


def _traffic(rng: np.random.Generator, drawn: Drawn, speed_kmh: float) -> list[dict[str, Any]]:
    """Return who else is there: often one ahead in the own lane, and some that overtake or are overtaken."""
    found: list[dict[str, Any]] = []
    kinds = ("car", "car", "car", "van", "truck")
    if rng.random() < 0.6:
        near, far = np.sort(rng.uniform(18.0, 80.0, 2)).tolist()
        points = [[0.0, round(far, 1)], [MIDDLE_S, round(near, 1)], [31.0, round(far, 1)]]
        found.append({"kind": str(rng.choice(kinds)), "ahead_m": points})
    if drawn.lanes_left and rng.random() < 0.6:
        found.append(
            {
                "kind": str(rng.choice(kinds)),
                "lanes_left": 1,
                "ahead_m": round(float(rng.uniform(-40.0, 60.0)), 1),
                "speed_kmh": round(speed_kmh * float(rng.uniform(0.9, 1.25)), 1),
                "recycle_m": round(float(rng.uniform(150.0, 400.0)), 1),
            }
        )
    return found


def _image(rng: np.random.Generator, kind: Kind, light: str) -> dict[str, Any]:
    """Return how the camera takes images; by night it exposes longer."""
    longer = {"day": 1.0, "dusk": 1.6, "night": 2.0}[light]
    return {
        "channels": kind.channels,
        "noise_std": round(float(rng.uniform(1.5, 4.0)), 2),
        "blur_px": round(float(rng.uniform(0.5, 0.9)), 2),
        "wear": 0.1,
        "exposure": round(longer * float(rng.uniform(0.8, 1.2)), 2),
        "texture": round(float(rng.uniform(0.03, 0.10)), 3),
    }
