"""What there is to know of a profile before anything is sent, and what an ECU would stumble over."""

from collections.abc import Iterator

from vsensor.check.busload import BusSpeed, frames_per_s, load
from vsensor.check.marks import open_marks
from vsensor.codec import (
    SignalLayout,
    excess_range,
    is_placeholder,
    load_database,
    overlaps,
    shared_ids,
    wrong_raws,
)
from vsensor.errors import VsensorError
from vsensor.profile import LINES, QUANTITIES, Binding, MessagePlan, Profile, quantisation_error_m
from vsensor.signals import VehicleConfig
from vsensor.transmit import Transmitter, refused_range
from vsensor.types import SIDE_NAMES

_ANY_CAMERA_X_M = 1.9


def profile_findings(profile: Profile, speed: BusSpeed) -> list[str]:
    """Return what has to be mended or answered before an ECU is fed with this profile."""
    found = [*open_marks(profile.path), *_database_findings(profile)]
    found += [text for plan in profile.messages for text in plan.sending.findings]
    if profile.role == "sensor":
        found += _not_sendable(profile)
        worst = load(profile.messages, speed, stuffed=True)
        if worst > 1.0:
            fd = any(plan.layout.is_fd for plan in profile.messages)
            found.append(f"{100 * worst:.0f} % of a bus of {speed.text(fd)}: the frames do not fit")
    return found


def _database_findings(profile: Profile) -> Iterator[str]:
    """Yield what is wrong in the database with the messages of the profile; what it means is theirs."""
    for plan in profile.messages:
        layout = plan.layout
        yield from (f"{layout.name}: signals {a} and {b} overlap" for a, b in overlaps(layout))
        for signal in layout.signals.values():
            yield from (f"{layout.name}.{signal.name}: {text}" for text in wrong_raws(signal))
    used = {plan.layout.name for plan in profile.messages}
    for pair in shared_ids(load_database(profile.database).layouts.values()):
        if not used.isdisjoint(pair):
            yield f"{pair[0]} and {pair[1]} have the same id: a receiver cannot tell them apart"


def _not_sendable(profile: Profile) -> list[str]:
    """Return why a run would refuse the profile, if it would."""
    try:
        Transmitter(profile, VehicleConfig(), _ANY_CAMERA_X_M)
    except VsensorError as error:
        return [f"cannot be sent: {error}"]
    return []


def profile_lines(profile: Profile, speed: BusSpeed) -> list[str]:
    """Return what the profile does: messages, what is not mapped, rounding, load of the bus."""
    lines = [f"profile {profile.name} ({profile.path}), role {profile.role}, database {profile.database}"]
    lines += [_message_line(plan) for plan in profile.messages]
    lines += _unnamed(profile)
    lines += _ranges(profile)
    if profile.role == "sensor":
        lines += _without_sna(profile)
        lines += _rounding(profile)
        lines += _load_lines(profile, speed)
    return lines


def _message_line(plan: MessagePlan) -> str:
    layout = plan.layout
    guard = "" if plan.guard is None else f", E2E {plan.guard.label}"
    fd = " CAN FD" if layout.is_fd else ""
    return (
        f"  0x{layout.arbitration_id:03X} {layout.name:<24} {layout.length} bytes{fd} {_rhythm(plan)}"
        f", {len(plan.bindings)} quantities{guard}"
    )


def _rhythm(plan: MessagePlan) -> str:
    """Return when a message leaves, as a person says it."""
    sending = plan.sending
    if not sending.times_ns and not sending.is_event:
        return "whenever it comes"
    words = [f"every {sending.cycle_ns / 1e6:g} ms"] if sending.cycle_ns or not sending.is_event else []
    words += ["at every image"] * sending.on_write + ["on change"] * sending.on_change
    words += [f"every {sending.fast_cycle_ns / 1e6:g} ms while active"] if sending.active else []
    said_ms = plan.layout.cycle_ms
    differs = said_ms and sending.cycle_ns and said_ms * 1e6 != sending.cycle_ns
    return " and ".join(words) + f" (database: {said_ms} ms)" * bool(differs)


def _unnamed(profile: Profile) -> list[str]:
    """Say of which signals the profile has no word, and what goes out there."""
    seals = {(b.seal.carrier[0], b.seal.signal.name) for b in profile.bursts if b.seal is not None}
    shown = [
        f"{plan.layout.name}.{name}{_started(plan.layout.signals[name])}"
        for plan in profile.messages
        for name in plan.unnamed
        if (plan.layout.name, name) not in seals
    ]
    what = "sent as their start value" if profile.role == "sensor" else "not read"
    return [f"  {len(shown)} signals are not mapped, {what}: {', '.join(shown)}"] if shown else []


def _started(signal: SignalLayout) -> str:
    if signal.is_float:
        return ""
    name = signal.choices.get(int(signal.start_raw))
    unit = f" {signal.unit}" if signal.unit else ""
    return f" ({name})" if name else f" ({signal.physical(signal.start_raw):g}{unit})"


def _ranges(profile: Profile) -> list[str]:
    """Say which declared ranges mean nothing; one that a run would refuse is a finding instead."""
    signals = [(plan.layout.name, s) for plan in profile.messages for s in plan.layout.signals.values()]
    empty = [f"{message}.{s.name}" for message, s in signals if is_placeholder(s)]
    wide = [
        f"{plan.layout.name}.{s.name}: {text}"
        for plan in profile.messages
        for binding in plan.bindings
        for s in binding.signals
        if (text := excess_range(s)) and not refused_range(profile, s)
    ]
    told = [f"  {len(empty)} ranges are placeholders, which do not clip: {_some(empty)}"] if empty else []
    return [*told, *(f"  {text}; it saturates at the bits" for text in wide)]


def _some(names: list[str], most: int = 6) -> str:
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def _needs_line(quantity: str) -> bool:
    """Return whether a quantity is a measure that there is none of where no line is seen."""
    return quantity.split(".")[0] in (*SIDE_NAMES.values(), "lane", "centre") and bool(
        QUANTITIES[quantity].unit
    )


def _without_sna(profile: Profile) -> list[str]:
    """Say which numbers go out as their start value while there is none, for want of an SNA value."""
    found = [
        f"{plan.layout.name}.{signal.name} ({binding.signal.physical(signal.start_raw):g})"
        for plan in profile.messages
        for binding in plan.bindings
        for signal in (binding.signal,)
        if _needs_line(binding.quantity) and signal.sna_raw is None and binding.raw_of_code is None
    ]
    return [
        f"  no SNA value, so sent as their start value while there is no line: {', '.join(found)}"
    ] * bool(found)


def _rounding(profile: Profile) -> list[str]:
    bindings = [b for plan in profile.messages for b in plan.bindings]
    lines = []
    if any(b.quantity in (f"{line}.offset_m" for line in LINES) for b in bindings):
        errors = quantisation_error_m(profile)
        shown = ", ".join(f"{1e3 * error:.1f} mm at {x:g} m" for x, error in errors.items())
        lines.append(f"  quantisation adds at most {shown}")
        lines += _without_cubic(profile)
    steps = {_step_m(b) for b in bindings if b.quantity.endswith(".lane_offset_m")} - {0.0}
    if steps:
        lines.append(f"  lane offsets are rounded by at most {1e3 * max(steps) / 2:.1f} mm")
    return lines


def _step_m(binding: Binding) -> float:
    return 0.0 if binding.signal.is_float else abs(binding.signal.scale / binding.gain)


def _without_cubic(profile: Profile) -> list[str]:
    """Say which lines leave their receiver without the last coefficient."""
    carried = profile.quantities()
    without = [
        line
        for line in LINES
        if f"{line}.offset_m" in carried
        and not {f"{line}.c3_per_m2", f"{line}.curvature_rate_per_m2"} & carried
    ]
    said = f"  no cubic coefficient, so that bends that tighten are lost far away: {', '.join(without)}"
    return [said] if without else []


def _load_lines(profile: Profile, speed: BusSpeed) -> list[str]:
    plans = profile.messages
    rate = sum(frames_per_s(plan) for plan in plans)
    least, most = (100 * load(plans, speed, stuffed=stuffed) for stuffed in (False, True))
    fd = any(plan.layout.is_fd for plan in plans)
    line = (
        f"  {rate:.0f} frames/s, {least:.1f} to {most:.1f} % of a bus of {speed.text(fd)} "
        "(without and with the most stuff bits)"
    )
    events = [plan.layout.name for plan in plans if not frames_per_s(plan)]
    return [line, f"  sent by events alone and not in the load: {', '.join(events)}"] if events else [line]
