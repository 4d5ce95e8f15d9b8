"""A fault as a word of the command line."""

import tomllib
from typing import Any

from vsensor.errors import ConfigError
from vsensor.faults.config import FaultConfig
from vsensor.faults.fault import Fault, fault_of
from vsensor.profile import Profile
from vsensor.schema import convert


def parse_fault(text: str, profile: Profile) -> Fault:
    """Return the fault of a text such as `kind=frame_lost,message=LDS_Lane,at_s=3,for_s=1`.

    Values as in TOML, or bare words. Raises ConfigError naming the text.
    """
    where, told = f"--fault {text}", dict[str, Any]()
    for part in text.split(","):
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not key or key in told:
            example = "kind=frame_lost,message=LDS_Lane,at_s=3,for_s=1"
            raise ConfigError(f"{where}: KEY=VALUE,... was expected, such as {example}")
        told[key] = _value(value)
    return fault_of(convert(told, FaultConfig, where), profile, where)


def _value(text: str) -> Any:
    try:
        found = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError):
        return text
    return found["value"] if len(found) == 1 else text
