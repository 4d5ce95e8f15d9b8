"""The exception tree of errors of use: each message says what, where, and what was expected.

What a real sensor meets on the road (no line, glare, a stale ego) is no exception; see `quality`.
"""


class VsensorError(Exception):
    """Root of every error that a user can mend; the command line prints it as one line, exit 2."""


class ConfigError(VsensorError):
    """A scenario, profile, camera or model file is wrong: names the file, the key, the expectation."""


class MapError(VsensorError):
    """A road map is broken: names the file, the element and its line."""


class StoryError(VsensorError):
    """An OpenSCENARIO file cannot be played: names the file, the element and its line."""


class LogError(VsensorError):
    """A CAN log cannot be used: names the file, the place and the reason."""


class TableError(VsensorError):
    """A table of recorded drives cannot be used or written: names the file and the reason."""


class VideoError(VsensorError):
    """A video or image cannot be used: names the file, the picture and the reason."""


class DbcError(VsensorError):
    """A bus description cannot be used: names the file, the message, the signal."""


class BusError(VsensorError):
    """A bus cannot be opened or used: names interface and channel."""


class SessionError(VsensorError):
    """A session was asked for what it cannot do (any more): says what, and what was expected."""


class MissingExtraError(VsensorError):
    """An optional library is absent: names the pip command that brings it."""

    def __init__(self, library: str, extra: str, purpose: str) -> None:
        super().__init__(f"{purpose} needs {library}, which is not installed: pip install 'vsensor[{extra}]'")
