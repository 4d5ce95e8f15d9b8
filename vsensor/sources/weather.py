"""`[environment]`: light and rain over the time of a run."""

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.types import Environment, Light
from vsensor.world.profiles import LinearProfile, Points

LightWord = Literal["day", "dusk", "night"]


class EnvironmentConfig(Config, frozen=True, kw_only=True):
    """`[environment]`: light and rain (0 dry to 1 heaviest).

    Each one value, or [[time in s, value], ...]: light changes at these times, rain linearly between them.
    """

    light: LightWord | list[tuple[float, LightWord]] = "day"
    rain: Points = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no weather (ValueError; from a file, a ConfigError)."""
        try:
            self.weather()
        except ConfigError as error:
            raise ValueError(str(error)) from None

    def weather(self) -> "Weather":
        """Return light and rain over time; raises ConfigError for what cannot be."""
        points = [(0.0, self.light)] if isinstance(self.light, str) else self.light
        if not points:
            raise ConfigError("light: an empty list; a word or points [[t_s, word], ...] expected")
        for (before_s, _), (after_s, _) in pairwise(points):
            if after_s <= before_s:
                raise ConfigError(f"light: times must rise, but {after_s:g} s comes after {before_s:g} s")
        rain = LinearProfile.of(self.rain, "rain")
        if min(rain.values) < 0.0 or max(rain.values) > 1.0:
            raise ConfigError("rain: values from 0 to 1 were expected")
        lights = tuple(Light[word.upper()] for _, word in points)
        return Weather(light_times_s=tuple(t_s for t_s, _ in points), lights=lights, rain=rain)


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """Light from each of `light_times_s` on, the first one before them too; rain over time."""

    light_times_s: tuple[float, ...]
    lights: tuple[Light, ...]
    rain: LinearProfile

    @classmethod
    def of(cls, environment: "Environment | Weather | None") -> "Weather":
        """Return weather that never changes, a dry day without one; weather stays as it is."""
        if isinstance(environment, Weather):
            return environment
        always = Environment() if environment is None else environment
        rain = LinearProfile.of(always.rain, "rain")
        return cls(light_times_s=(0.0,), lights=(always.light,), rain=rain)

    def at(self, t_s: float) -> Environment:
        """Return light and rain at a time of the run."""
        place = max(bisect_right(self.light_times_s, t_s) - 1, 0)
        return Environment(light=self.lights[place], rain=self.rain.value(t_s))
