"""Where output goes besides the bus: CAN log, trace, live table."""

from typing import Protocol

from vsensor.types import Output


class Sink(Protocol):
    """Takes every tick's output after its frames were sent."""

    def write(self, output: Output) -> None:
        """Take one tick; must not block, since it runs inside the cycle."""
        ...

    def close(self) -> None:
        """Write what is left; called once, also after Ctrl-C."""
        ...


__all__ = ["Sink"]
