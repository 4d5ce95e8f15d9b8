"""The page's server: on this machine alone, for requests of this machine's browsers alone."""

import logging
import math
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from vsensor.errors import ConfigError

HOST = "127.0.0.1"
PORT = 8765
TRIED = 10
"""Ports that are tried from PORT on, where none is asked for."""
LISTEN_S = 0.2


class PageServer:
    """Serves an application of Dash in threads of its own while the block runs; `url` is where."""

    def __init__(self, app: Any, port: int | None = None) -> None:
        """Take the port, or without one the first from PORT on that is free; raises ConfigError."""
        logging.getLogger("werkzeug").setLevel(logging.ERROR)  # a line a request is of no use
        self._server = _bound(app.server, port)
        self.port: int = self._server.server_port
        self.url = f"http://{HOST}:{self.port}/"
        _guard(app.server, self.port)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self) -> "PageServer":
        """Begin to serve."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def show(self) -> None:
        """Open the page in the user's browser, where there is one."""
        import webbrowser

        webbrowser.open(self.url)

    def wait(self, stopped: Callable[[], bool], duration_s: float | None = None) -> None:
        """Serve until somebody says stop, or `duration_s` is over."""
        end_s = math.inf if duration_s is None else time.monotonic() + duration_s
        while not stopped() and time.monotonic() < end_s:
            time.sleep(LISTEN_S)


def _bound(application: Any, port: int | None) -> Any:
    from werkzeug.serving import make_server

    asked = range(PORT, PORT + TRIED) if port is None else (port,)
    for one in asked:
        if one and _is_taken(one):
            continue
        return make_server(HOST, one, application, threaded=True)
    if port is None:
        raise ConfigError(f"ports {PORT} to {PORT + TRIED - 1} are all in use; give another one with --port")
    raise ConfigError(f"port {port} of {HOST} is in use or not allowed; give another one with --port")


def _is_taken(port: int) -> bool:
    """Return whether a port cannot be had: werkzeug ends the program where it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError:
            return True
    return False


def _guard(server: Any, port: int) -> None:
    """Refuse requests that another host's page has a browser send here, and any from elsewhere."""
    from flask import Response, request

    hosts = {f"{name}:{port}" for name in (HOST, "localhost")}
    origins = {f"http://{host}" for host in hosts}

    @server.before_request  # type: ignore[untyped-decorator]
    def local_only() -> Any:
        origin = request.headers.get("Origin")
        if request.host not in hosts or (origin is not None and origin not in origins):
            return Response("only pages of this machine are served\n", status=403, mimetype="text/plain")
        if ".." in request.path.split("/"):
            return Response("no such page\n", status=404, mimetype="text/plain")
        return None

    @server.after_request  # type: ignore[untyped-decorator]
    def nothing_from_outside(response: Any) -> Any:
        response.headers["Content-Security-Policy"] = (
            "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:; frame-ancestors 'none'"
        )
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response
