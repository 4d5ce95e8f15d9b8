"""The words that makers use, as tables: quantity | one of these words | and one of these, too.

"curv*" is every word that begins so. The first row that fits is taken, so what is more special stands first.
"""

from collections.abc import Iterable

from vsensor.profile_new.words import has, words_of

Rules = tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...]


def _table(text: str) -> Rules:
    rows = [[cell.split() for cell in line.split("|")] for line in text.strip().splitlines()]
    return tuple((what[0], tuple(first), tuple(second)) for what, first, second in rows)


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


CRC = _words("crc* checksum chksum chks* cksum csum cks chk cs")
COUNTER = _words("counter cnt cntr alive alv rolling roll msgcnt sequence")
VALID = _words("valid vld validity invalid ok nok unavailable notvalid inv")
SAYS_VALID = _words("valid ok good available avail avl")
SAYS_INVALID = _words("invalid nok unavailable notvalid notavailable inv not")
SHAPE = _words("curv* crv* crvtr cvtr kappa order")
"""What no other thing than a line has, so that a side beside it is that of a line."""

FOREIGN = _words(
    """object obj cipv target lead radar accuracy relative engine torque req* rq limit lim trip departure dpt
    warning warn usage fork buzzer hud icon ramp* set cruise
    trail* trlr* hitch trg dsply display* mx max"""
)
"""Words of signals that no lane camera's line and no vehicle's motion has."""

FOREIGN_TO_LINES = _words("longitudinal wheel whl steering pinion far edge parameter")

IMAGE = _table(
    """
    image.timestamp_ms | timestamp stamp |
    image.index        | burst brst |
    image.index        | image frame img | index idx id number num nr counter cnt ctr
    """
)
SENSOR = _table(
    """
    lane.lateral_speed_mps  | lateral lat | speed velocity spd vel
    lane.time_to_crossing_s | crossing tlc ttlc |
    lane.change             | change chg | lane ln
    sensor.state            | state status mode sta | sensor camera cam lds
    sensor.light            | light daylight illumination | ambient day daylight illumination night
    sensor.light            | day | night
    sensor.rain             | rain |
    """
)
LANE = _table(
    """
    c3_per_m2             | c3 a3 coef3 p3 |
    c2_per_m              | c2 a2 coef2 p2 |
    x_min_m               | range view visible rng | start begin min near nearest from
    x_max_m               | range view visible rng lookahead viewrange |
    curvature_rate_per_m2 | curv* crv* crvtr cvtr kappa | rate deriv* drv* change norate* dot
    curvature_per_m       | curv* crv* crvtr cvtr kappa |
    heading               | heading hding hdg head angle angl* ang slope yaw orientation c1 a1 |
    quality               | quality qual qly confidence conf prob* certainty reliability |
    colour                | colour color clr |
    solid                 | solid |
    dashed                | dashed dash |
    kind                  | type typ kind style class marktype |
    width                 | width wdth wid |
    order                 | order degree |
    measured              | measured predicted tracked |
    available             | available avail avl exist* present detected det seen found |
    offset_m              | offset offs ofst offst position pos posn c0 a0 lateral dist* dy |
    """
)
EGO = _table(
    """
    ego.yaw_rate_radps             | yaw | rate velocity speed
    ego.yaw_rate_radps             | yawrate |
    ego.yaw_rate_radps             | angular | ratez z
    ego.lateral_acceleration_mps2  | accel* acc | lateral lat y
    ego.acceleration_mps2          | accel* acc | longitudinal long lon x
    ego.steering_wheel_rad         | steering steer | angle ang
    ego.wiper                      | wiper |
    ego.low_beam                   | beam | low
    ego.high_beam                  | beam | high
    ego.indicator                  | indicator blinker turnsignal |
    ego.yaw_rad                    | yaw | vehicle veh position
    ego.speed_mps                  | speed velocity vspeed spd |
    ego.x_m                        | x | vehicle position pos
    ego.y_m                        | y | vehicle position pos
    ego.z_m                        | z | vehicle position pos
    """
)


MOTION = (
    ("ego.yaw_rate_radps", "rad/s", _words("yaw*")),
    ("ego.lateral_acceleration_mps2", "m/s^2", _words("lat*")),
    ("ego.acceleration_mps2", "m/s^2", _words("lon*")),
    ("ego.speed_mps", "m/s", _words("veh vehicle")),
)
"""Quantity, kind of unit, one of these words: makers who name neither speed nor rate give the unit."""


SOLID = _words("solid continuous")
DASHED = _words("dashed dash broken dotted")


def names_kinds(names: Iterable[str]) -> bool:
    """Return whether values are called solid and dashed."""
    told = [word for name in names for word in words_of(name)]
    return has(told, *SOLID) and has(told, *DASHED)


def first_of(rules: Rules, words: tuple[str, ...]) -> str:
    """Return the quantity of the first row that fits the words; "" if none does."""
    for what, first, second in rules:
        if has(words, *first) and (not second or has(words, *second)):
            return what
    return ""
