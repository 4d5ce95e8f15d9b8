"""A running car's or bench's frames from one bus to another, the camera's replaced by the sensor's."""

from vsensor.gateway.loop import Gateway, Ways
from vsensor.gateway.session import GatewayOptions, run_gateway

__all__ = ["Gateway", "GatewayOptions", "Ways", "run_gateway"]
