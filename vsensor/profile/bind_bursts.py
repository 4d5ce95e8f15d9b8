"""`[bursts.NAME]` bound to the messages of the profile; every mistake in one line."""

from collections.abc import Mapping, Sequence

from vsensor.codec import Layout, SignalLayout
from vsensor.e2e import CHECKSUMS
from vsensor.errors import ConfigError
from vsensor.profile.bind import hint, signal_of
from vsensor.profile.burst_config import BurstChecksumConfig, BurstConfig, CoverConfig
from vsensor.profile.bursts import Burst, FrameKey, Seal
from vsensor.profile.config import E2eConfig, MessageConfig, SignalConfig
from vsensor.profile.plan import MessagePlan


def named(config: BurstConfig, given: str | Mapping[str, str] | None) -> Mapping[str, str]:
    """Return message -> signal of a key that gives one name for all messages, or one for each."""
    if given is None:
        return {}
    return dict.fromkeys(config.messages, given) if isinstance(given, str) else given


def with_bursts(
    messages: Mapping[str, MessageConfig], bursts: Mapping[str, BurstConfig], path: str
) -> dict[str, MessageConfig]:
    """Return the messages with what their bursts say of them: burst ids and rolling counts."""
    told = dict(messages)
    for name, burst in bursts.items():
        where = f"{path}: bursts.{name}"
        _require_members(burst, messages, where)
        for message, signal in named(burst, burst.id).items():
            told[message] = _with_id(told[message], signal)
        for message, signal in named(burst, burst.count).items():
            told[message] = _with_count(told[message], signal, f"{where}: {message}")
    return told


def _require_members(burst: BurstConfig, messages: Mapping[str, MessageConfig], where: str) -> None:
    if len(burst.messages) < 1 or len(set(burst.messages)) < len(burst.messages):
        raise ConfigError(f"{where}: messages: some, each once, were expected")
    listed = [*burst.messages, *named(burst, burst.id), *named(burst, burst.count)]
    for message in listed:
        if message not in messages:
            raise ConfigError(
                f"{where}: {message} is not among the profile's messages{hint(message, messages)}"
            )
        if message not in burst.messages:
            raise ConfigError(f"{where}: {message} is not among the messages of this burst")
    places = [list(messages).index(message) for message in burst.messages]
    if places != sorted(places):
        raise ConfigError(f"{where}: messages are sent in the profile's order, and must be listed in it")


def _with_id(message: MessageConfig, signal: str) -> MessageConfig:
    if signal in message.signals:
        return message
    told = {**message.signals, signal: SignalConfig(quantity="image.index", wrap=True)}
    return _replaced(message, signals=told)


def _with_count(message: MessageConfig, signal: str, where: str) -> MessageConfig:
    if message.e2e is None:
        return _replaced(message, e2e=E2eConfig(counter=signal, profile="counter"))
    if message.e2e.counter != signal:
        raise ConfigError(f"{where}: count = {signal!r}, but its e2e has counter = {message.e2e.counter!r}")
    return message


def _replaced(message: MessageConfig, **changes: object) -> MessageConfig:
    fields = {name: getattr(message, name) for name in message.__struct_fields__}
    return MessageConfig(**{**fields, **changes})


def burst_of(name: str, config: BurstConfig, plans: Sequence[MessagePlan], path: str) -> Burst:
    """Return the burst at work; raises ConfigError naming it."""
    where = f"{path}: bursts.{name}"
    mine = {plan.layout.name: plan for plan in plans if plan.layout.name in config.messages}
    for message, plan in mine.items():
        if plan.mux == "rotate":
            raise ConfigError(f'{where}: {message} has mux = "rotate", so an image would lack pages')
    first = mine[config.messages[0]]
    for message, plan in mine.items():
        if plan.sending != first.sending:
            raise ConfigError(f"{where}: {message} is not sent at the times of {first.layout.name}")
    counts = named(config, config.count)
    if counts and any(len(plan.pages) > 1 for plan in mine.values()):
        raise ConfigError(f"{where}: count: a message of several pages counts further in one burst")
    ids = named(config, config.id)
    for message in (*ids, *counts):
        for signals in (ids, counts):
            if message in signals:
                signal_of(mine[message].layout, signals[message], f"{where}: {message}")
    return Burst(
        name=name,
        frames=tuple((m, page) for m in config.messages for page in range(len(mine[m].pages))),
        layouts={message: plan.layout for message, plan in mine.items()},
        pages={message: plan.pages for message, plan in mine.items()},
        ties={m: tuple(s[m] for s in (ids, counts) if m in s) for m in config.messages},
        seal=_seal(config, config.checksum, mine, where) if config.checksum is not None else None,
    )


def _seal(
    burst: BurstConfig, config: BurstChecksumConfig, mine: Mapping[str, MessagePlan], where: str
) -> Seal:
    where = f"{where}: checksum"
    if config.algorithm not in CHECKSUMS:
        raise ConfigError(
            f"{where}: algorithm {config.algorithm!r} is not known{hint(config.algorithm, CHECKSUMS)}"
        )
    if config.message not in mine:
        raise ConfigError(f"{where}: {config.message} is not among the messages of this burst")
    plan = mine[config.message]
    layout = plan.layout
    signal = signal_of(layout, config.signal, where)
    if config.signal not in plan.constants or signal.mux_signal is not None:
        raise ConfigError(f"{where}: {config.message}.{config.signal} carries something else already")
    algorithm = CHECKSUMS[config.algorithm]
    if signal.length < algorithm.bits:
        raise ConfigError(
            f"{where}: {config.signal} has {signal.length} bits, {config.algorithm} has {algorithm.bits}"
        )
    own = bits_of(layout, signal) | _crc_bits(plan)
    skipped = own if config.own == "skip" else 0
    covers = [CoverConfig(message=c) if isinstance(c, str) else c for c in config.covers or burst.messages]
    data_id = b"" if config.data_id is None else config.data_id.to_bytes(2, "little")
    return Seal(
        carrier=(config.message, 0),
        layout=layout,
        signal=signal,
        algorithm=algorithm,
        before=bytes(config.before) + data_id,
        after=bytes(config.after),
        covers=tuple(
            item
            for cover in covers
            for item in _covered(cover, mine, skipped if cover.message == config.message else 0, where)
        ),
        blank=own if config.own == "zero" else 0,
    )


def _covered(
    cover: CoverConfig, mine: Mapping[str, MessagePlan], skipped: int, where: str
) -> list[tuple[FrameKey, tuple[int, ...]]]:
    if cover.message not in mine:
        raise ConfigError(f"{where}: covers {cover.message}, which is not among the messages of this burst")
    plan = mine[cover.message]
    last = plan.layout.length - 1 if cover.last is None else cover.last
    if not cover.first <= last < plan.layout.length:
        raise ConfigError(
            f"{where}: covers bytes {cover.first} to {last} of {cover.message}, which has 0 to "
            f"{plan.layout.length - 1}"
        )
    all_places = range(cover.first, last + 1)
    places = tuple(place for place in all_places if not skipped >> 8 * place & 0xFF)
    # The checksum is in the first page of its message alone.
    return [((cover.message, page), tuple(all_places) if page else places) for page in range(len(plan.pages))]


def bits_of(layout: Layout, signal: SignalLayout) -> int:
    """Return the bits of a signal, in the little-endian integer of its message."""
    mask = ((1 << signal.length) - 1) << signal.shift
    if not signal.big_endian:
        return mask
    return int.from_bytes(mask.to_bytes(layout.length, "big"), "little")


def _crc_bits(plan: MessagePlan) -> int:
    field = plan.guard.checksum_field if plan.guard is not None else None
    return sum(mask << 8 * byte for byte, mask in field.masks().items()) if field is not None else 0
