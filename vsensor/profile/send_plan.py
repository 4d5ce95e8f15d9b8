"""The words of profile and database about sending, compiled into a SendPlan."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from vsensor.codec import Layout, SignalLayout
from vsensor.errors import ConfigError
from vsensor.profile.bind import hint
from vsensor.profile.binding import Binding
from vsensor.profile.config import MessageConfig, ProfileConfig
from vsensor.profile.quantities import QUANTITIES
from vsensor.profile.sending import Condition, GroupConfig, SendConfig, SendPlan

_NS_PER_MS = 1_000_000


@dataclass(frozen=True, slots=True)
class Trigger:
    """What a send type's word says, whoever's word it is."""

    cyclic: bool = False
    on_change: bool = False
    on_write: bool = False
    if_active: bool = False
    repeated: bool = False


_TOKENS: tuple[tuple[str, str], ...] = (
    ("if_active", "ifactive|ifenabled|enabled"),
    ("repeated", "withrepetitions?|repetitions?"),
    ("cyclic", "cyclical|cyclic|cycle|periodic|fixed"),
    ("on_write", "onwrite|write"),
    ("on_change", "onchange|onevent|event|spontaneous|spontan|triggered|trigger|sporadic|direct|change"),
    ("", "and|or|with|only|fast|delay|wd|x"),
)
_TOKEN = re.compile("|".join(f"({words})" for _, words in _TOKENS))
_SHORT = {"ce": "cyclicevent", "ca": "cyclicifactive", "mixed": "cyclicevent"}
_NOTHING = re.compile("no[a-z]*sendtype|none|notused|notdefined|reserved|undefined|vectorleerstring|")


_TYPES: Mapping[str, Trigger] = {
    "cyclic": Trigger(cyclic=True),
    "on_change": Trigger(on_change=True),
    "cyclic_and_on_change": Trigger(cyclic=True, on_change=True),
    "on_write": Trigger(on_write=True),
    "if_active": Trigger(if_active=True),
}


def trigger_of(word: str) -> Trigger | None:
    """Return what a maker's word for a send type means; None for a word that says nothing we know.

    CyclicAndSpontanX, OnChangeWithRepetition, EventPeriodic, cyclicIfActive, CE ...; NoMsgSendType and
    its likes are no trigger at all. What is cyclic if active is not cyclic otherwise.
    """
    plain = re.sub("[^a-z]", "", word.lower())
    plain = _SHORT.get(plain, plain)
    if _NOTHING.fullmatch(plain):
        return Trigger()
    found, place = set(), 0
    while match := _TOKEN.match(plain, place):
        found.add(_TOKENS[(match.lastindex or 1) - 1][0])
        place = match.end()
    if place < len(plain) or not found - {"", "repeated"}:
        return None
    found -= {"cyclic"} if "if_active" in found else {""}
    return Trigger(**{name: True for name in found if name})


def message_plan(
    path: Path, profile: ProfileConfig, layout: Layout, config: MessageConfig, bindings: Sequence[Binding]
) -> SendPlan:
    """Return when a message of a profile is sent; raises ConfigError naming file, message and key.

    A message with a `cycle_ms` of its own and no `send` is cyclic, whatever the database says; so is all
    that is only listened to.
    """
    where = f"{path}: {layout.name}"
    send, cycle_ms = config.send or SendConfig(), config.cycle_ms
    if cycle_ms is not None and send.cycle_ms is not None:
        raise ConfigError(f"{where}: cycle_ms stands twice, in the message and in its send")
    if cycle_ms is not None:
        send = msgspec.structs.replace(send, cycle_ms=cycle_ms)
    if profile.role != "sensor" or (cycle_ms is not None and config.send is None):
        send = msgspec.structs.replace(send, type="cyclic")
    phases = group_phases(profile.groups, profile.messages, str(path))
    plan = send_plan(
        layout,
        send,
        [s.name for b in bindings if not b.wrap for s in b.signals],
        where,
        phase_ms=phases.get(layout.name, 0.0),
        start_delay_ms=config.start_delay_ms,
    )
    if profile.role == "sensor" and not plan.cycle_ns and not plan.is_event:
        raise ConfigError(f"{where}: no cycle time in the database; give cycle_ms")
    return plan


def send_plan(
    layout: Layout,
    config: SendConfig,
    carried: Sequence[str],
    where: str,
    *,
    phase_ms: float = 0.0,
    start_delay_ms: float | None = None,
) -> SendPlan:
    """Return when a message is sent; raises ConfigError for what does not fit together.

    `carried` are the signals whose change counts where nobody names them; `phase_ms` is that of the
    message's group; `start_delay_ms` the message's own key.
    """
    stated = layout.sending
    said, signals, findings = _said(layout, config)
    watched = _watched(layout, config, said, signals, carried, where)
    on_change = said.on_change or bool(watched)
    on_write = said.on_write or any(trigger.on_write for trigger in signals.values())
    active = _active(layout, config, said, signals, where)
    cycle = _first(config.cycle_ms, stated.cycle_ms)
    fast = _first(config.fast_cycle_ms, stated.fast_cycle_ms, cycle) if active else 0.0
    if active and not fast:
        raise ConfigError(f"{where}: send.active: no fast cycle in the database; give fast_cycle_ms")
    if said.if_active and not active:
        findings += (f"{layout.name}: sent while active, but nothing says when that is: sent always",)
    elif not said.cyclic and (said.on_change or said.on_write or said.if_active):
        cycle = 0.0
    is_event = on_change or on_write or bool(active)
    delay = _first(config.min_delay_ms, stated.min_delay_ms if is_event else 0.0)
    repeated = said.repeated or any(trigger.repeated for trigger in signals.values())
    repetitions = _first(config.repetitions, stated.repetitions if repeated and is_event else 0)
    gap = _first(config.repetition_ms, stated.fast_cycle_ms or fast or delay or cycle)
    if repetitions and not gap:
        raise ConfigError(f"{where}: send.repetitions: give repetition_ms, the time between them")
    return SendPlan(
        cycle_ns=_ns(cycle),
        offset_ns=_ns(_first(start_delay_ms, stated.start_delay_ms) + _first(config.phase_ms, phase_ms)),
        fast_cycle_ns=_ns(fast),
        on_change=on_change,
        watched=watched,
        on_write=on_write,
        active=active,
        repetitions=int(repetitions),
        repetition_ns=_ns(gap) if repetitions else 0,
        min_delay_ns=_ns(delay),
        findings=findings,
    )


def group_phases(groups: Mapping[str, GroupConfig], messages: Iterable[str], where: str) -> dict[str, float]:
    """Return the phase of each message that is in a group; raises ConfigError for one in two or in none."""
    phases: dict[str, float] = {}
    known = set(messages)
    for name, group in groups.items():
        for message in group.messages:
            if message not in known:
                raise ConfigError(
                    f"{where}: groups.{name}: {message} is no message of this profile{hint(message, known)}"
                )
            if message in phases:
                raise ConfigError(f"{where}: groups.{name}: {message} is in another group, too")
            phases[message] = group.phase_ms
    return phases


def _said(layout: Layout, config: SendConfig) -> tuple[Trigger, Mapping[str, Trigger], tuple[str, ...]]:
    """Return the message's trigger, those of signals that have one, and what was not understood."""
    if config.type is not None:
        return _TYPES[config.type], {}, ()
    stated = layout.sending
    findings: list[str] = []
    message = _known(stated.send_type, layout.name, findings)
    signals = {
        name: _known(word, f"{layout.name}.{name}", findings) for name, word in stated.signal_types.items()
    }
    return message, {name: said for name, said in signals.items() if said != Trigger()}, tuple(findings)


def _known(word: str, name: str, findings: list[str]) -> Trigger:
    trigger = trigger_of(word)
    if trigger is None:
        findings.append(f"{name}: send type {word!r} is not known and counts as cyclic")
        return Trigger(cyclic=True)
    return trigger


def _watched(
    layout: Layout,
    config: SendConfig,
    said: Trigger,
    signals: Mapping[str, Trigger],
    carried: Sequence[str],
    where: str,
) -> tuple[str, ...]:
    if config.watch is not None:
        for name in config.watch:
            if name not in layout.signals:
                raise ConfigError(f"{where}: send.watch: {name} is no signal{hint(name, layout.signals)}")
        return config.watch
    named = tuple(name for name, trigger in signals.items() if trigger.on_change)
    return named or (tuple(carried) if said.on_change else ())


def _active(
    layout: Layout, config: SendConfig, said: Trigger, signals: Mapping[str, Trigger], where: str
) -> tuple[Condition, ...]:
    if config.active is not None:
        return (_condition(layout, config.active, where),)
    if config.fast_cycle_ms is not None or config.type == "if_active":
        raise ConfigError(f'{where}: send.active: "QUANTITY OPERATOR NUMBER" was expected')
    named = [layout.signals[name] for name, trigger in signals.items() if trigger.if_active]
    if not layout.sending.fast_cycle_ms and not layout.sending.cycle_ms and config.cycle_ms is None:
        return ()
    return tuple(_while_active(signal, layout.sending.inactive.get(signal.name, 0)) for signal in named)


def _while_active(signal: SignalLayout, inactive_raw: int) -> Condition:
    return Condition(subject=signal.name, is_signal=True, word="!=", bound=signal.physical(inactive_raw))


_CONDITION = re.compile(r"\s*([A-Za-z_][\w.]*)\s*(==|!=|>=|<=|>|<)\s*(\S+)\s*")


def _condition(layout: Layout, text: str, where: str) -> Condition:
    match = _CONDITION.fullmatch(text)
    bound = _number(match[3]) if match else math.nan
    if match is None or not math.isfinite(bound):
        raise ConfigError(f'{where}: send.active = "{text}": "NAME OPERATOR NUMBER" was expected')
    name, is_signal = match[1], match[1] in layout.signals
    if not is_signal and name not in QUANTITIES:
        near = hint(name, [*QUANTITIES, *layout.signals])
        raise ConfigError(f"{where}: send.active: {name} is neither a quantity nor a signal here{near}")
    return Condition(subject=name, is_signal=is_signal, word=match[2], bound=bound)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _first(*values: float | None) -> float:
    """Return the first value that is given, and not 0 unless it is the last."""
    given = [value for value in values if value is not None]
    return given[0] if values[0] is not None else next((value for value in given if value), 0.0)


def _ns(millis: float) -> int:
    return round(millis * _NS_PER_MS)
