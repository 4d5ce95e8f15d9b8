"""`[environment]`: light, rain, fog and the own headlights over the time of a run."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Literal

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.types import Beam, Environment, Light
from vsensor.world.profiles import LinearProfile, Points

LightWord = Literal["day", "dusk", "night"]
BeamWord = Literal["auto", "off", "low", "high"]
_BEAMS = {"auto": None, "off": Beam.OFF, "low": Beam.LOW, "high": Beam.HIGH}
LEAST_VISIBILITY_M = 5.0


class EnvironmentConfig(Config, frozen=True, kw_only=True):
    """`[environment]`: light, rain (0 dry to 1 heaviest), fog and the own headlights.

    Each one value, or [[time in s, value], ...]: light and headlights change at these times, rain and
    visibility linearly between them. `visibility_m` is the meteorological one; without it there is no fog.
    `headlights` "auto": low beams unless it is a clear day.
    """

    light: LightWord | list[tuple[float, LightWord]] = "day"
    rain: Points = 0.0
    visibility_m: Points | None = None
    headlights: BeamWord | list[tuple[float, BeamWord]] = "auto"

    def __post_init__(self) -> None:
        """Refuse what is no weather (ValueError; from a file, a ConfigError)."""
        try:
            self.weather()
        except ConfigError as error:
            raise ValueError(str(error)) from None

    def weather(self) -> "Weather":
        """Return the weather over time; raises ConfigError for what cannot be."""
        rain = LinearProfile.of(self.rain, "rain")
        if min(rain.values) < 0.0 or max(rain.values) > 1.0:
            raise ConfigError("rain: values from 0 to 1 were expected")
        fog = None
        if self.visibility_m is not None:
            fog = LinearProfile.of(self.visibility_m, "visibility_m")
            if min(fog.values) < LEAST_VISIBILITY_M:
                raise ConfigError(f"visibility_m: values from {LEAST_VISIBILITY_M:g} m were expected")
        lights, beams = _points(self.light, "light"), _points(self.headlights, "headlights")
        return Weather(
            light_times_s=tuple(t_s for t_s, _ in lights),
            lights=tuple(Light[word.upper()] for _, word in lights),
            rain=rain,
            visibility=fog,
            beam_times_s=tuple(t_s for t_s, _ in beams),
            beams=tuple(_BEAMS[word] for _, word in beams),
        )


def _points(value: str | Sequence[tuple[float, str]], key: str) -> Sequence[tuple[float, str]]:
    """Return (time, word) with rising times; raises ConfigError naming the key."""
    points = [(0.0, value)] if isinstance(value, str) else value
    if not points:
        raise ConfigError(f"{key}: an empty list; a word or points [[t_s, word], ...] expected")
    for (before_s, _), (after_s, _) in pairwise(points):
        if after_s <= before_s:
            raise ConfigError(f"{key}: times must rise, but {after_s:g} s comes after {before_s:g} s")
    return points


@dataclass(frozen=True, slots=True, kw_only=True)
class Weather:
    """Light and headlights from each of their times on, the first one before them too; rain and fog.

    `visibility` None: no fog.
    """

    light_times_s: tuple[float, ...]
    lights: tuple[Light, ...]
    rain: LinearProfile
    visibility: LinearProfile | None = None
    beam_times_s: tuple[float, ...] = (0.0,)
    beams: tuple[Beam | None, ...] = (None,)

    @classmethod
    def of(cls, environment: "Environment | Weather | None") -> "Weather":
        """Return weather that never changes, a dry day without one; weather stays as it is."""
        if isinstance(environment, Weather):
            return environment
        always = Environment() if environment is None else environment
        is_foggy = always.visibility_m < inf
        return cls(
            light_times_s=(0.0,),
            lights=(always.light,),
            rain=LinearProfile.of(always.rain, "rain"),
            visibility=LinearProfile.of(always.visibility_m, "visibility_m") if is_foggy else None,
            beams=(always.beam,),
        )

    def at(self, t_s: float) -> Environment:
        """Return the weather at a time of the run."""
        return Environment(
            light=self.lights[max(bisect_right(self.light_times_s, t_s) - 1, 0)],
            rain=self.rain.value(t_s),
            visibility_m=inf if self.visibility is None else self.visibility.value(t_s),
            beam=self.beams[max(bisect_right(self.beam_times_s, t_s) - 1, 0)],
        )
