"""From a lane estimate to signal values: what is sent, in model signs, then as the bus describes it.

y left          inner edge          front axle x = wheelbase
  |  ======================================  left line, width w
  |  --- lane offset: centreline to inner edge, along y, at the front axle
  +-----o-----------------------------> x    o rear axle
"""

from vsensor.profile import QUANTITIES
from vsensor.signals.describe import columns_from_bus, from_bus, origin_x_m, to_bus
from vsensor.signals.lane import lane_offset_m
from vsensor.signals.values import values_from
from vsensor.signals.vehicle import VehicleConfig

__all__ = [
    "QUANTITIES",
    "VehicleConfig",
    "columns_from_bus",
    "from_bus",
    "lane_offset_m",
    "origin_x_m",
    "to_bus",
    "values_from",
]
