"""Between what is asked for and what is there: closed courses of speed and front wheels over a tick.

asked  ________               the wheels turn at their fastest until a lag of first order is slower
      /    .---'              than that; drive and brakes follow with a lag of first order
     /  .-'
____/.-'     both are known exactly at every time, and where they have a kink a step ends
"""

from dataclasses import dataclass, replace
from math import exp, inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuators:
    """Time constants in s; `steering_rate_radps` is the fastest that the front wheels turn."""

    steering_lag_s: float = 0.0
    steering_rate_radps: float = inf
    drive_lag_s: float = 0.0
    brake_lag_s: float = 0.0


AT_ONCE = Actuators()


@dataclass(frozen=True, slots=True)
class Pedals:
    """What drive and brakes give, m/s^2 ahead; the brakes' part is negative."""

    drive_mps2: float = 0.0
    brake_mps2: float = 0.0

    @property
    def acceleration_mps2(self) -> float:
        """Both together."""
        return self.drive_mps2 + self.brake_mps2


RELEASED = Pedals()


@dataclass(frozen=True, slots=True)
class Speeds:
    """Speed over a tick: drive and brakes go to what is `asked` of each, from `excess` more, by their lags.

    From `stops_s` on the vehicle stands.
    """

    start_mps: float
    asked: Pedals
    excess: Pedals = RELEASED
    drive_lag_s: float = 0.0
    brake_lag_s: float = 0.0
    stops_s: float = inf

    @classmethod
    def between(cls, start_mps: float, end_mps: float, dt_s: float) -> "Speeds":
        """Return the course that goes evenly from one speed to another."""
        return cls(start_mps, Pedals((end_mps - start_mps) / dt_s if dt_s else 0.0))

    @classmethod
    def towards(
        cls, speed_mps: float, now: Pedals, asked_mps2: float, actuators: Actuators, dt_s: float
    ) -> "Speeds":
        """Return the course towards an acceleration that is asked for; a vehicle that stops stays there."""
        drive_lag_s, brake_lag_s = actuators.drive_lag_s, actuators.brake_lag_s
        asked = Pedals(max(asked_mps2, 0.0), min(asked_mps2, 0.0))
        excess = Pedals(
            now.drive_mps2 - asked.drive_mps2 if drive_lag_s else 0.0,
            now.brake_mps2 - asked.brake_mps2 if brake_lag_s else 0.0,
        )
        free = cls(speed_mps, asked, excess, drive_lag_s, brake_lag_s)
        if free.at(dt_s)[0] >= 0.0:
            return free
        low, high = 0.0, dt_s
        for _ in range(60):
            middle = (low + high) / 2.0
            low, high = (middle, high) if free.at(middle)[0] > 0.0 else (low, middle)
        return replace(free, stops_s=low)

    def at(self, t_s: float) -> tuple[float, float]:
        """Return speed and acceleration after `t_s`."""
        if t_s >= self.stops_s:
            return 0.0, 0.0
        acceleration = self.asked.acceleration_mps2
        speed = self.start_mps + acceleration * t_s
        drive, brake = self.excess.drive_mps2, self.excess.brake_mps2
        if drive != 0.0:
            left = exp(-t_s / self.drive_lag_s)
            speed += drive * self.drive_lag_s * (1.0 - left)
            acceleration += drive * left
        if brake != 0.0:
            left = exp(-t_s / self.brake_lag_s)
            speed += brake * self.brake_lag_s * (1.0 - left)
            acceleration += brake * left
        return speed, acceleration

    def pedals(self, t_s: float) -> Pedals:
        """Return what each gives after `t_s`; at a stop nothing is needed any more."""
        if t_s >= self.stops_s:
            return RELEASED
        drive, brake = self.excess.drive_mps2, self.excess.brake_mps2
        return Pedals(
            self.asked.drive_mps2 + (drive * exp(-t_s / self.drive_lag_s) if drive else 0.0),
            self.asked.brake_mps2 + (brake * exp(-t_s / self.brake_lag_s) if brake else 0.0),
        )

    def reaches_s(self, speed_mps: float, dt_s: float) -> float:
        """Return when a speed is passed on the way from the first to the last, `dt_s` if it is not."""
        is_below = self.start_mps < speed_mps
        if is_below == (self.at(dt_s)[0] < speed_mps):
            return dt_s
        low, high = 0.0, dt_s
        for _ in range(60):
            middle = (low + high) / 2.0
            is_before = (self.at(middle)[0] < speed_mps) == is_below
            low, high = (middle, high) if is_before else (low, middle)
        return high


@dataclass(frozen=True, slots=True)
class Wheels:
    """Angle of the front wheels over a tick: `slope_radps` until `until_s`, then towards `asked_rad`."""

    start_rad: float
    asked_rad: float
    slope_radps: float = 0.0
    until_s: float = 0.0
    lag_s: float = 0.0

    @classmethod
    def asked(cls, now_rad: float, asked_rad: float, actuators: Actuators) -> "Wheels":
        """Return the course from where they are to what is asked for."""
        lag, fastest = actuators.steering_lag_s, actuators.steering_rate_radps
        gap = asked_rad - now_rad
        if fastest == inf or abs(gap) <= fastest * lag:
            return cls(now_rad, asked_rad, lag_s=lag)
        until_s = (abs(gap) - fastest * lag) / fastest
        return cls(now_rad, asked_rad, fastest if gap > 0.0 else -fastest, until_s, lag)

    def at(self, t_s: float) -> float:
        """Return the angle after `t_s`."""
        if t_s < self.until_s:
            return self.start_rad + self.slope_radps * t_s
        if self.lag_s == 0.0:
            return self.asked_rad
        gap = self.asked_rad - (self.start_rad + self.slope_radps * self.until_s)
        return self.asked_rad - gap * exp(-(t_s - self.until_s) / self.lag_s)
