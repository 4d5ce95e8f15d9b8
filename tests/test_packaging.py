"""The wheel, installed where nothing of this checkout is in reach, runs from another folder."""

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy so that nothing is written into the checkout; without the network."""
    import shutil

    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    tracked = ["vsensor", "dbc", "pyproject.toml", "README.md", "LICENSE", ".gitignore"]
    for name in tracked:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, source / name, **({"symlinks": True} if copy is shutil.copytree else {}))
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    ]
    subprocess.run([*command, "--wheel-dir", folder, source], check=True, stdin=subprocess.DEVNULL)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def program(wheel, tmp_path_factory):
    """`vsensor` in an environment of its own; only the libraries are those of this one.

    They are reached by a .pth file, whose own .pth files (that of the editable install) do not count.
    """
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    site = folder / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"
    command = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet"]
    subprocess.run([*command, "--no-deps", "--no-index", wheel], check=True, stdin=subprocess.DEVNULL)
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder / "bin" / "vsensor"


@pytest.fixture
def vsensor(program, tmp_path):
    """Run a command of the installed program in an empty folder."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}

    def run(*arguments):
        return subprocess.run(
            [program, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )

    return run


def names_in(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.mark.parametrize("folder", ["dbc", "vsensor"])
def test_wheel_holds_every_file_of_a_folder(wheel, folder):
    skipped = {"__pycache__", ".gitkeep"}
    files = [file for file in (ROOT / folder).rglob("*") if file.is_file() and not skipped & set(file.parts)]
    prefix = "vsensor/dbc" if folder == "dbc" else "vsensor"
    expected = {f"{prefix}/{file.relative_to(ROOT / folder)}" for file in files}
    assert expected - names_in(wheel) == set()


def test_wheel_holds_databases_profiles_scenarios_and_the_typed_marker(wheel):
    """Named once each, so that an empty folder does not pass for a full one."""
    expected = {"dbc/lds.dbc", "dbc/vehicle.dbc", "dbc/native.toml", "scenarios/highway.toml", "py.typed"}
    assert {f"vsensor/{name}" for name in expected} <= names_in(wheel)


def test_wheel_holds_nothing_but_the_package(wheel):
    assert {name.split("/")[0].split("-")[0] for name in names_in(wheel)} == {"vsensor"}


def test_installed_package_is_not_the_checkout(program):
    code = "import vsensor; print(vsensor.__file__)"
    done = subprocess.run(
        [program.with_name("python"), "-I", "-c", code], capture_output=True, text=True, check=True
    )
    assert Path(done.stdout.strip()).is_relative_to(program.parents[1])


@pytest.mark.parametrize("command", [[], ["run"], ["check"], ["decode"], ["score"]], ids=" ".join)
def test_every_command_explains_itself(vsensor, command):
    done = vsensor(*command, "--help")
    assert done.returncode == 0
    assert "usage: vsensor" in done.stdout


def test_installed_program_runs_the_shipped_scenario_from_another_folder(vsensor):
    done = vsensor("run", "--fast", "--duration", "1")
    assert (done.returncode, done.stderr) == (0, "vsensor: drive from road 1, lane -3\n")
    assert "25 ticks of 40 ms" in done.stdout


def test_installed_program_checks_the_shipped_scenario(vsensor, program):
    (scenario,) = program.parents[1].rglob("scenarios/highway.toml")
    done = vsensor("check", str(scenario))
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_requirement_is_pinned_and_no_index_is_named():
    lines = [line for line in (ROOT / "constraints.txt").read_text().splitlines() if not line.startswith("#")]
    pins = {re.fullmatch(r"([a-z0-9-]+)==[^\s;]+( ; .+)?", line)[1] for line in lines}
    extras = PROJECT["optional-dependencies"].values()
    wanted = [text for texts in (PROJECT["dependencies"], *extras) for text in texts]
    names = {re.match(r"[\w-]+", text)[0].lower() for text in wanted}
    assert names - pins == {"vsensor"}


def test_every_requirement_says_why_it_is_there():
    """Each line of a library in pyproject has its reason beside it."""
    lines = (ROOT / "pyproject.toml").read_text().splitlines()
    libraries = [
        line for line in lines if re.match(r'\s*(\w+ = \[)?"[\w-]+>=', line) and "requires =" not in line
    ]
    assert len(libraries) >= len(PROJECT["dependencies"])
    without = [
        line
        for line in libraries
        if "#" not in line and "lxml-stubs" not in line and "types-tqdm" not in line
    ]
    assert without == []
