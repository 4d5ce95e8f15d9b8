"""Clients of a control socket, and a run that answers them between two ticks."""

import contextlib
import json
import socket

from tests.faults.runs import PERIOD_NS, QUICK
from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.control import ControlServer, parse_address
from vsensor.line import build_line
from vsensor.runner import Loop


def loop():
    """Return a run at its beginning, in simulated time, whose ticks are made quickly."""
    line = build_line(load_scenario("highway", QUICK))
    return Loop(line, SimulatedClock(), period_ns=PERIOD_NS, real_time=False)


OPENED = []


def close_all():
    """Close the clients of a test."""
    while OPENED:
        OPENED.pop().close()


class Client:
    """One connection to a server; the run goes on by `server.poll` alone."""

    def __init__(self, server, run):
        self.server, self.run = server, run
        OPENED.append(self)
        if server.name.startswith("unix:"):
            self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self.socket.connect(server.name[5:])
        else:
            host, port = server.name.split(":")
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self.socket.connect((host, int(port)))
        self.socket.settimeout(5.0)
        self.rest = b""

    def send(self, data):
        self.socket.sendall(data)

    def answers(self, number=1):
        """Return so many answers, polling as often as it takes."""
        found = []
        for _ in range(2000):
            self.server.poll(self.run)
            self.socket.settimeout(0.01)
            with contextlib.suppress(TimeoutError):
                self.rest += self.socket.recv(1 << 16)
            *lines, self.rest = self.rest.split(b"\n")
            found += [json.loads(line) for line in lines]
            if len(found) >= number:
                return found
        raise AssertionError(f"{number} answers were expected, there are {found}")

    def ask(self, **request):
        """Return the answer to one request."""
        self.send(json.dumps(request).encode() + b"\n")
        (answer,) = self.answers()
        return answer

    def is_closed(self):
        """Return whether the server has hung up."""
        for _ in range(200):
            self.server.poll(self.run)
            self.socket.settimeout(0.01)
            try:
                if not self.socket.recv(1 << 16):
                    return True
            except TimeoutError:
                continue
            except OSError:
                return True
        return False

    def close(self):
        self.socket.close()


def server(text="0"):
    return ControlServer(parse_address(text))
