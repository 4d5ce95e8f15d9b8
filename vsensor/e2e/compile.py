"""From the name of a protection to the guard of a message."""

import difflib
from typing import Any

from vsensor.e2e.autosar import profile_guard
from vsensor.e2e.checksums import CHECKSUMS, plain_guard
from vsensor.e2e.field import Field
from vsensor.e2e.guard import Guard, Wanted
from vsensor.e2e.layouts import LAYOUTS
from vsensor.errors import ConfigError

NAMES: tuple[str, ...] = (*LAYOUTS, *CHECKSUMS, "counter")
"""All protections."""


def guard(
    name: str,
    *,
    length: int,
    arbitration_id: int = 0,
    data_id: int | tuple[int, ...] | None = None,
    checksum: Field | None = None,
    counter: Field | None = None,
    counter_states: int | None = None,
    offset: int | None = None,
    data_id_mode: str | None = None,
    start: int | None = None,
    final_xor: int | None = None,
    skip: tuple[int, ...] = (),
) -> Guard:
    """Return the protection `name` of messages of `length` bytes.

    AUTOSAR profiles ("P01" ...): `data_id` (P02, P22: a list of 16) and, for P01 and P11, `data_id_mode`; the
    header lies at byte `offset`, or where `checksum` says; both fields must lie where the profile puts them.
    Plain checksums (`CHECKSUMS`) and "counter" (no checksum): at the places given; `counter_states` is how
    many values the counter runs through, all that its bits hold if not said. `data_id` is put after the
    data of a CRC; `start`, `final_xor` replace its own; bytes in `skip` are left out.

    Raises ConfigError, one line that does not name the message.
    """
    wanted = Wanted(
        name=name,
        length=length,
        arbitration_id=arbitration_id,
        data_id=data_id,
        checksum=checksum,
        counter=counter,
        counter_states=counter_states,
        offset=offset,
        data_id_mode=data_id_mode,
        start=start,
        final_xor=final_xor,
        skip=skip,
    )
    if name in LAYOUTS:
        return profile_guard(wanted)
    if name in CHECKSUMS or name == "counter":
        return plain_guard(wanted)
    near = difflib.get_close_matches(name, NAMES, n=1)
    end = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(NAMES)}"
    raise ConfigError(f"e2e profile {name!r} is not known; {end}")


def remade(settings: dict[str, Any]) -> Guard:
    """Return the guard of the same settings again; for pickles."""
    return guard(**settings)
