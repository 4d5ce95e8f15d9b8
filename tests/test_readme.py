"""README is true: its commands run, its scenarios load, its tables name what there is."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
import threading
import time
import tomllib
from pathlib import Path

import cantools
import msgspec
import numpy as np
import pytest

from tests.shared import SHARED_DATA
from tests.vehicle_frames import Gateway
from tests.video.boards import write_boards
from tools.made_drives import drive_cells, made
from vsensor.bus import open_bus
from vsensor.camera import CameraConfig
from vsensor.cli import main
from vsensor.config import SHIPPED, ScenarioConfig
from vsensor.sinks.trace_file import COLUMNS, SCHEMA
from vsensor.types import SIDE_NAMES, Frame, Unseen

pytestmark = pytest.mark.timeout(1800)  # one fixture runs some fifty commands
ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TOLERANCE_M = 0.002
"""Of the score in README, and 2 %: another processor may round a seldom point to another pixel."""

OTHER_DBC = """
VERSION ""
BS_:
BU_: CAM
BO_ 1536 LANE_LEFT: 8 CAM
 SG_ POS : 0|16@1- (0.001,0) [-32|32] "m" CAM
 SG_ CURV : 16|16@1- (1e-06,0) [-0.03|0.03] "1/m" CAM
 SG_ VALID : 32|1@1+ (1,0) [0|1] "" CAM
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 1536 40;
"""


REAL_VIDEO = SHARED_DATA / "camera/carnd_lanelines/solidWhiteRight.mp4"
"""README's video of one's own; without it its commands are not run, except that CI wants all."""


def blocks(language):
    """Return the fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def commands():
    """Return every command of the sh blocks as one line."""
    return [line.strip() for block in blocks("sh") for line in block.splitlines() if line.strip()]


def table(header):
    """Return the rows of the table that begins with this header line, as lists of cells."""
    rows = README[README.index(header) :].split("\n\n", 1)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip().strip("|").split(" | ")] for row in rows]


def codes(text):
    """Return the words in backticks."""
    return re.findall(r"`([^`]+)`", text)


def write_drive(path):
    """Write 8 s of vehicle.dbc's motion frames: 20 m/s, a gentle bend, as some logger would."""
    gateway, lines = Gateway(), []
    for index in range(400):
        frame = gateway.motion(0, 20.0, np.radians(0.5))
        lines.append(
            f"({1000 + index * 0.02:.6f}) can0 {frame.arbitration_id:03X}#{frame.data.hex().upper()}\n"
        )
    path.write_text("".join(lines))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with what README calls yours: a map, a log, a DBC, and the files that it shows."""
    path = tmp_path_factory.mktemp("readme")
    shutil.copy(SHIPPED / "highway.xodr", path / "mine.xodr")
    write_drive(path / "drive.log")
    (path / "other.dbc").write_text(OTHER_DBC.lstrip())
    for block in blocks("toml"):
        name = re.match(r"# (\S+\.toml)\n", block)
        assert name, f"a toml block without its name:\n{block}"
        (path / name[1]).write_text(block, encoding="utf-8")
    for block in blocks("xml"):
        name = re.match(r"<!-- (\S+\.xosc) -->\n", block)
        assert name, f"an xml block without its name:\n{block}"
        (path / name[1]).write_text(block, encoding="utf-8")
    make_logs(path)
    if REAL_VIDEO.exists() or os.environ.get("CI"):
        shutil.copy(REAL_VIDEO, path / "drive.mp4")
    write_boards(path / "boards", CameraConfig(width_px=320, height_px=240), count=5)
    return path


def make_logs(path):
    """Lay drives of a known law at 75 to 80 km/h: five of a minute to learn from, two to judge by."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tools.made_drives.SLOWEST_KMH", 75.0)
        patch.setattr("tools.made_drives.FASTEST_KMH", 80.0)
        for name, minutes, first in (("drives", 5, 1), ("later_drives", 2, 50)):
            for cell in drive_cells(path / name, minutes / 60.0, first_seed=first, drive_s=60.0):
                made(cell)
    later = path / "later_drives"
    words = ["scan", str(later), "--reference", "map", str(later / "map.xodr"), "--workers", "1", "--quiet"]
    assert main([*words, "--out", str(path / "later")]) == 0


def shortened(words):
    """Return the command; one in real time is cut to 1 s on a bus of this process."""
    if words[:2] == ["vsensor", "run"] and "--fast" not in words:
        words = [*words, "--bus", "virtual:readme", "--duration", "1"]
    if "--start-at" in words:
        words[words.index("--start-at") + 1] = str(time.time() + 1.0)
    return words


@contextlib.contextmanager
def awaited(words):
    """Send the frame that a command waits for again and again while it runs."""
    if "--wait-for" not in words:
        yield
        return
    over = threading.Event()
    arbitration_id = int(words[words.index("--wait-for") + 1], 16)

    def send():
        with open_bus(words[words.index("--bus") + 1]) as bus:
            while not over.wait(0.05):
                bus.send(Frame(due_ns=0, arbitration_id=arbitration_id, data=b""))
                bus.drain()

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        over.set()
        sender.join()


@pytest.fixture(scope="module")
def results(folder):
    """Every vsensor command of README, run in order in one folder: {command: (status, stdout)}."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for command in commands():
            if command.startswith("vsensor ") and ("drive.mp4" not in command or Path("drive.mp4").exists()):
                words, _, target = command.partition(" > ")
                with awaited(shlex.split(words)):
                    found[command] = ran(shortened(shlex.split(words))[1:])
                if target:
                    (folder / target).write_text(found[command][1])
    return found


def ran(words):
    """Return status, output and errors of a command, run in this process: nothing is imported twice."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(words)
        except SystemExit as exit_:
            status = exit_.code
    return status, out.getvalue(), err.getvalue()


OFFERED = (
    *("run", "check", "decode", "convert", "log", "score", "accept", "sweep", "experiment", "replay"),
    *("gateway", "profile", "monitor", "examine"),
    *("scan", "table", "tune", "validate", "density", "influence", "road", "video"),
)
VSENSOR = [command for command in commands() if command.startswith("vsensor ")]
MAKE = [command for command in commands() if command.startswith("make ")]
VCAN = [command for command in commands() if command.startswith("tools/vcan ")]


def test_every_command_of_readme_is_of_a_kind_that_is_tested():
    assert sorted(commands()) == sorted([*VSENSOR, *MAKE, *VCAN])
    assert {command.split()[1] for command in VSENSOR} == set(OFFERED)
    assert MAKE
    assert VCAN


def test_every_vsensor_command_of_readme_runs(results):
    assert {command: said[2] for command, said in results.items() if said[0] != 0} == {}


def test_the_files_that_the_commands_name_are_written(results, folder):
    named = [name for command in results for name in re.findall(r"(?:--log|--trace|>) (\S+)", command)]
    assert named
    for name in named:
        assert (folder / name).stat().st_size > 1000, name


@pytest.mark.parametrize(
    "command", [*MAKE, *(f"make {n}" for n in re.findall(r"^\| `make (\w+)`", README, re.M))]
)
def test_a_make_target_of_readme_exists(command):
    done = subprocess.run(["make", "-n", *command.split()[1:]], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_readme_names_every_make_target():
    targets = re.search(r"^\.PHONY: (.*)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split()
    assert set(re.findall(r"^\| `make (\w+)`", README, re.MULTILINE)) == set(targets) - {"help"}


@pytest.mark.vcan
@pytest.mark.parametrize("command", VCAN)
def test_a_command_of_readme_runs_on_vcan(command):
    tool, program, *rest = shlex.split(command)
    assert program == ".venv/bin/vsensor"
    words = [tool, sys.executable, "-m", "vsensor.cli", *rest]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert re.search(r"frames sent [1-9]", done.stdout)


TEST_FILES = [block for block in blocks("python") if block.startswith("# test_")]
PROGRAMS = [block for block in blocks("python") if block not in TEST_FILES]
WRITTEN = re.compile(r'Path\("([^"]+)"\)\.write_')


@pytest.mark.parametrize("number", range(len(TEST_FILES)))
def test_a_test_file_of_readme_passes(number, folder):
    name = TEST_FILES[number].split()[1]
    (folder / name).write_text(TEST_FILES[number], encoding="utf-8")
    options = ["-q", "-p", "no:cacheprovider", "-p", "no:dash"]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "pytest", *options, name],
        cwd=folder,
        env=dict(os.environ, PYTHONPATH=str(ROOT)),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{TEST_FILES[number].count('def test_')} passed" in done.stdout


@pytest.mark.parametrize("number", range(len(PROGRAMS)))
def test_the_python_of_readme_runs(number, folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAMS[number]],
        cwd=folder,
        env=dict(os.environ, PYTHONPATH=str(ROOT)),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    written = WRITTEN.findall(PROGRAMS[number])
    assert all((folder / name).stat().st_size for name in written)
    assert written or ("320#" in done.stdout and "lane.width_m" in done.stdout)


def default_shown(field):
    """Return the default of a field as the table shows it."""
    if field.required:
        return "required"
    default = field.default
    if default is msgspec.NODEFAULT:
        default = field.default_factory()
    if default is None:
        return "-"
    return list(default) if isinstance(default, tuple) else default


def keys_of(struct):
    """Return {(section, key): default} of a scenario, in order."""
    return keys_within(msgspec.inspect.type_info(struct), "(top)", "")


def keys_within(struct, section, prefix):
    """Return {(section, key): default} of a struct and of the sections inside it."""
    found = {}
    for field in struct.fields:
        kind, name = field.type, prefix + field.encode_name
        inner = f"[{name}]"
        if isinstance(kind, msgspec.inspect.VarTupleType):
            inner, kind = f"[{inner}]", kind.item_type
        if isinstance(kind, msgspec.inspect.StructType):
            found |= keys_within(kind, inner, f"{name}.")
        else:
            found[section, field.encode_name] = default_shown(field)
    return found


def keys_of_readme():
    """Return {(section, key): default} of the table."""
    found = {}
    for section, key, default, _ in table("| section | key | default | what |"):
        value = default.strip("`")
        is_literal = default.startswith("`")
        place = section.strip("`"), key.strip("`")
        assert place not in found, f"{place} twice"
        found[place] = tomllib.loads(f"x = {value}")["x"] if is_literal else value
    return found


def test_the_table_of_keys_has_every_key_of_a_scenario_with_its_default_and_no_other():
    assert keys_of_readme() == keys_of(ScenarioConfig)


def road_keys(struct, without=None):
    """Return {key: default} of a road file's table, less what it has of another one, as README shows it."""
    known = {} if without is None else road_keys(without)
    shown = {field.encode_name: default_shown(field) for field in msgspec.inspect.type_info(struct).fields}
    return {key: value for key, value in shown.items() if known.get(key, "-") != value or key not in known}


def test_the_table_of_a_road_file_has_every_key_with_its_default_and_no_other():
    from vsensor.motion import BumpConfig
    from vsensor.world import road as built

    expected = {
        "file": road_keys(built.RoadFile),
        "road": road_keys(built.RoadConfig) | {"right": "-"},
        "straight": road_keys(built.Straight),
        "arc": road_keys(built.Arc),
        "clothoid": road_keys(built.Clothoid),
        "bend": road_keys(built.Bend),
        "lane": road_keys(built.LaneConfig),
        "paint of a lane or `centre`": road_keys(built.PaintConfig),
        "elevation": road_keys(built.GradeConfig),
        "`paint`": road_keys(built.StretchConfig, built.PaintConfig),
        "`gap`": road_keys(built.GapConfig),
        "`ghost`": road_keys(built.GhostConfig, built.PaintConfig),
        "`construction`": road_keys(built.ConstructionConfig, built.PaintConfig),
        "`crosswalk`": road_keys(built.CrosswalkConfig),
        "`stop_line`": road_keys(built.StopLineConfig),
        "`bump`": road_keys(BumpConfig),
        "`rough`": road_keys(built.RoughConfig),
        "`after`, `before`": road_keys(built.LinkConfig),
    }
    found = {}
    for name, keys, _ in table("| table | keys with their defaults | what |"):
        words = [word.partition(" = ") for word in codes(keys)]
        found[name] = {key: tomllib.loads(f"x = {value}")["x"] if value else "-" for key, _, value in words}
    for keys in expected.values():
        keys.update({key: "-" for key, value in keys.items() if value == "required"})
    assert found == expected


def test_the_table_of_trace_columns_is_that_of_the_file():
    said = [name for row in table("| column of the trace | unit | what |") for name in codes(row[0])]
    assert sorted(said) == sorted(COLUMNS)


def test_the_columns_of_the_table_of_errors_are_those_of_the_program():
    from vsensor.field.table import COLUMNS as ERRORS

    said = [name for row in table("| column of the table | unit | what |") for name in codes(row[0])]
    assert said == list(ERRORS)


def test_the_limits_of_a_scan_are_those_of_the_program_with_their_defaults():
    from vsensor.field.config import ScanLimits

    said = {codes(row[0])[0]: row[1].strip("`") for row in table("| limit of a scan | default | what |")}
    fields = msgspec.inspect.type_info(ScanLimits).fields
    assert list(said) == [field.encode_name for field in fields]
    for field in fields:
        if field.encode_name != "vehicle":
            assert tomllib.loads(f"x = {said[field.encode_name]}")["x"] == field.default


def test_the_limits_of_a_validation_are_those_of_the_program_with_their_defaults():
    from vsensor.field.validate.verdict import ValidateLimits

    said = {
        codes(row[0])[0]: float(row[1].strip("`"))
        for row in table("| limit of a validation | default | what |")
    }
    assert said == {one.encode_name: one.default for one in msgspec.inspect.type_info(ValidateLimits).fields}


def test_the_codes_of_the_trace_are_those_of_the_program():
    said = {codes(row[0])[0]: row[2] for row in table("| column of the trace | unit | what |")}
    sides = ", ".join(f"{side.value} {name.replace('_', ' ')}" for side, name in SIDE_NAMES.items())
    assert said["side"] == sides
    reasons = ", ".join(f"{reason.value} {reason.name.lower().replace('_', ' ')}" for reason in Unseen)
    assert said["reason_unseen"] == reasons


def test_the_schemas_are_those_of_the_program():
    from vsensor.accept import SCHEMA as LIMITS
    from vsensor.config import CAMERA_SCHEMA as CAMERA
    from vsensor.config import SCHEMA as SCENARIO
    from vsensor.error_model import SCHEMA as ERROR_MODEL
    from vsensor.experiment.matrix import SCHEMA as EXPERIMENT
    from vsensor.field.config import SCHEMA as SCAN
    from vsensor.field.table import SCHEMA as TABLE
    from vsensor.field.validate.verdict import SCHEMA as VALIDATE
    from vsensor.profile import SCHEMA as PROFILE
    from vsensor.sinks.truth_points import SCHEMA as POINTS
    from vsensor.video.event_folder import SCHEMA as EVENT
    from vsensor.video.events import SCHEMA as EVENTS
    from vsensor.video.labels import SCHEMA as LABELS
    from vsensor.video.settings import SCHEMA as VIDEO
    from vsensor.world.road import SCHEMA as ROAD

    said = {codes(row[1])[0] for row in table("| file | schema | what |")}
    others = {LIMITS, SCAN, VALIDATE, TABLE, SCHEMA, POINTS, EXPERIMENT, ROAD}
    videos = {CAMERA, EVENT, EVENTS, VIDEO, LABELS}
    assert said == {SCENARIO, PROFILE, ERROR_MODEL} | others | videos


def test_the_frame_table_has_the_messages_of_the_native_dbc_with_their_ids():
    rows = table("| id | message | cycle | carries |")
    said = {
        name: int(number, 16)
        for row in rows
        for number, name in zip(row[0].split(", "), codes(row[1]), strict=True)
    }
    database = cantools.database.load_file(ROOT / "dbc" / "lds.dbc")
    assert said == {message.name: message.frame_id for message in database.messages}
    assert {row[2] for row in rows} == {f"{database.messages[0].cycle_time} ms"}


def numbers(line):
    return [float(word) for word in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?", line)]


def words_of(line):
    return re.sub(r"(?<![\w.])-?\d+(?:\.\d+)?", "#", " ".join(line.split()))


def test_the_score_in_readme_is_what_the_command_prints(results):
    shown = next(block for block in blocks("text") if "lateral error in m" in block)
    printed = results["vsensor score out.npz"][1].splitlines()
    for line in filter(None, shown.splitlines()):
        same = [other for other in printed if words_of(other) == words_of(line)]
        near = [o for o in same if np.allclose(numbers(o), numbers(line), atol=TOLERANCE_M, rtol=0.02)]
        assert near, f"README shows {line!r}; printed:\n" + "\n".join(printed)


def offered_by(capsys, *command):
    """Return the commands that `--help` lists."""
    with pytest.raises(SystemExit):
        main([*command, "--help"])
    return re.findall(r"^    (\w+)(?:  |$)", capsys.readouterr().out, re.MULTILINE)


def test_the_commands_table_has_every_command_of_the_program(capsys):
    offered = offered_by(capsys)
    said = [codes(row[0])[0].split()[1] for row in table("| command | what it does |")]
    assert said == offered


def test_every_option_that_readme_names_is_one_of_the_program(capsys):
    offered = {"--seconds"}
    videos = [("video", sub) for sub in offered_by(capsys, "video")]
    for command in [*((one,) for one in OFFERED), ("profile", "new"), *videos]:
        with pytest.raises(SystemExit):
            main([*command, "--help"])
        offered |= set(re.findall(r"--[a-z]+", capsys.readouterr().out))
    assert set(re.findall(r"(?<![\w-])--[a-z]+", README)) <= offered


def test_every_link_in_readme_leads_somewhere():
    for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", README):
        assert link.startswith("https://") or (ROOT / link).exists(), link


def test_every_place_in_readme_exists():
    for row in table("| place | what |"):
        first, *others = codes(row[0])
        for path in (ROOT / first, *((ROOT / first).parent / name for name in others)):
            assert path.exists(), path


def test_the_table_of_places_has_every_module():
    said = {Path(name).name for row in table("| place | what |") for name in codes(row[0])}
    modules = {path.name for path in (ROOT / "vsensor").iterdir() if not path.name.startswith("_")}
    modules -= {"py.typed"}
    assert modules <= said, sorted(modules - said)


def test_the_picture_is_small_enough_to_load():
    assert 50_000 < (ROOT / "docs" / "run.png").stat().st_size < 300_000


def test_readme_names_no_place_of_one_machine():
    for word in ("/work", "/tmp", "/root", "/home"):
        assert word not in README, textwrap.shorten(README[README.find(word) :], 60)


def test_the_table_of_error_model_entries_has_every_entry_and_no_other():
    from vsensor.error_model.checks import KEYS

    said = [name for row in table("| entry of an error model | shape | what |") for name in codes(row[0])]
    assert sorted(said) == sorted(KEYS)
