"""Who may import whom, as data, and the reader of sources that finds who does not keep to it."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = "vsensor"
ORDER = """
    types errors stop scenarios
    / transforms draws schema
    / scene raycast distortion motion light
    / camera region error_model lanefit tracker quality
    / sensor image
    / e2e
    / codec
    / profile
    / signals state latency faults
    / transmit
    / clock timing
    / bus logs
    / world
    / sources sinks
    / config
    / line
    / runner realtime
    / score accept pages
    / study
    / experiment
    / plots control
    / run
    / overlay
    / session replay
    / gateway
    / pitfalls profile_new
    / check
    / field
    / video
    / apps
    / cli
    / __main__
"""
"""A module imports only from what stands before its slash, or from its own package: siblings do not import
each other. `vsensor/__init__.py` imports nothing before it is asked for a name, so that one stage can be
imported without the others."""

SOLE_IMPORTERS = {"embreex": "raycast", "cantools": "codec"}
"""Libraries that one module alone knows."""

OPTIONAL = frozenset(
    {
        "asammdf",
        "polars",
        "trimesh",
        "matplotlib",
        "cv2",
        "dash",
        "plotly",
        "viser",
        "distributed",
        "lz4",
        "zstandard",
    }
)
"""Libraries of the extras: imported inside the function that needs them."""

PRINTERS = frozenset({"cli", "sinks.table"})
"""The command line, and the live table's own process."""

LEVELS = {name: level for level, names in enumerate(ORDER.split("/")) for name in names.split()}
REGISTRY_STRING = re.compile(rf"({PACKAGE}(?:\.\w+)+):\w+")


def place(module: str) -> str:
    """Return a module's place in ORDER: `vsensor.logs.read` stands at `logs`."""
    return module.split(".")[1] if "." in module else ""


def imports_of(tree: ast.Module, module: str, is_package: bool) -> Iterator[tuple[int, str, bool]]:
    """Yield line, imported module and whether it is imported with the module itself.

    Imports in functions and registry strings "vsensor.module:Class" count; those for type checkers too.
    """
    deferred = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for node in ast.walk(function)
    } | {
        id(node)
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If) and "TYPE_CHECKING" in ast.dump(branch.test)
        for node in ast.walk(branch)
    }
    parents = module.split(".") if is_package else module.split(".")[:-1]
    for node in ast.walk(tree):
        at_once = id(node) not in deferred
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name, at_once
        elif isinstance(node, ast.ImportFrom):
            base = parents[: len(parents) - node.level + 1] if node.level else []
            origin = ".".join([*base, *([node.module] if node.module else [])])
            if origin == PACKAGE:  # from vsensor import camera
                for alias in node.names:
                    yield node.lineno, f"{origin}.{alias.name}", at_once
            else:
                yield node.lineno, origin, at_once
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            for match in REGISTRY_STRING.finditer(node.value):
                yield node.lineno, match[1], False
        elif isinstance(node, ast.Call) and _called(node) in ("import_module", "__import__"):
            literal = node.args[0] if node.args else None
            if isinstance(literal, ast.Constant):
                yield node.lineno, str(literal.value), at_once


def _called(call: ast.Call) -> str:
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def violations(source: str, module: str, is_package: bool = False) -> list[str]:
    """Return one line for each thing in a module's source that the rules forbid."""
    tree = ast.parse(source)
    here = place(module)
    found = []
    if here and here not in LEVELS:
        found.append(f"{module}: has no place in ORDER (tests/architecture.py)")
    for line, imported, at_once in imports_of(tree, module, is_package):
        where = f"{module}:{line}"
        library = imported.split(".")[0]
        if library == PACKAGE:
            found += _wrong_order(where, here, place(imported)) if here or at_once else []
        elif SOLE_IMPORTERS.get(library, here) != here:
            found.append(f"{where}: imports {library}, which {SOLE_IMPORTERS[library]} alone may")
        elif library in OPTIONAL and at_once:
            found.append(
                f"{where}: imports the optional {library} with the module: import it where it is used"
            )
    if not any(f"{PACKAGE}.{name}" == module or module.startswith(f"{PACKAGE}.{name}.") for name in PRINTERS):
        found += [
            f"{module}:{node.lineno}: prints; only {', '.join(sorted(PRINTERS))} may"
            for node in ast.walk(tree)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
        ]
    return found


def _wrong_order(where: str, here: str, other: str) -> list[str]:
    if other in ("", here):
        return []
    if other not in LEVELS:
        return [f"{where}: imports {other}, which has no place in ORDER (tests/architecture.py)"]
    if here in LEVELS and LEVELS[other] >= LEVELS[here]:
        relation = "beside" if LEVELS[other] == LEVELS[here] else "after"
        return [f"{where}: {here} imports {other}, which stands {relation} it"]
    return [] if here else [f"{where}: the package itself imports {other}"]


def violations_in(package: Path) -> list[str]:
    """Return the violations of every source file of a package."""
    found = []
    for file in sorted(package.rglob("*.py")):
        parts = [PACKAGE, *file.relative_to(package).with_suffix("").parts]
        is_package = parts[-1] == "__init__"
        module = ".".join(parts[:-1] if is_package else parts)
        found += violations(file.read_text(encoding="utf-8"), module, is_package)
    return found
