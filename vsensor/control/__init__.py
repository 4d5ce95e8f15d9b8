"""A running sensor told what to do from outside, over a local socket: JSON lines, one answer each.

client --line--> ControlServer --request--> answer(request, loop) --line--> client
                 polled between two ticks
"""

from vsensor.control.address import Address, parse_address
from vsensor.control.requests import answer
from vsensor.control.server import ControlServer

__all__ = ["Address", "ControlServer", "answer", "parse_address"]
