"""What moves a vehicle that listens: the quantities, and what each way of moving it has in common.

Each control is a value machine: `advance(state, listened, news, tick, tilt) -> (state, Motion)`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, Protocol

from vsensor.sources.listening import ListenConfig, Listened, News
from vsensor.types import Tick
from vsensor.world.vehicle import Tilt

SPEED, YAW_RATE, ACCELERATION = "ego.speed_mps", "ego.yaw_rate_radps", "ego.acceleration_mps2"
X, Y, Z, YAW = "ego.x_m", "ego.y_m", "ego.z_m", "ego.yaw_rad"
REQUEST, WHEEL = "ego.steering_request_rad", "ego.steering_wheel_rad"

FOR_EVER_NS = 1 << 62


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A place on the map: x, y in metres, heading."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Where the vehicle is and how it moves; `z_m` NaN = on the road of the map.

    `lateral_mps2` NaN = speed times yaw rate: the vehicle goes where it heads.
    """

    pose: Pose
    z_m: float = nan
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0
    acceleration_mps2: float = 0.0
    lateral_mps2: float = nan


class Control(Protocol):
    """Moves the vehicle."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The quantities that a profile must carry."""
        ...

    @property
    def senses(self) -> tuple[str, ...]:
        """Those of them that the sensor needs, too."""
        ...

    def initial(self, start: Pose) -> Any:
        """Return the state of a vehicle that stands at the start."""
        ...

    def advance(
        self, state: Any, listened: Listened, news: Sequence[News], tick: Tick, tilt: Tilt
    ) -> tuple[Any, Motion]:
        """Return the state and the motion at the tick; `tilt` is that of the road at the tick before."""
        ...

    def remarks(self, state: Any) -> tuple[str, ...]:
        """Say at the end of a run what the motion itself met."""
        ...


def hold_ns(config: ListenConfig) -> int:
    """Return how long a last value is held."""
    return FOR_EVER_NS if config.hold_ms is None else round(config.hold_ms * 1e6)
