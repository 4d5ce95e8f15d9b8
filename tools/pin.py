"""Write constraints.txt: what is installed of vsensor[dev,peers] and of all that it requires.

Run it after `pip install -U -e '.[dev,peers]'` in a fresh environment, then run all tests.
"""

import re
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement

HEAD = "# What vsensor was tested with on Python 3.11; 3.12 and 3.13 take the same versions.\n"


def pinned(name: str, extras: frozenset[str], found: dict[tuple[str, frozenset[str]], str]) -> None:
    """Add the version of a package, and of all that it requires with these extras, to `found`."""
    key = (re.sub(r"[-_.]+", "-", name).lower(), extras)
    if key in found:
        return
    package = distribution(name)
    found[key] = package.version
    for text in package.requires or []:
        requirement = Requirement(text)
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in extras | {""}):
            pinned(requirement.name, frozenset(requirement.extras), found)


def main() -> None:
    found: dict[tuple[str, frozenset[str]], str] = {}
    pinned("vsensor", frozenset({"dev", "peers"}), found)
    lines = {f"{name}=={version}\n" for (name, _), version in found.items() if name != "vsensor"}
    Path("constraints.txt").write_text(HEAD + "".join(sorted(lines)))


if __name__ == "__main__":
    main()
