"""Reading OpenSCENARIO files: parameters put in their places, catalogs opened, both within bounds."""

import copy
from collections.abc import Mapping
from pathlib import Path

from vsensor.errors import StoryError, VsensorError
from vsensor.world.opendrive.xml import Element, MapReader, children, read_root, shortened
from vsensor.world.openscenario.expressions import ExpressionError, evaluated

LARGEST_FILE_BYTES = 16 * 1024 * 1024
MOST_ELEMENTS = 100_000
"""Of a scenario with everything that its catalogs bring: a catalog entry can ask for another many times."""

DEEPEST_CATALOGS = 16
FILE = "vsensor-file"
"""Attribute that an element from a catalog carries, so that a refusal names the catalog's file."""

Scope = Mapping[str, str]


class StoryReader(MapReader):
    """One scenario being read, with its catalogs."""

    error_type = StoryError

    def __init__(self, path: Path, given: Scope | None = None) -> None:
        """`given`: values in place of those that the scenario's own parameters declare."""
        super().__init__(path)
        self.given = dict(given or {})
        self.parameters: dict[str, str] = {}
        self._catalogs: dict[Path, list[tuple[Path, Element]]] = {}
        self._folders: list[tuple[Element, Path]] = []
        self._elements = 0

    def error(self, element: Element, text: str) -> VsensorError:
        """Return (not raise) the refusal of `element`."""
        return StoryError(f"{self.file_of(element)}:{element.sourceline}: <{element.tag}>: {text}")

    def warn(self, element: Element, text: str) -> None:
        """Note a finding that the scenario survives."""
        self.warnings.append(f"{self.file_of(element)}:{element.sourceline}: <{element.tag}>: {text}")

    def file_of(self, element: Element) -> str:
        """Return the file that an element was written in."""
        for one in (element, *element.iterancestors()):
            if FILE in one.attrib:
                return str(one.get(FILE))
        return str(self.path)

    @property
    def files(self) -> tuple[Path, ...]:
        """The catalogs that were read."""
        return tuple(dict.fromkeys(file for found in self._catalogs.values() for file, _ in found))

    def boolean(self, element: Element, name: str, *, default: bool) -> bool:
        """Return true or false."""
        raw = " ".join((element.get(name) or "").split())
        if raw and raw not in ("true", "false", "1", "0"):
            raise self.error(element, f'{name}="{shortened(raw)}": true or false was expected')
        return raw in ("true", "1") if raw else default

    def child(self, element: Element, *names: str) -> Element:
        """Return the first child of these names; raises StoryError if there is none."""
        found = next(children(element, *names), None)
        if found is None:
            raise self.error(element, f"<{'>, <'.join(names)}> is missing")
        return found

    def only(self, element: Element) -> Element:
        """Return the only child, whatever its name."""
        found = list(element.iterchildren("*"))
        if len(found) != 1:
            raise self.error(element, f"one element was expected in it, there are {len(found)}")
        return found[0]

    def read(self) -> Element:
        """Return the root with every parameter and catalog entry in its place."""
        root = open_document(self.path)
        for location in children(root.find("CatalogLocations"), *LOCATIONS):
            folder = self.child(location, "Directory")
            self._folders.append((folder, self._path_of(folder, "path")))
        self._resolve(root, {}, ())
        return root

    def _path_of(self, element: Element, name: str) -> Path:
        raw = self.text(element, name)
        return self.path.parent / raw if "$" not in raw else Path(raw)

    def _resolve(self, element: Element, scope: Scope, stack: tuple[tuple[str, str], ...]) -> None:
        """Put values in place of parameters in an element and all below it."""
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            raise self.error(element, f"more than {MOST_ELEMENTS} elements with what the catalogs bring")
        declared = element.find("ParameterDeclarations")
        if declared is not None:
            scope = {**scope, **self._declared(declared, scope, element)}
        for name, raw in element.attrib.items():
            if "$" in raw and name != FILE:
                element.set(name, self._value(element, name, raw, scope))
        for child in list(element.iterchildren("*")):
            if child.tag == "CatalogReference":
                self._expand(child, scope, stack)
            elif child.tag != "ParameterDeclarations":
                self._resolve(child, scope, stack)

    def _value(self, element: Element, name: str, raw: str, scope: Scope) -> str:
        try:
            return evaluated(raw, scope)
        except ExpressionError as error:
            raise self.error(element, f'{name}="{shortened(raw)}": {error}') from None

    def _declared(self, declared: Element, scope: Scope, owner: Element) -> dict[str, str]:
        """Return what an element declares; the scenario's own may be given from outside."""
        found: dict[str, str] = {}
        for one in children(declared, "ParameterDeclaration"):
            name = self.text(one, "name").lstrip("$")
            raw = one.get("value")
            if raw is None:
                raise self.error(one, "attribute value is missing")
            found[name] = self._value(one, "value", raw, {**scope, **found})
            if one.get("parameterType") in ("double", "integer", "int", "unsignedInt"):
                one.set("value", found[name])
                self.number(one, "value")
        if owner.tag == "OpenSCENARIO":
            for name, value in self.given.items():
                if name not in found:
                    known = ", ".join(found) or "none"
                    raise StoryError(f"{self.path}: no parameter {name} to set; declared: {known}")
                found[name] = value
            self.parameters = dict(found)
        elif owner.get("vsensor-assigned") is not None:
            found |= _assigned(owner)
        return found

    def _expand(self, reference: Element, scope: Scope, stack: tuple[tuple[str, str], ...]) -> None:
        """Put a catalog's entry in the place of the reference to it."""
        for name, raw in reference.attrib.items():
            if "$" in raw:
                reference.set(name, self._value(reference, name, raw, scope))
        key = self.text(reference, "catalogName"), self.text(reference, "entryName")
        if key in stack or len(stack) >= DEEPEST_CATALOGS:
            chain = " -> ".join(entry for _, entry in (*stack, key))
            raise self.error(reference, f"catalog entries ask for each other in a circle: {chain}")
        path, found = self._entry(reference, *key)
        entry = copy.deepcopy(found)
        entry.set(FILE, str(path))
        assigned = {
            self.text(one, "parameterRef").lstrip("$"): self._value(
                one, "value", one.get("value") or "", scope
            )
            for one in children(reference.find("ParameterAssignments"), "ParameterAssignment")
        }
        declared = {
            d.get("name") for d in children(found.find("ParameterDeclarations"), "ParameterDeclaration")
        }
        for name in assigned.keys() - declared:
            raise self.error(reference, f"entry {key[1]} declares no parameter {name}")
        entry.set("vsensor-assigned", "\n".join(f"{name}\t{value}" for name, value in assigned.items()))
        reference.getparent().replace(reference, entry)
        self._resolve(entry, {}, (*stack, key))

    def _entry(self, reference: Element, catalog: str, name: str) -> tuple[Path, Element]:
        entries: list[str] = []
        for folder, path in self._folders:
            for file, found in self._open(folder, path):
                if found.get("name") == catalog:
                    for entry in found.iterchildren("*"):
                        if entry.get("name") == name:
                            return file, entry
                        entries.append(str(entry.get("name")))
        if entries:
            known = ", ".join(entries[:8]) + (", ..." if len(entries) > 8 else "")
            raise self.error(reference, f"catalog {catalog} has no entry {shortened(name)}; it has: {known}")
        places = ", ".join(str(path) for _, path in self._folders) or "no <CatalogLocations>"
        raise self.error(
            reference, f"no catalog {shortened(catalog)} for entry {shortened(name)} in {places}"
        )

    def _open(self, folder: Element, path: Path) -> list[tuple[Path, Element]]:
        """Return the catalogs of a folder, also where it lies beside the scenario by its last name."""
        if path in self._catalogs:
            return self._catalogs[path]
        place = next((p for p in _likely(path, self.path.parent) if p.is_dir()), None)
        if place is None:
            self._catalogs[path] = []
            self.warn(folder, f"no such folder {path}")
            return []
        found = []
        for file in sorted(place.glob("*.xosc")):
            found += [(file, catalog) for catalog in children(open_document(file), "Catalog")]
        self._catalogs[path] = found
        return found


LOCATIONS = (
    *("VehicleCatalog", "ControllerCatalog", "PedestrianCatalog", "MiscObjectCatalog"),
    *("EnvironmentCatalog", "ManeuverCatalog", "TrajectoryCatalog", "RouteCatalog"),
)


def _assigned(entry: Element) -> dict[str, str]:
    """Return the values that a reference gives to an entry's parameters."""
    raw = str(entry.attrib.pop("vsensor-assigned"))
    pairs = (line.split("\t", 1) for line in raw.split("\n") if line)
    return {name: value for name, value in pairs}


def open_document(path: Path) -> Element:
    """Return the root of one file; raises StoryError for one that is too large, or no OpenSCENARIO 1.x."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        size = 0  # said by the reader
    if size > LARGEST_FILE_BYTES:
        raise StoryError(f"{path}: {size} bytes; a scenario of at most 16 MB was expected")
    root = read_root(path, None, "OpenSCENARIO", StoryError)
    header = root.find("FileHeader")
    if header is not None and str(header.get("revMajor", "1")).strip() != "1":
        major, minor = header.get("revMajor"), header.get("revMinor")
        raise StoryError(
            f"{path}:{header.sourceline}: <FileHeader>: OpenSCENARIO {major}.{minor}: 1.0 to 1.3 are played"
        )
    return root


def _likely(path: Path, beside: Path) -> list[Path]:
    """Return the path, and its last two names and its last name beside the scenario."""
    return [path, beside / path.parent.name / path.name, beside / path.name]
