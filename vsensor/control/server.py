"""The socket: several clients, polled between two ticks, never waited for."""

import json
import os
import re
import socket
import stat
from collections.abc import Callable, Mapping
from pathlib import Path

from vsensor.control.address import LOOPBACK, Address
from vsensor.control.requests import answer
from vsensor.errors import ConfigError
from vsensor.runner import Loop

MOST_CLIENTS = 8
MOST_LINES = 8  # answered in one cycle, of all clients together: about a millisecond
LONGEST_LINE = 8192
RECEIVED = 4096  # read of one client in one cycle
SKIPPED = 1 << 18  # likewise, of a line that is too long: it costs no more than the reading
LONGEST_BACKLOG = 1 << 16  # answers that a client has not read; until it does, it gets no more

_WEB = re.compile(rb"[A-Z]+ \S+ HTTP/")  # a page in a browser may reach this port, too


class _Client:
    """One connection: what came in and is no whole line yet, and what is still to go out."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self.connection = connection
        self.incoming, self.outgoing = bytearray(), bytearray()
        self.is_skipping = self.has_ended = self.is_stuck = False

    def receive(self) -> None:
        """Take in what is there, a bounded part of it; waits for nothing."""
        try:
            data = self.connection.recv(SKIPPED if self.is_skipping else RECEIVED)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            data, self.incoming = b"", bytearray()
        self.has_ended = self.has_ended or not data
        self.incoming += data

    def next_line(self) -> bytes | None:
        """Return the next whole line, None if there is none; of one that is too long its beginning."""
        while True:
            line, found, rest = self.incoming.partition(b"\n")
            if not found and len(line) <= LONGEST_LINE and not self.is_skipping:
                return None
            was_skipping, self.is_skipping = self.is_skipping, not found
            self.incoming = bytearray(rest)
            if not was_skipping:
                return bytes(line[: LONGEST_LINE + 1])
            if not found:
                return None

    def say(self, said: Mapping[str, object]) -> None:
        """Let an answer wait to be sent."""
        self.outgoing += json.dumps(said, allow_nan=False).encode() + b"\n"

    def send(self) -> None:
        """Let answers go as far as the client takes them now."""
        self.is_stuck = False
        try:
            del self.outgoing[: self.connection.send(self.outgoing)]
        except (BlockingIOError, InterruptedError):
            self.is_stuck = True
        except OSError:
            self.outgoing, self.has_ended = bytearray(), True


class ControlServer:
    """Listens at an address of this machine. `poll` answers what has come in; leaving the block closes it."""

    def __init__(self, address: Address) -> None:
        """Open the socket; raises ConfigError."""
        self._path = address.path
        self._clients: list[_Client] = []
        try:
            self._socket = _unix(address.path) if address.path else _loopback(address.port)
        except OSError as error:
            where = f"unix:{address.path}" if address.path else f"{LOOPBACK}:{address.port}"
            raise ConfigError(f"control {where}: {error.strerror or error}") from None
        self._socket.setblocking(False)
        self._socket.listen(MOST_CLIENTS)
        self.name = f"unix:{address.path}" if address.path else f"{LOOPBACK}:{self._socket.getsockname()[1]}"

    def __enter__(self) -> "ControlServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def poll(self, loop: Loop) -> None:
        """Answer a bounded number of lines of what has come in; waits for nobody."""
        self._accept()
        lines = MOST_LINES
        for client in self._clients:
            if not client.outgoing and len(client.incoming) <= LONGEST_LINE:
                client.receive()
        while lines > 0:
            asked = [client for client in self._clients if self._answer_one(client, loop)]
            lines -= len(asked)
            if not asked:
                break
        for client in self._clients:
            if client.outgoing:
                client.send()
        for client in [client for client in self._clients if _is_over(client)]:
            client.connection.close()
            self._clients.remove(client)
        self._refuse()

    def close(self) -> None:
        """Close all; a Unix socket's file goes. Closing twice does no harm."""
        for client in self._clients:
            client.connection.close()
        self._clients = []
        if self._socket.fileno() >= 0:
            self._socket.close()
            if self._path is not None:
                self._path.unlink(missing_ok=True)

    def _accept(self) -> None:
        """Take the clients that wait, as far as there is room for them."""
        while len(self._clients) < MOST_CLIENTS:
            client = self._next_client()
            if client is None:
                return
            self._clients.append(client)

    def _refuse(self) -> None:
        """Tell those who still wait that there is no room, and hang up: they would wait without a word."""
        while len(self._clients) >= MOST_CLIENTS:
            client = self._next_client()
            if client is None:
                return
            client.receive()  # a connection closed with something unread loses what was said
            client.say({"ok": False, "error": f"{MOST_CLIENTS} clients are connected, there is no room"})
            client.send()
            client.connection.close()

    def _next_client(self) -> _Client | None:
        try:
            return _Client(self._socket.accept()[0])
        except OSError:  # nobody (the socket does not block), or gone again
            return None

    def _answer_one(self, client: _Client, loop: Loop) -> bool:
        line = None if len(client.outgoing) > LONGEST_BACKLOG else client.next_line()
        if line is None:
            return False
        if len(line) > LONGEST_LINE:
            said: dict[str, object] = {"ok": False, "error": f"a line longer than {LONGEST_LINE} bytes"}
        elif _WEB.match(line):
            said = {"ok": False, "error": "this is no web server; one JSON object a line was expected"}
            client.incoming, client.has_ended = bytearray(), True
        elif not line.strip():
            return True
        else:
            said = answer(line, loop)
        client.say(said)
        return True


def _is_over(client: _Client) -> bool:
    """Return whether a client has gone, and all is answered that it can still take."""
    if not client.has_ended:
        return False
    return client.is_stuck or (not client.outgoing and b"\n" not in client.incoming)


def _loopback(port: int) -> socket.socket:
    opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    return _bound(opened, lambda: opened.bind((LOOPBACK, port)), reuse=True)


def _unix(path: Path) -> socket.socket:
    """Bind a path that its owner alone may use; one left over from a run that crashed is taken over."""
    opened = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    if path.exists() and stat.S_ISSOCK(path.stat().st_mode) and not _answers(path):
        path.unlink()

    def bind() -> None:
        mask = os.umask(0o177)
        try:
            opened.bind(str(path))
        finally:
            os.umask(mask)

    return _bound(opened, bind)


def _bound(opened: socket.socket, bind: Callable[[], None], *, reuse: bool = False) -> socket.socket:
    try:
        if reuse:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bind()
    except OSError:
        opened.close()
        raise
    return opened


def _answers(path: Path) -> bool:
    """Return whether somebody listens at a Unix socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True
