"""The parts of a map file one after the other: header, roads, junctions; each is forgotten after its turn.

So the tree of a file of any size is never there as a whole. No entity, DTD or network.
"""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from lxml import etree

from vsensor.errors import MapError
from vsensor.world.opendrive.xml import Element, refusals_named

TAGS = ("header", "road", "junction")


def parts_of(path: Path, text: bytes | None = None) -> Iterator[Element]:
    """Yield header, roads and junctions, names without namespaces, and the root at last; raises MapError.

    `text` stands in place of the file's content. An element must not be used after the next was asked for.
    """
    with refusals_named(path, MapError), path.open("rb") if text is None else BytesIO(text) as file:
        yield from _parts(path, file)


def _parts(path: Path, file: IO[bytes]) -> Iterator[Element]:
    reading: Any = etree.iterparse(
        file,
        events=("start", "end"),
        tag=[f"{{*}}{tag}" for tag in ("OpenDRIVE", *TAGS)],
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )
    for event, element in reading:
        parent = element.getparent()
        if parent is None:
            _require_no_dtd(path, element)
        elif event == "end" and parent.getparent() is None:
            _require_root(path, parent)
            yield without_namespaces(element)
            element.clear()
            while element.getprevious() is not None:
                del parent[0]
    root = reading.root
    _require_no_dtd(path, root)
    _require_root(path, root)
    yield root


def without_namespaces(element: Element) -> Element:
    """Return the element, all names in it without namespaces."""
    for each in element.iter(etree.Element):
        if each.tag.startswith("{"):
            each.tag = etree.QName(each).localname
    return element


def _require_no_dtd(path: Path, root: Element) -> None:
    if root.getroottree().docinfo.internalDTD is not None:
        raise MapError(f"{path}:1: has a document type definition (DTD), which is refused")


def _require_root(path: Path, root: Element) -> None:
    tag = etree.QName(root).localname
    if tag != "OpenDRIVE":
        raise MapError(f"{path}:{root.sourceline}: <{tag}>: the root element must be <OpenDRIVE>")
