"""The `[image]` section, and how bright things are: levels of 0 to 1 as a camera's image shows them."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from msgspec import Meta

from vsensor.light import fog_extinction_per_m
from vsensor.schema import Config
from vsensor.types import Array, Beam, Colour, Environment, Light


class ImageConfig(Config, frozen=True, kw_only=True):
    """How an image is made, for the light and rain of the scene.

    `noise_std` in grey levels by day (half as much again at dusk, twice at night, up to twice in rain);
    `blur_px` is the deviation of the lens's blur; `wear` 0 new paint to 1 none left; `exposure` times
    every level; `texture` the road's unevenness as a fraction of its level.
    """

    channels: Literal["grey", "rgb"] = "grey"
    noise_std: Annotated[float, Meta(ge=0.0, le=100.0)] = 2.0
    blur_px: Annotated[float, Meta(ge=0.0, le=20.0)] = 0.6
    wear: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.2
    exposure: Annotated[float, Meta(gt=0.0, le=20.0)] = 1.0
    texture: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.05


class Lighting(NamedTuple):
    """Light on the scene: from the sky, and from the own headlights at no distance; what it does to noise."""

    ambient: float
    headlights: float
    noise: float


LIGHTING = {
    Light.DAY: Lighting(1.0, 0.0, 1.0),
    Light.DUSK: Lighting(0.4, 0.15, 1.5),
    Light.NIGHT: Lighting(0.05, 0.75, 2.0),
}

PAINT_RGB = {
    Colour.UNKNOWN: (0.90, 0.90, 0.88),
    Colour.WHITE: (0.90, 0.90, 0.88),
    Colour.YELLOW: (0.86, 0.66, 0.14),
    Colour.BLUE: (0.16, 0.32, 0.70),
    Colour.RED: (0.72, 0.16, 0.13),
    Colour.GREEN: (0.13, 0.52, 0.27),
    Colour.ORANGE: (0.88, 0.48, 0.10),
}
ROAD_RGB = (0.30, 0.30, 0.31)
SKY_RGB = (0.72, 0.80, 0.90)
BODY_RGB = (
    (0.82, 0.82, 0.82),
    (0.13, 0.13, 0.14),
    (0.48, 0.49, 0.51),
    (0.62, 0.63, 0.65),
    (0.50, 0.12, 0.10),
    (0.14, 0.22, 0.44),
)
"""Bodies of vehicles: most are white, black, or grey."""

HEADLIGHT_M = {Beam.OFF: 25.0, Beam.LOW: 25.0, Beam.HIGH: 75.0}
"""Distance at which half of the headlights' light is left: dipped beams end at some 60 m."""
HEADLIGHT_SLOPE, HEADLIGHT_ASIDE_M = 0.3, 3.0
"""Half as bright at this slope to the side, plus this distance."""
RETROREFLECTION = 0.5
"""Headlights on dry asphalt against on paint, whose glass beads send the light back."""

HAZE_M = 300.0
"""So much air between camera and sky turns it to the level of fog."""
RAIN_VEIL = 0.12
"""Of the heaviest rain on the windscreen."""

_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601


def levels(config: ImageConfig, rgb: tuple[float, float, float]) -> Array:
    """Return a colour in the channels of the image, (1,) or (3,)."""
    colour = np.array(rgb)
    return colour if config.channels == "rgb" else np.array([colour @ _LUMA])


def headlights_level(environment: Environment) -> float:
    """Return the level of the own headlights at no distance."""
    return 0.0 if environment.headlights is Beam.OFF else LIGHTING[environment.light].headlights


def haze(environment: Environment) -> float:
    """Return how much of the sky rain and fog hide, 0 to 1."""
    in_fog = 1.0 - float(np.exp(-HAZE_M * fog_extinction_per_m(environment)))
    return environment.rain + (1.0 - environment.rain) * in_fog


def veil_level(environment: Environment) -> float:
    """Return the level that rain and fog draw everything towards."""
    return 0.6 * LIGHTING[environment.light].ambient
