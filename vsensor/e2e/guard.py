"""What protects one message: a counter and a checksum, compiled for its bytes."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field

import numpy as np

from vsensor.e2e.field import Field, read_bulk, reader, writer
from vsensor.e2e.sums import ByteSum
from vsensor.errors import ConfigError
from vsensor.types import BoolArray, CodeArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a guard is made of, as it was asked for; see `guard`."""

    name: str
    length: int
    arbitration_id: int = 0
    data_id: int | tuple[int, ...] | None = None
    checksum: Field | None = None
    counter: Field | None = None
    counter_states: int | None = None
    offset: int | None = None
    data_id_mode: str | None = None
    start: int | None = None
    final_xor: int | None = None
    skip: tuple[int, ...] = ()

    def refuse(self, *names: str) -> None:
        """Raise ConfigError if one of the named settings, which this protection does not know, is given."""
        for name in names:
            if getattr(self, name) not in (None, ()):
                raise ConfigError(f"e2e {self.name} has no {name}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """Protection of one message of `wanted.length` bytes.

    `protect(data, counter)` writes counter, constant header and checksum in place; whatever these bits held
    does not matter, and the counter must be below `counter_states` (1 = there is no counter). `check(data)`
    says whether checksum, constant header and counter are possible. `check_bulk(data (N, L))` does so for
    many messages, (N,). A message of another length is not right.
    """

    wanted: Wanted
    counter_states: int
    checksum_field: Field | None
    counter_field: Field | None
    protect: Callable[[bytearray, int], None] = field(repr=False, compare=False)
    check: Callable[[bytes], bool] = field(repr=False, compare=False)
    check_bulk: Callable[[CodeArray], BoolArray] = field(repr=False, compare=False)
    _read_counter: Callable[[bytes], int] | None = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """Name of the protection."""
        return self.wanted.name

    @property
    def data_id(self) -> int | tuple[int, ...] | None:
        """The data id, or the list of 16 of them."""
        return self.wanted.data_id

    @property
    def label(self) -> str:
        """Name and data id, for people."""
        data_id = self.data_id
        numbers = data_id if isinstance(data_id, tuple) else () if data_id is None else (data_id,)
        return " ".join([self.name, *(["data id"] if numbers else []), *(f"0x{n:X}" for n in numbers)])

    def counter(self, data: bytes) -> int | None:
        """Return the counter of a message; None if it has none."""
        return None if self._read_counter is None else self._read_counter(data)

    def counters_bulk(self, data: CodeArray) -> IntArray:
        """Return the counters of many messages (N, L), (N,); 0 if they have none."""
        if self.counter_field is None:
            return np.zeros(len(data), dtype=np.int64)
        return read_bulk(self.counter_field, data).astype(np.int64)

    def __reduce__(self) -> tuple[Callable[[dict[str, object]], "Guard"], tuple[dict[str, object]]]:
        """Pickle what was asked for: the compiled functions are made again."""
        from vsensor.e2e.compile import remade

        fields = ("checksum", "counter")
        settings = {**asdict(self.wanted), **{name: getattr(self.wanted, name) for name in fields}}
        return remade, (settings,)


Protect = Callable[[bytearray, int], None]
Check = Callable[[bytes], bool]


def build(
    wanted: Wanted,
    *,
    checksum: Field | None,
    counter: Field | None,
    counter_states: int,
    total: ByteSum | None,
    constants: tuple[tuple[Field, int], ...] = (),
    protect: Protect | None = None,
    check: Check | None = None,
) -> Guard:
    """Return the guard whose checksum is `total` at `checksum` and whose `constants` have fixed values.

    `protect` and `check` replace the ones made here by a library's of the same effect.
    """
    return Guard(
        wanted=wanted,
        counter_states=counter_states,
        checksum_field=checksum,
        counter_field=counter,
        protect=protect or _protect(checksum, counter, total, constants),
        check=check or _check(wanted.length, checksum, counter, counter_states, total, constants),
        check_bulk=_check_bulk(wanted.length, checksum, counter, counter_states, total, constants),
        _read_counter=None if counter is None else reader(counter),
    )


def _protect(
    checksum: Field | None,
    counter: Field | None,
    total: ByteSum | None,
    constants: tuple[tuple[Field, int], ...],
) -> Protect:
    write_counter = None if counter is None else writer(counter)
    write_checksum = None if checksum is None else writer(checksum)
    fixed = [(writer(place), value) for place, value in constants]
    single = None if total is None else total.single()

    def protect(data: bytearray, count: int) -> None:
        for write, value in fixed:
            write(data, value)
        if write_counter is not None:
            write_counter(data, count)
        if write_checksum is not None and single is not None:
            write_checksum(data, single(data, count))

    return protect


def _check(
    length: int,
    checksum: Field | None,
    counter: Field | None,
    counter_states: int,
    total: ByteSum | None,
    constants: tuple[tuple[Field, int], ...],
) -> Check:
    read_counter = None if counter is None else reader(counter)
    read_checksum = None if checksum is None else reader(checksum)
    fixed = [(reader(place), value) for place, value in constants]
    single = None if total is None else total.single()

    def check(data: bytes) -> bool:
        if len(data) != length:
            return False
        count = 0 if read_counter is None else read_counter(data)
        if read_counter is not None and count >= counter_states:
            return False
        if fixed and any(read(data) != value for read, value in fixed):
            return False
        return read_checksum is None or single is None or read_checksum(data) == single(data, count)

    return check


def _check_bulk(
    length: int,
    checksum: Field | None,
    counter: Field | None,
    counter_states: int,
    total: ByteSum | None,
    constants: tuple[tuple[Field, int], ...],
) -> Callable[[CodeArray], BoolArray]:
    bulk = None if total is None else total.bulk()

    def check_bulk(data: CodeArray) -> BoolArray:
        if data.ndim != 2 or data.shape[1] != length:
            return np.zeros(len(data), dtype=np.bool_)
        right: BoolArray = np.ones(len(data), dtype=np.bool_)
        counters = np.zeros(0, dtype=np.int64)
        if counter is not None:
            counters = read_bulk(counter, data).astype(np.int64)
            right &= counters < counter_states
        for place, value in constants:
            right &= read_bulk(place, data) == np.uint64(value)
        if checksum is not None and bulk is not None:
            right &= read_bulk(checksum, data) == bulk(data, counters)
        return right

    return check_bulk
