"""What a client may ask for, and the answer to it."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from vsensor.errors import ConfigError, VsensorError
from vsensor.faults import fault_of, overriding
from vsensor.profile import QUANTITIES
from vsensor.runner import Loop
from vsensor.types import SensorMode

Request = Mapping[str, Any]
Answer = dict[str, Any]


def answer(line: bytes, loop: Loop) -> Answer:
    """Do what a line asks for and return the answer to it; a mistake is an answer, too, never raised.

    The `id` of a request, if it has one, is that of the answer.
    """
    request: Any = None
    try:
        request = _parsed(line)
        done = {"ok": True, **_done(request, loop)}
    except VsensorError as error:
        done = {"ok": False, "error": " ".join(str(error).split())}
    if isinstance(request, Mapping) and "id" in request:
        done["id"] = request["id"]
    return done


def _parsed(line: bytes) -> Any:
    try:
        return json.loads(line, parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ConfigError(f"not JSON: {reason}") from None


def _refused(word: str) -> float:
    raise ValueError(f"{word} is no number")


def _done(request: Any, loop: Loop) -> Answer:
    if not isinstance(request, Mapping):
        raise ConfigError('a JSON object was expected, such as {"do": "state"}')
    told = {key: value for key, value in request.items() if key not in ("do", "id")}
    what = request.get("do")
    if not isinstance(what, str) or what not in REQUESTS:
        raise ConfigError(f"do = {what!r}: one of {', '.join(REQUESTS)} was expected")
    return REQUESTS[what](told, loop)


def _inject(told: Request, loop: Loop) -> Answer:
    return {"number": loop.inject(fault_of(told, loop.line.profile, "inject"))}


def _override(told: Request, loop: Loop) -> Answer:
    return {"number": loop.inject(fault_of(overriding(told), loop.line.profile, "override"))}


def _clear(told: Request, loop: Loop) -> Answer:
    _only(told, "number")
    number = told.get("number")
    if number is not None and (not isinstance(number, int) or isinstance(number, bool)):
        raise ConfigError(f"clear: number = {number!r}: the number of a fault was expected")
    loop.clear(number)
    return {}


def _read(told: Request, loop: Loop) -> Answer:
    """Return the values that were sent last, or one of them; null = not available."""
    _only(told, "quantity")
    output = loop.output
    if output is None:
        raise ConfigError("read: nothing was sent yet")
    values = {name: None if math.isnan(value) else value for name, value in output.values.items()}
    if "quantity" not in told:
        return {"tick": output.tick.index, "t_s": output.tick.t_ns / 1e9, "values": values}
    name = told["quantity"]
    if not isinstance(name, str) or name not in QUANTITIES:
        raise ConfigError(f"read: quantity = {name!r}: not known; such as left.offset_m")
    return {"tick": output.tick.index, "t_s": output.tick.t_ns / 1e9, "value": values.get(name)}


def _state(told: Request, loop: Loop) -> Answer:
    """Return how the run stands."""
    _only(told)
    summary, output, t_ns = loop.summary, loop.output, loop.index * loop.period_ns
    mode = None if output is None else SensorMode(int(output.values["sensor.state"])).name.lower()
    return {
        "tick": loop.index,
        "t_s": t_ns / 1e9,
        "sensor": mode,
        "frames_sent": summary.frames_sent,
        "slots_dropped": summary.dropped_slots,
        "faults": [
            {"number": one.number, "fault": one.fault.text(), "active": one.is_due(t_ns)}
            for one in loop.state.faults.running
        ],
    }


def _stop(told: Request, loop: Loop) -> Answer:
    _only(told)
    loop.stop()
    return {}


def _only(told: Request, *known: str) -> None:
    """Refuse what a request does not know."""
    wrong = [key for key in told if key not in known]
    if wrong:
        raise ConfigError(f"{wrong[0]}: not known here{'; known: ' + ', '.join(known) if known else ''}")


REQUESTS: Mapping[str, Callable[[Request, Loop], Answer]] = {
    "inject": _inject,
    "override": _override,
    "clear": _clear,
    "read": _read,
    "state": _state,
    "stop": _stop,
}
"""What may be asked for: takes the request without `do` and `id`, returns the answer without `ok`."""
