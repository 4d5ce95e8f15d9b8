"""Where a control socket may be: on this machine, and nowhere else."""

from dataclasses import dataclass
from pathlib import Path

from vsensor.errors import ConfigError
from vsensor.schema import user_path

LOOPBACK = "127.0.0.1"
EXPECTED = "a port of this machine (5555 or 127.0.0.1:5555) or unix:PATH was expected"


@dataclass(frozen=True, slots=True)
class Address:
    """A port of the loopback interface (0: any that is free), or the path of a Unix socket."""

    port: int = 0
    path: Path | None = None


def parse_address(text: str) -> Address:
    """Return the address that a user wrote; raises ConfigError, for other machines' addresses too."""
    if text.startswith("unix:"):
        if not text[5:]:
            raise ConfigError(f"control {text!r}: {EXPECTED}")
        return Address(path=user_path(text[5:]))
    host, _, port = text.rpartition(":")
    if host not in ("", LOOPBACK, "localhost"):
        raise ConfigError(f"control {text!r}: loopback only; {EXPECTED}")
    if not (port.isascii() and port.isdecimal() and int(port) <= 65535):
        raise ConfigError(f"control {text!r}: {EXPECTED}")
    return Address(port=int(port))
