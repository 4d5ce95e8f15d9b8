"""tools/vcan itself, run as a user would; inside a vcan (see the last tests) it just runs the command."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from functools import cache
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "vcan"


def vcan(*command, **options):
    return subprocess.run(
        [TOOL, *command], capture_output=True, text=True, check=False, timeout=120, **options
    )


HEARING = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""


def started(*command):
    """Start the tool so that it hears Ctrl-C, which all that a shell runs in the background would ignore."""
    words = [sys.executable, "-c", HEARING, TOOL, *command]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def folders_of(process):
    """Return the folders that the kernels of a running tool work in; others may run beside it."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    said = [Path(f"/proc/{child}/cmdline").read_text(errors="replace") for child in children]
    return {Path(name) for text in said for name in re.findall(r"/tmp/vcan-[^/\0 ]+", text)}


@pytest.fixture(scope="module")
def _tool_works():
    done = vcan("true")
    if done.returncode == 3 and not os.environ.get("CI"):
        pytest.skip(done.stderr.strip())


pytestmark = pytest.mark.usefixtures("_tool_works")


WORDS = ["two words", "it's", '"quoted"', "$HOME", "", "new\nline", "ü"]
LOOK = """
import json, os, sys
from pathlib import Path
flags = [Path("/sys/class/net", name, "flags").read_text() for name in ("vcan0", "vcan1")]
Path("file").write_text("written")
print("problem", file=sys.stderr)
print(json.dumps([flags, sys.argv[1:], os.getcwd(), os.environ["VCAN_TEST"], sys.stdin.read()]))
"""


@pytest.fixture(scope="module")
def look(tmp_path_factory):
    """What a command inside sees, said by itself, and its folder: a kernel is started once for all of it."""
    folder = tmp_path_factory.mktemp("inside") / "a folder's name"
    folder.mkdir()
    environment = {**os.environ, "VCAN_TEST": "x\ny"}
    done = vcan(sys.executable, "-c", LOOK, *WORDS, cwd=folder, env=environment, input="not passed on")
    return done, folder


def test_both_interfaces_are_up_and_output_and_error_stay_apart(look):
    done, _ = look
    assert [int(flags, 16) & 1 for flags in json.loads(done.stdout)[0]] == [1, 1]
    assert done.stderr == "problem\n"
    assert done.returncode == 0


def test_arguments_folder_and_environment_arrive_unchanged(look):
    done, folder = look
    assert json.loads(done.stdout)[1:4] == [WORDS, str(folder), "x\ny"]


def test_standard_input_is_empty(look):
    assert json.loads(look[0].stdout)[4] == ""


def test_files_written_are_on_the_host_at_once(look):
    assert (look[1] / "file").read_text() == "written"


@pytest.mark.parametrize(
    ("command", "status"),
    [
        (["sh", "-c", "exit 7"], 7),
        (["sh", "-c", "kill -TERM $$"], 128 + signal.SIGTERM),
        (["/no/such/program"], 127),
        (["/etc/passwd"], 126),
    ],
    ids=["exit 7", "ended by a signal", "no such program", "no program"],
)
def test_exit_status_is_that_of_the_command(command, status):
    assert vcan(*command).returncode % 256 == status % 256


def test_a_million_bytes_of_any_value_arrive_in_order():
    script = "import sys; sys.stdout.buffer.write(bytes(range(256)) * 4096)"
    done = subprocess.run([TOOL, sys.executable, "-c", script], capture_output=True, check=False, timeout=120)
    assert done.stdout == bytes(range(256)) * 4096


@pytest.mark.parametrize(
    ("number", "on_signal", "status"),
    [
        (signal.SIGINT, "except KeyboardInterrupt: print('summary'); sys.exit(5)", 5),
        (signal.SIGTERM, "finally: pass", 128 + signal.SIGTERM),
    ],
    ids=["Ctrl-C", "SIGTERM"],
)
def test_signal_reaches_the_command_and_ends_both(number, on_signal, status):
    waits = "print('ready', flush=True); [time.sleep(0.1) for _ in iter(int, 1)]"  # a pause() may miss it
    script = f"import sys, time\ntry: {waits}\n{on_signal}"
    with started(sys.executable, "-c", script) as process:
        assert process.stdout.readline() == "ready\n"
        folders = folders_of(process)
        assert is_native() or all(folder.is_dir() for folder in folders)
        assert is_native() or len(folders) == 1
        process.send_signal(number)
        rest = process.communicate(timeout=60)[0]
    assert process.returncode % 256 == status % 256
    assert rest == ("summary\n" if number == signal.SIGINT else "")
    assert not any(folder.exists() for folder in folders)


def test_third_signal_ends_a_command_that_ignores_it():
    script = "trap '' INT; echo ready; while :; do sleep 1; done"
    with started("sh", "-c", script) as process:
        assert process.stdout.readline() == "ready\n"
        if is_native():
            process.kill()
            return
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
            with pytest.MonkeyPatch.context():
                try:
                    process.wait(timeout=0.3)
                except subprocess.TimeoutExpired:
                    continue
        assert process.returncode == 128 + signal.SIGINT


@cache
def is_native():
    return vcan("cat", "/proc/version").stdout == Path("/proc/version").read_text()


def test_two_run_at_once_without_seeing_each_others_bus():
    results = []
    threads = [threading.Thread(target=lambda: results.append(vcan("sh", "-c", "exit 4"))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [done.returncode for done in results] == [4, 4]


def test_reader_that_goes_away_ends_the_command():
    done = subprocess.run(
        ["bash", "-c", f"'{TOOL}' yes | head -1; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        check=False,
        timeout=120,
    )
    assert done.stdout == b"y\n"
    assert done.returncode == 128 + signal.SIGPIPE


def test_missing_package_is_said_with_the_command_to_type(tmp_path):
    if is_native():
        pytest.skip("this kernel has vcan, no package is needed")
    python = tmp_path / "python3"
    python.symlink_to(sys.executable)
    done = vcan("true", env={"PATH": str(tmp_path)})
    assert done.returncode == 3
    assert "apt-get install user-mode-linux kmod iproute2" in done.stderr
    assert done.stderr.count("\n") == 1


def test_without_a_command_the_usage_is_said():
    done = vcan()
    assert done.returncode == 2
    assert "tools/vcan COMMAND" in done.stderr


@pytest.mark.vcan
def test_where_vcan_is_up_the_command_replaces_the_tool():
    process = subprocess.Popen([TOOL, "sh", "-c", "echo $$"], stdout=subprocess.PIPE, text=True)
    assert int(process.communicate()[0]) == process.pid


@pytest.mark.vcan
def test_native_kernel_gets_its_interfaces_raised_by_root():
    subprocess.run(["ip", "link", "set", "vcan1", "down"], check=True)
    assert int(vcan("cat", "/sys/class/net/vcan1/flags").stdout, 16) & 1 == 1
