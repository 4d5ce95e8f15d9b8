"""What a database says about when its messages are sent: its GenMsg and GenSig attributes, in its words."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class SendAttributes:
    """The sending attributes of one message; times in milliseconds, 0 = not given.

    `send_type` is the maker's word ("" = not given). `signal_types` holds the words of those signals that
    have one, `inactive` the raw value at which a signal counts as inactive. A default of the database
    counts as said of every message and signal.
    """

    send_type: str = ""
    cycle_ms: float = 0.0
    fast_cycle_ms: float = 0.0
    start_delay_ms: float = 0.0
    min_delay_ms: float = 0.0
    repetitions: int = 0
    signal_types: Mapping[str, str] = field(default_factory=dict[str, str])
    inactive: Mapping[str, int] = field(default_factory=dict[str, int])


def send_attributes(message: Any) -> SendAttributes:
    """Return the sending attributes of a cantools message; of a format without attributes the cycle time."""
    types = {s.name: _word(message, s, "GenSigSendType") for s in message.signals}
    inactive = {s.name: _number(message, s, "GenSigInactiveValue") for s in message.signals}
    return SendAttributes(
        send_type=str(message.send_type or ""),
        cycle_ms=float(message.cycle_time or 0),
        fast_cycle_ms=_number(message, message, "GenMsgCycleTimeFast"),
        start_delay_ms=_number(message, message, "GenMsgStartDelayTime"),
        min_delay_ms=_number(message, message, "GenMsgDelayTime"),
        repetitions=int(_number(message, message, "GenMsgNrOfRepetition")),
        signal_types={name: word for name, word in types.items() if word},
        inactive={name: int(raw) for name, raw in inactive.items() if raw},
    )


def _number(message: Any, item: Any, name: str) -> float:
    value = _value(message, item, name)
    return max(float(value), 0.0) if isinstance(value, int | float) else 0.0


def _word(message: Any, item: Any, name: str) -> str:
    """Return an enumeration's word: cantools gives its number where a value is set, its word as default."""
    value = _value(message, item, name)
    choices = getattr(_definitions(message).get(name), "choices", None) or ()
    if isinstance(value, int) and 0 <= value < len(choices):
        return str(choices[value])
    return str(value) if isinstance(value, str) else ""


def _value(message: Any, item: Any, name: str) -> Any:
    attributes = getattr(item.dbc, "attributes", None) or {}
    if name in attributes:
        return attributes[name].value
    return getattr(_definitions(message).get(name), "default_value", None)


def _definitions(message: Any) -> Mapping[str, Any]:
    return getattr(message.dbc, "attribute_definitions", None) or {}
