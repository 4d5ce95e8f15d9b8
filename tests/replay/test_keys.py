"""Keys on a real pseudo-terminal, and the terminal afterwards."""

import os
import pty
import select
import signal
import subprocess
import sys
import termios
from pathlib import Path

import pytest

from vsensor.replay.keys import split_keys, terminal_keys

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("sent", "keys", "rest"),
    [
        (b" ", [" "], b""),
        (b"s\x1b[Cq", ["s", "right", "q"], b""),
        (b"\x1bOD\x1b[D", ["left", "left"], b""),
        (b"a\x1b[", ["a"], b"\x1b["),
        (b"\x1b", [], b"\x1b"),
        (b"\x1b[A", ["\x1b", "[", "A"], b""),
        (b"\xff", ["\xff"], b""),
    ],
)
def test_what_a_terminal_sends_is_split_into_keys(sent, keys, rest):
    assert split_keys(sent) == (keys, rest)


def test_an_arrow_cut_in_two_is_one_key():
    keys, rest = split_keys(b"s\x1b[")
    assert (keys, split_keys(rest + b"C")) == (["s"], (["right"], b""))


def test_where_no_terminal_is_there_are_no_keys():
    read, write = os.pipe()
    with terminal_keys(read) as keys:
        assert keys is None
    os.close(read)
    os.close(write)


PROGRAM = """
import sys, time
from vsensor.replay.keys import terminal_keys
with terminal_keys() as keys:
    print("ready", flush=True)
    while True:
        for key in keys():
            print(repr(key), flush=True)
            if key == "q":
                sys.exit(0)
            if key == "e":
                raise RuntimeError("on purpose")
        time.sleep(0.005)
"""


@pytest.fixture
def terminal():
    """A program that reads keys on a terminal of its own; yields (process, our end, their end)."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM],
        stdin=theirs,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
        env=dict(os.environ, PYTHONPATH=str(ROOT)),
        start_new_session=True,
        preexec_fn=lambda: __import__("fcntl").ioctl(0, termios.TIOCSCTTY, 0),
    )
    yield process, ours, theirs
    process.kill()
    process.wait()
    os.close(ours)
    os.close(theirs)


def until(ours, text):
    """What the terminal shows, up to `text`."""
    seen = b""
    while text not in seen:
        assert select.select([ours], [], [], 30)[0], seen
        seen += os.read(ours, 1024)
    return seen


def modes(fd):
    return termios.tcgetattr(fd)[3] & (termios.ICANON | termios.ECHO)


def test_keys_arrive_without_enter_and_are_not_shown(terminal):
    process, ours, theirs = terminal
    until(ours, b"ready")
    assert modes(theirs) == 0
    os.write(ours, b"s\x1b[C")
    assert b"^[" not in until(ours, b"'right'")
    os.write(ours, b"q")
    assert process.wait(30) == 0


@pytest.mark.parametrize("end", [b"q", b"e", signal.SIGINT])
def test_the_terminal_is_as_before_however_the_program_ends(terminal, end):
    process, ours, theirs = terminal
    before = modes(theirs)
    until(ours, b"ready")
    assert modes(theirs) != before
    if isinstance(end, bytes):
        os.write(ours, end)
    else:
        process.send_signal(end)
    process.wait(30)
    assert modes(theirs) == before == termios.ICANON | termios.ECHO


def test_ctrl_z_gives_the_terminal_back_and_coming_back_takes_it_again(terminal):
    process, ours, theirs = terminal
    until(ours, b"ready")
    process.send_signal(signal.SIGTSTP)
    for _ in range(2000):
        if modes(theirs):
            break
        select.select([], [], [], 0.01)
    assert modes(theirs) == termios.ICANON | termios.ECHO
    process.send_signal(signal.SIGCONT)
    for _ in range(2000):
        if not modes(theirs):
            break
        select.select([], [], [], 0.01)
    os.write(ours, b"q")
    assert process.wait(30) == 0
