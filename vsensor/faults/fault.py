"""A fault compiled for a profile: which messages, which bits, from when for how long."""

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vsensor.codec import SignalLayout, float_bits, quantise
from vsensor.e2e import Field
from vsensor.errors import ConfigError
from vsensor.faults.config import FaultConfig
from vsensor.faults.kinds import KINDS, Kind
from vsensor.profile import MessagePlan, Profile
from vsensor.schema import convert
from vsensor.types import NANOSECONDS_PER_SECOND, SIDE_NAMES, Side

_TARGETS = ("message", "signal", "quantity", "line")


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A signal's bits in the pages of its message that carry it, and what they hold: `raw`.

    None: what they hold in the first frame after the fault began.
    """

    pages: frozenset[int]
    field: Field
    raw: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault ready to be injected. `config` is what was asked for.

    `messages`: the places in the profile of the messages that it acts on. `checksums`: (message, page) ->
    where a checksum lies that `crc_wrong` spoils. `from_ns` None = at once.
    """

    config: FaultConfig
    sides: frozenset[Side] = frozenset()
    messages: frozenset[int] = frozenset()
    patch: Patch | None = None
    checksums: Mapping[tuple[int, int], Field] | None = None
    from_ns: int | None = None
    for_ns: int | None = None
    times: int | None = None

    @property
    def kind(self) -> Kind:
        """What kind of fault it is."""
        return KINDS[self.config.kind]

    def text(self) -> str:
        """Return it as a person says it, such as `frame_lost LDS_Lane from 3 s, 2 times`."""
        config = self.config
        words = [config.kind]
        words += [str(name) for key in _TARGETS if (name := getattr(config, key)) is not None]
        words += [
            f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
            for key in (*self.kind.needs, *self.kind.takes)
            if key not in _TARGETS and (value := getattr(config, key)) is not None
        ]
        if config.at_s is not None:
            words.append(f"from {config.at_s:g} s")
        if config.for_s is not None:
            words.append(f"for {config.for_s:g} s")
        elif config.times is not None:
            words.append(f"{config.times} {'times' if config.times > 1 else 'time'}")
        elif not _is_once(config, self.kind):
            words.append("until it is cleared")
        return " ".join(words)


def fault_of(told: FaultConfig | Mapping[str, Any], profile: Profile, where: str = "fault") -> Fault:
    """Compile a fault for a profile; raises ConfigError, one line that begins with `where`."""
    config = told if isinstance(told, FaultConfig) else convert(told, FaultConfig, where)
    try:
        return _compiled(config, profile)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def overriding(told: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of the fault that sends a `value` or `raw` of a `quantity` or `signal` instead."""
    if "signal" in told:
        return {"kind": "signal_raw" if "raw" in told else "signal_value", **told}
    return {"kind": "override", **told}


def faults_of(told: Iterable[FaultConfig], profile: Profile) -> tuple[Fault, ...]:
    """Compile the `[[fault]]` tables of a scenario; raises ConfigError naming the table's number."""
    return tuple(fault_of(config, profile, f"fault[{number}]") for number, config in enumerate(told))


def _compiled(config: FaultConfig, profile: Profile) -> Fault:
    kind = _kind(config)
    messages, patch, checksums = frozenset[int](), None, None
    if kind.stage == "signal":
        place, patch = _patch(config, profile)
        messages = frozenset({place})
    elif kind.stage in ("counter", "frame"):
        checksums = _checksums(profile) if config.kind == "crc_wrong" else None
        messages = _messages(config, kind, profile, checksums)
    elif kind.stage == "value":
        _require_known("quantity", str(config.quantity), sorted(profile.quantities()), profile)
    return Fault(
        config=config,
        sides=frozenset(side for side, name in SIDE_NAMES.items() if config.line in (None, name)),
        messages=messages,
        patch=patch,
        checksums=checksums,
        from_ns=_ns(config.at_s),
        for_ns=_ns(config.for_s),
        times=1 if _is_once(config, kind) else config.times,
    )


def _is_once(config: FaultConfig, kind: Kind) -> bool:
    """Return whether it happens at one image, or to one frame of each message, and is over."""
    return not kind.lasts or (config.kind == "reset" and config.for_s is None)


def _ns(seconds: float | None) -> int | None:
    return None if seconds is None else round(seconds * NANOSECONDS_PER_SECOND)


def _kind(config: FaultConfig) -> Kind:
    """Return the kind, and refuse keys that it does not know, or that are missing."""
    if config.kind not in KINDS:
        raise ConfigError(f"kind = {config.kind!r}: not known; {_hint(config.kind, KINDS)}")
    kind = KINDS[config.kind]
    known = {"kind", "at_s", *kind.needs, *kind.takes, *kind.lasts}
    given = [key for key in FaultConfig.__struct_fields__ if getattr(config, key) is not None]
    wrong = [key for key in given if key not in known]
    if wrong:
        takes = ", ".join([*kind.needs, *kind.takes, "at_s", *kind.lasts])
        raise ConfigError(f"{wrong[0]}: {config.kind} does not take it; it takes {takes}")
    missing = [key for key in kind.needs if key not in given]
    if missing:
        raise ConfigError(f"{missing[0]}: {config.kind} needs it")
    if config.for_s is not None and config.times is not None:
        raise ConfigError("for_s and times: one of them ends a fault, not both")
    return kind


def _hint(wrong: str, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known: {', '.join(names)}"


def _require_known(key: str, name: str, known: Sequence[str], profile: Profile) -> None:
    if name not in known:
        raise ConfigError(f"{key} = {name!r}: not in profile {profile.name}; {_hint(name, known)}")


def _messages(
    config: FaultConfig, kind: Kind, profile: Profile, checksums: Mapping[tuple[int, int], Field] | None
) -> frozenset[int]:
    """Return the places of the messages that a fault acts on: the one it names, or all that can have it."""
    wanted = range(len(profile.messages)) if config.message is None else _place(config.message, profile)
    able, need = frozenset(wanted), "messages"
    if kind.stage == "counter":
        able = frozenset(place for place in wanted if _counts(profile.messages[place], config))
        need = "an alive counter" + (f" that {config.by} steps change" if config.by is not None else "")
    elif checksums is not None:
        able, need = able & {place for place, _ in checksums}, "a checksum"
    elif config.kind == "frame_truncated":
        length = config.length or 0
        able = frozenset(place for place in wanted if _bytes(profile.messages[place]) > length)
        need = f"more than {length} bytes"
    if not able:
        where = f"profile {profile.name}" if config.message is None else f"message = {config.message!r}"
        raise ConfigError(f"{where}: {config.kind} needs {need}")
    return able


def _place(name: str, profile: Profile) -> range:
    names = [plan.layout.name for plan in profile.messages]
    _require_known("message", name, names, profile)
    return range(names.index(name), names.index(name) + 1)


def _bytes(plan: MessagePlan) -> int:
    return plan.layout.length + len(plan.padding)


def _counts(plan: MessagePlan, config: FaultConfig) -> bool:
    """Return whether the message has an alive counter, and `by` steps change it."""
    guard = plan.guard
    if guard is None or guard.counter_field is None:
        return False
    return config.by is None or config.by % guard.counter_states != 0


def _checksums(profile: Profile) -> Mapping[tuple[int, int], Field]:
    """Return where the checksum of each frame lies: its own, else that of a burst that it carries."""
    places = {plan.layout.name: place for place, plan in enumerate(profile.messages)}
    found: dict[tuple[int, int], Field] = {}
    for burst in profile.bursts:
        if burst.seal is not None:
            name, page = burst.seal.carrier
            found[places[name], page] = _field(profile.messages[places[name]], burst.seal.signal)
    for place, plan in enumerate(profile.messages):
        if plan.guard is not None and plan.guard.checksum_field is not None:
            found |= {(place, page): plan.guard.checksum_field for page in range(len(plan.pages))}
    return found


def _field(plan: MessagePlan, signal: SignalLayout) -> Field:
    return Field(plan.layout.low_bit(signal), signal.length, signal.big_endian)


def _patch(config: FaultConfig, profile: Profile) -> tuple[int, Patch]:
    """Return the message's place and the bits of the signal that a fault names."""
    place, signal = _signal(config, profile)
    plan = profile.messages[place]
    where, field = f"{plan.layout.name}.{signal.name}", _field(plan, signal)
    written = [plan.guard.checksum_field, plan.guard.counter_field] if plan.guard is not None else []
    if field in written:
        raise ConfigError(f"signal = {where}: protects the frame: crc_wrong and counter_... are for it")
    constants = [{**plan.constants, **page} for page in plan.pages]
    pages = frozenset(n for n, raws in enumerate(constants) if plan.layout.is_present(signal, raws))
    if not pages:
        raise ConfigError(f"signal = {where}: is in no frame that is sent")
    return place, Patch(pages=pages, field=field, raw=_raw(config, signal, where))


def _signal(config: FaultConfig, profile: Profile) -> tuple[int, SignalLayout]:
    name = str(config.signal)
    message, _, rest = name.rpartition(".")
    if message and config.message not in (None, message):
        raise ConfigError(f"signal = {name!r}: is not of message {config.message}")
    message = message or config.message or ""
    places = _place(message, profile) if message else range(len(profile.messages))
    found = [(k, s) for k in places for s in [profile.messages[k].layout.signals.get(rest)] if s is not None]
    if not found:
        known = sorted({signal for place in places for signal in profile.messages[place].layout.signals})
        _require_known("signal", rest, known, profile)
    if len(found) > 1:
        names = " and ".join(profile.messages[place].layout.name for place, _ in found[:2])
        raise ConfigError(f"signal = {name!r}: is in {names}; say which, as MESSAGE.{rest}")
    return found[0]


def _raw(config: FaultConfig, signal: SignalLayout, where: str) -> int | None:
    """Return the raw bits that the signal holds; None: those that it had."""
    mask = (1 << signal.length) - 1
    if config.kind == "signal_stuck":
        return None
    if config.kind == "signal_sna":
        if signal.sna_raw is None:
            raise ConfigError(f"signal = {where}: has no value for 'not available'")
        return signal.sna_raw & mask
    if config.kind == "signal_value":
        value = float(config.value or 0.0)
        return (float_bits(signal, value) if signal.is_float else quantise(signal, value))[0] & mask
    raw = int(config.raw or 0)
    if not signal.raw_min <= raw <= signal.raw_max:
        raise ConfigError(f"raw = {raw}: {where} holds {signal.raw_min} to {signal.raw_max}")
    return raw & mask
