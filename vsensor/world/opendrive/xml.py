"""Reading the XML of maps and storyboards: every number checked, every refusal with file, line, element."""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lxml import etree

from vsensor.errors import MapError, VsensorError

Element = Any
"""An lxml element; lxml ships no types."""

LARGEST_NUMBER = 1e10
"""World coordinates reach 1e7 m; far above, a value is a mistake and its powers overflow."""


@contextmanager
def refusals_named(path: Path, error_type: type[VsensorError]) -> Iterator[None]:
    """Turn what file and parser say into one line of `error_type` that names the file."""
    try:
        yield
    except etree.XMLSyntaxError as error:
        reason = " ".join((error.msg or "not XML").split())
        raise error_type(f"{path}:{error.lineno or 0}: not well-formed XML: {reason}") from None
    except FileNotFoundError:
        raise error_type(f"{path}: no such file") from None
    except OSError as error:
        raise error_type(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise error_type(f"{path}: not XML: {shortened(str(error))}") from None


class MapReader:
    """One file being read: makes errors and warnings that name the file and the line."""

    error_type: type[VsensorError] = MapError

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []

    def error(self, element: Element, text: str) -> VsensorError:
        """Return (not raise) the refusal of `element`."""
        return self.error_type(f"{self.path}:{element.sourceline}: <{element.tag}>: {text}")

    def warn(self, element: Element, text: str) -> None:
        """Note a finding that the map survives."""
        self.warnings.append(f"{self.path}:{element.sourceline}: <{element.tag}>: {text}")

    def error_at(self, line: int, tag: str, text: str) -> VsensorError:
        """Return (not raise) the refusal of an element that is no longer there."""
        return self.error_type(f"{self.path}:{line}: <{tag}>: {text}")

    def text(self, element: Element, name: str) -> str:
        """Return an attribute that must be there and not empty."""
        value = " ".join((element.get(name) or "").split())  # a character reference can hide a line break
        if not value:
            raise self.error(element, f"attribute {name} is missing")
        return value

    def choice(self, element: Element, name: str, options: tuple[str, ...]) -> str:
        """Return one of `options`, the first if the attribute is not there."""
        value = " ".join((element.get(name) or "").split()) or options[0]
        if value not in options:
            raise self.error(element, f'{name}="{shortened(value)}": {" or ".join(options)} was expected')
        return value

    def number(self, element: Element, name: str, default: float | None = None) -> float:
        """Return a finite float; without `default` the attribute must be there."""
        raw = element.get(name)
        if raw is None and default is not None:
            return default
        raw = self.text(element, name)
        try:
            value = math.nan if "_" in raw else float(raw)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST_NUMBER:  # NaN fails every comparison
            raise self.error(element, f'{name}="{shortened(raw)}": a finite number up to 1e10 was expected')
        return value

    def integer(self, element: Element, name: str) -> int:
        """Return an integer such as a lane id."""
        raw = self.text(element, name)
        if re.fullmatch(r"[+-]?[0-9]{1,9}", raw) is None:
            raise self.error(element, f'{name}="{shortened(raw)}": an integer was expected')
        return int(raw)

    def at_least(self, element: Element, name: str, least: float, default: float | None = None) -> float:
        """Return a number that is not below `least`."""
        value = self.number(element, name, default)
        if value < least:
            raise self.error(element, f'{name}="{value:g}": at least {least:g} was expected')
        return value


def shortened(text: str) -> str:
    """Return `text` fit for one line of an error."""
    text = " ".join(text.split())
    return text if len(text) <= 40 else text[:37] + "..."


def children(element: Element | None, *names: str) -> Iterator[Element]:
    """Yield the children of these names, nothing for an absent element."""
    if element is not None:
        yield from element.iterchildren(*names)


def own_data(element: Element, code: str, tag: str) -> Element | None:
    """Return the first `tag` inside the userData of this code, None without one; what others wrote stays."""
    for data in children(element, "userData"):
        if data.get("code") == code:
            return data.find(tag)
    return None


def read_cubic(reader: MapReader, element: Element, start: str) -> tuple[float, float, float, float, float]:
    """Return the record's start (attribute `start`) and its coefficients a, b, c, d."""
    a, b, c, d = (reader.number(element, name) for name in "abcd")
    return reader.number(element, start), a, b, c, d


def read_root(
    path: Path,
    text: bytes | None = None,
    root_tag: str = "OpenDRIVE",
    error_type: type[VsensorError] = MapError,
) -> Element:
    """Return the root element, names without namespaces; raises `error_type`. No entity, DTD or network.

    `text` stands in place of the file's content.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    with refusals_named(path, error_type):
        content = path.read_bytes() if text is None else text
        tree: Any = etree.fromstring(content, parser).getroottree()
    if tree.docinfo.internalDTD is not None:
        raise error_type(f"{path}:1: has a document type definition (DTD), which is refused")
    root = tree.getroot()
    for element in root.iter(etree.Element):
        if element.tag.startswith("{"):
            element.tag = etree.QName(element).localname
    if root.tag != root_tag:
        raise error_type(f"{path}:{root.sourceline}: <{root.tag}>: the root element must be <{root_tag}>")
    return root
