import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture import LEVELS, PACKAGE, violations, violations_in

ROOT = Path(__file__).parents[1]


def test_the_package_keeps_the_import_order():
    assert violations_in(ROOT / PACKAGE) == []


@pytest.mark.parametrize(
    ("module", "source", "said"),
    [
        ("vsensor.scene", "import vsensor.camera", "scene imports camera, which stands after"),
        ("vsensor.scene", "from vsensor.camera import Camera", "scene imports camera, which stands after"),
        ("vsensor.scene", "from vsensor import camera", "scene imports camera, which stands after"),
        ("vsensor.scene", "from . import camera", "scene imports camera, which stands after"),
        ("vsensor.scene", "from .camera import Camera", "scene imports camera, which stands after"),
        ("vsensor.world.route", "from ..runner import run", "world imports runner, which stands after"),
        (
            "vsensor.camera",
            "from vsensor.tracker import assign",
            "camera imports tracker, which stands beside",
        ),
        (
            "vsensor.sources.drive",
            "from vsensor.sinks import Sink",
            "sources imports sinks, which stands beside",
        ),
        ("vsensor.scene", "def f():\n    import vsensor.camera", "vsensor.scene:2: scene imports camera"),
        ("vsensor.scene", "ONE = {'c': 'vsensor.camera:Camera'}", "scene imports camera, which stands after"),
        (
            "vsensor.scene",
            "import importlib\nimportlib.import_module('vsensor.camera')",
            "scene imports camera",
        ),
        ("vsensor.scene", "if TYPE_CHECKING:\n    from vsensor.camera import Camera", "scene imports camera"),
        ("vsensor.scene", "from vsensor.novelty import x", "novelty, which has no place in ORDER"),
        ("vsensor.novelty", "", "novelty: has no place in ORDER"),
        ("vsensor", "import vsensor.types", "the package itself imports types"),
        (
            "vsensor.camera",
            "def f():\n    from embreex import rtcore",
            "imports embreex, which raycast alone may",
        ),
        ("vsensor.profile.load", "import cantools.database", "imports cantools, which codec alone may"),
        ("vsensor.logs.mf4", "from asammdf import MDF", "imports the optional asammdf with the module"),
        (
            "vsensor.plots",
            "class A:\n    import matplotlib.pyplot",
            "imports the optional matplotlib with the module",
        ),
        ("vsensor.runner", "def f():\n    print('x')", "vsensor.runner:2: prints"),
    ],
)
def test_a_violation_is_found_and_named(module, source, said):
    (line,) = violations(source, module)
    assert said in line


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("vsensor.camera", "from vsensor.scene import near"),
        ("vsensor.logs.read", "from vsensor.logs.table import LogTable\nfrom . import table"),
        ("vsensor.raycast", "def f():\n    import embreex"),
        ("vsensor.codec.layout", "import cantools"),
        ("vsensor.logs.mf4", "def f():\n    from asammdf import MDF"),
        ("vsensor.logs.mf4", "if TYPE_CHECKING:\n    from asammdf import MDF"),
        ("vsensor.cli", "print('x')"),
        ("vsensor.sinks.table_view", "import numpy"),
        ("vsensor.scene", "TEXT = 'see vsensor.camera for more'"),
        ("vsensor", "def __getattr__(name):\n    from vsensor.session import Session"),
    ],
)
def test_what_the_rules_allow_is_not_found(module, source):
    assert violations(source, module) == []


def test_relative_imports_of_a_package_count_from_the_package():
    assert violations("from .table import LogTable", "vsensor.logs", is_package=True) == []
    assert violations("from ..runner import run", "vsensor.logs", is_package=True) != []


def test_a_file_that_breaks_the_rules_is_found_in_its_folder(tmp_path):
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "read.py").write_text("import vsensor.cli\n")
    assert violations_in(tmp_path) == ["vsensor.logs.read:1: logs imports cli, which stands after it"]


def test_every_module_there_is_has_a_place():
    present = {
        path.stem
        for path in (ROOT / PACKAGE).iterdir()
        if path.suffix == ".py" or (path / "__init__.py").exists()
    }
    assert present - {"__init__"} <= LEVELS.keys()


def test_command_line_starts_without_the_heavy_libraries():
    """`vsensor --help` and a broken command answer at once: nothing numerical is imported for them."""
    heavy = "numpy scipy can cantools embreex lxml asammdf polars matplotlib"
    code = f"import sys, vsensor.cli; print([name for name in {heavy.split()} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "[]\n"
