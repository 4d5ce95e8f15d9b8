r"""Light on the road and through the air: how much lighter than asphalt paint looks to the camera.

    paint  L_p   \                      airlight: the air's own light comes in between
    road   L_r    \ . : : : .           L(d) = L exp(-k d) + L_air (1 - exp(-k d))      (Koschmieder)
    ---------------'---------o camera   contrast = (L_p(d) - L_r(d)) / (L_r(d) + what the camera adds)

Luminances in cd/m^2, distances in m. Rain and fog take light on its way (k), the own headlights fall on the
road with the square of the distance, and what they light up of the fog itself comes back into the camera.
"""

from math import inf, log, pi

import numpy as np

from vsensor.types import Array, Beam, Colour, Environment, Light

AMBIENT_LX = {Light.DAY: 20_000.0, Light.DUSK: 20.0, Light.NIGHT: 0.1}
"""Illuminance on the road: overcast day, the middle of civil twilight, a clear night away from lamps."""

PAINT_CD_PER_LX, ROAD_CD_PER_LX = 0.13, 0.07
"""Luminance per illuminance in diffuse light: EN 1436 class Q3 of paint, Q0 of CIE's asphalt R3."""
PAINT_BACK_CD_PER_LX, PAINT_BACK_WET_CD_PER_LX = 0.15, 0.035
"""In the own headlights: EN 1436 classes R3 dry and RW2 wet; the glass beads do not work under water."""
ROAD_BACK_CD_PER_LX, ROAD_BACK_WET_CD_PER_LX = 0.015, 0.0045
WET_PAINT = 0.4
"""Part of the paint's contrast in diffuse light that the heaviest rain's film of water takes."""

PAINT_BY_COLOUR = {
    Colour.UNKNOWN: 1.0,
    Colour.WHITE: 1.0,
    Colour.YELLOW: 0.6,
    Colour.ORANGE: 0.5,
    Colour.GREEN: 0.35,
    Colour.RED: 0.25,
    Colour.BLUE: 0.2,
}
"""How much lighter than asphalt a colour is, of white; yellow is EN 1436's Y class against white's."""
_BY_COLOUR = np.array([PAINT_BY_COLOUR[colour] for colour in Colour])

LOW_BEAM_CD, ABOVE_CUT_OFF_CD, HIGH_BEAM_CD = 20_000.0, 800.0, 80_000.0
"""Of both lamps: below the cut-off and above it (UN R112: at most 437 cd each), high beam."""
LAMP_HEIGHT_M, CUT_OFF_SLOPE, CUT_OFF_WIDTH = 0.65, 0.010, 0.001
"""A low beam is aimed 1 % down: its cut-off meets the road 65 m ahead."""
BEAM_ASIDE_M, BEAM_SLOPE = 3.0, 0.3
"""Half as bright at this slope to the side, plus this distance."""

CAMERA_CD_PER_M2 = 1.0
"""Luminance that a camera sees in the dark: noise and stray light of an ordinary one at 25 images/s."""

RAIN_EXTINCTION_PER_M = 0.008
"""Of the heaviest rain: a third of the contrast is lost in 50 m."""
CONTRAST_AT_VISIBILITY = 0.05
"""What is left of the contrast at the meteorological visibility (WMO: optical range)."""
_FIRST_FOG_M = 10.0  # the beams cross the camera's sight from here on

_FARTHEST_M = 1000.0


def fog_extinction_per_m(environment: Environment) -> float:
    """Return how quickly contrast falls with distance, 1/m, in fog (Koschmieder): 3.0 / visibility."""
    return 0.0 if environment.visibility_m == inf else -log(CONTRAST_AT_VISIBILITY) / environment.visibility_m


def extinction_per_m(environment: Environment) -> float:
    """Return how quickly contrast falls with distance, 1/m, in rain and fog."""
    return fog_extinction_per_m(environment) + RAIN_EXTINCTION_PER_M * environment.rain


def beam_cd(beam: Beam, ahead_m: Array, aside_m: Array) -> Array:
    """Return the intensity (N,) of the headlights towards places on the road."""
    if beam is Beam.OFF:
        return np.zeros_like(ahead_m)
    aside = 1.0 / (1.0 + (aside_m / (BEAM_ASIDE_M + BEAM_SLOPE * ahead_m)) ** 2)
    if beam is Beam.HIGH:
        return np.asarray(HIGH_BEAM_CD * aside)
    over = (CUT_OFF_SLOPE - LAMP_HEIGHT_M / ahead_m) / CUT_OFF_WIDTH
    return np.asarray(aside * (ABOVE_CUT_OFF_CD + LOW_BEAM_CD / (1.0 + np.exp(np.clip(over, -50.0, 50.0)))))


def contrast(environment: Environment, ahead_m: Array, aside_m: Array, paint: Array | float = 1.0) -> Array:
    """Return the contrast (N,) of paint against the road, as the camera above the headlights sees it.

    `paint` is how much of it is there, 1 fresh and white, see `paint_left`.
    """
    rain, beam = environment.rain, environment.headlights
    extinction = extinction_per_m(environment)
    distance_m = np.maximum(np.hypot(ahead_m, aside_m), 1.0)
    clear = np.exp(-extinction * distance_m)
    ambient_lx = AMBIENT_LX[environment.light]
    back_lx = beam_cd(beam, np.maximum(ahead_m, 1.0), aside_m) / distance_m**2 * clear
    paint_back = PAINT_BACK_CD_PER_LX + rain * (PAINT_BACK_WET_CD_PER_LX - PAINT_BACK_CD_PER_LX)
    road_back = ROAD_BACK_CD_PER_LX + rain * (ROAD_BACK_WET_CD_PER_LX - ROAD_BACK_CD_PER_LX)
    diffuse = (PAINT_CD_PER_LX - ROAD_CD_PER_LX) * (1.0 - WET_PAINT * rain)
    lighter = paint * (ambient_lx * diffuse + back_lx * (paint_back - road_back))
    road = ambient_lx * ROAD_CD_PER_LX + back_lx * road_back
    air = ambient_lx / pi * (1.0 - clear)
    return np.asarray(
        lighter * clear / (road * clear + air + _scattered(beam, extinction) + CAMERA_CD_PER_M2)
    )


def _scattered(beam: Beam, extinction: float) -> float:
    """Return the luminance of rain or fog that the own headlights light up, scattered evenly all round."""
    above_cd = {Beam.OFF: 0.0, Beam.LOW: ABOVE_CUT_OFF_CD, Beam.HIGH: HIGH_BEAM_CD}[beam]
    return above_cd * extinction / (4.0 * pi * _FIRST_FOG_M)


def paint_left(contrast_left: Array | float, colour: Array) -> Array:
    """Return how much lighter than asphalt worn paint of a colour (N,) is, as a part of fresh white."""
    return np.asarray(contrast_left * _BY_COLOUR[np.searchsorted(list(Colour), colour)])


def visible_range_m(environment: Environment, least: float, paint: float = 1.0) -> float:
    """Return how far ahead paint has at least this contrast, inf beyond 1 km; it falls with the distance."""
    ahead = np.linspace(1.0, _FARTHEST_M, 9991)
    faint = contrast(environment, ahead, np.zeros_like(ahead), paint) < least
    return float(ahead[max(int(faint.argmax()) - 1, 0)]) if faint.any() else inf


def is_clear(environment: Environment) -> bool:
    """Whether fresh paint is seen at any distance: a dry day without fog."""
    return environment.light is Light.DAY and not environment.rain and environment.visibility_m == inf
