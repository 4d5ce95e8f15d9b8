"""What a client of the control socket may ask for, and what it is told."""

import json
import math
import socket
import subprocess
import sys

import pytest

from tests.control_clients import Client, close_all, loop, server
from vsensor.cli import main
from vsensor.control import answer, parse_address
from vsensor.errors import ConfigError


@pytest.fixture
def run():
    return loop()


@pytest.fixture
def client(run):
    with server() as opened:
        yield Client(opened, run)
        close_all()


def steps(run, ticks):
    for _ in range(ticks):
        run.step()
    return run.output


def test_a_fault_is_injected_and_happens_with_the_next_tick(client, run):
    steps(run, 10)
    assert client.ask(do="inject", kind="frame_lost", message="LDS_Lane", times=2) == {
        "ok": True,
        "number": 0,
    }
    assert [len(steps(run, 1).frames) for _ in range(3)] == [12, 12, 13]


def test_a_value_is_overridden_and_cleared(client, run):
    steps(run, 10)
    assert client.ask(do="override", quantity="left.offset_m", value=1.2) == {"ok": True, "number": 0}
    assert steps(run, 1).values["left.offset_m"] == 1.2
    assert client.ask(do="clear", number=0) == {"ok": True}
    assert steps(run, 1).values["left.offset_m"] != 1.2


def test_a_signal_is_overridden_by_value_or_raw(client, run):
    assert client.ask(do="override", signal="LaneWidth", value=3.0, times=1)["ok"]
    assert client.ask(do="override", signal="SensorState", raw=7)["ok"]
    steps(run, 1)
    told = [one["fault"] for one in client.ask(do="state")["faults"]]
    assert told == [
        "signal_value LaneWidth value 3 1 time",
        "signal_raw SensorState raw 7 until it is cleared",
    ]


def test_the_latest_values_are_read_with_null_for_not_available(client, run):
    output = steps(run, 1)
    found = client.ask(do="read")
    assert (found["ok"], found["tick"], found["t_s"]) == (True, 0, 0.0)
    assert math.isnan(output.values["left.offset_m"])
    assert found["values"]["left.offset_m"] is None
    assert found["values"]["image.index"] == 0.0
    assert client.ask(do="read", quantity="image.index") == {"ok": True, "tick": 0, "t_s": 0.0, "value": 0.0}


def test_the_state_tells_how_the_run_stands(client, run):
    assert client.ask(do="state")["sensor"] is None
    steps(run, 10)
    client.ask(do="inject", kind="sensor_blocked", at_s=0.44, for_s=1)
    steps(run, 1)
    assert client.ask(do="state") == {
        "ok": True,
        "tick": 11,
        "t_s": 0.44,
        "sensor": "available",
        "frames_sent": 11 * 13,
        "slots_dropped": 0,
        "faults": [{"number": 0, "fault": "sensor_blocked from 0.44 s for 1 s", "active": True}],
    }
    steps(run, 1)
    assert client.ask(do="state")["sensor"] == "blocked"


def test_stop_ends_the_run(client, run):
    assert not run.is_stopped
    assert client.ask(do="stop") == {"ok": True}
    assert run.is_stopped


def test_an_answer_carries_the_id_of_its_request(client):
    assert client.ask(do="state", id="a7")["id"] == "a7"
    assert client.ask(do="nothing", id=[1])["id"] == [1]


def test_answers_come_in_the_order_of_the_requests(client):
    client.send(b"".join(b'{"do": "state", "id": %d}\n' % number for number in range(50)))
    assert [found["id"] for found in client.answers(50)] == list(range(50))


WRONG = {
    b"x": "not JSON: ",
    b'{"do": "state"': "not JSON: ",
    b"\xff\xfe": "not JSON: ",
    b"[" * 5000: "not JSON: nested too deeply",
    b"1": "a JSON object was expected",
    b"null": "a JSON object was expected",
    b"{}": "do = None: one of inject, override, clear, read, state, stop was expected",
    b'{"do": ["state"]}': "do = ['state']: one of",
    b'{"do": "inject"}': "inject: ",
    b'{"do": "inject", "kind": "frame_lst"}': "did you mean frame_lost?",
    b'{"do": "inject", "kind": "frame_lost", "times": 1.5}': "inject: times = 1.5: expected `int",
    b'{"do": "inject", "kind": "frame_lost", "times": true}': "inject: times = True: expected `int",
    b'{"do": "override", "quantity": "left.offset_m", "value": NaN}': "NaN is no number",
    b'{"do": "override", "quantity": "left.offset_m", "value": 1e999}': "a finite number was expected",
    b'{"do": "override", "quantity": "left.offset_m", "value": "1"}': "expected `float",
    b'{"do": "override", "value": 1}': "override: quantity: override needs it",
    b'{"do": "clear", "number": "0"}': "clear: number = '0'",
    b'{"do": "clear", "number": true}': "clear: number = True",
    b'{"do": "clear", "all": 1}': "all: not known here; known: number",
    b'{"do": "read", "quantity": "left.ofset_m"}': "read: ",
    b'{"do": "stop", "now": 1}': "now: not known here",
}


@pytest.mark.parametrize("line", WRONG, ids=lambda line: line[:40].decode("ascii", "replace"))
def test_a_wrong_request_is_answered_in_one_line_and_changes_nothing(run, line):
    found = answer(line, run)
    assert found["ok"] is False
    assert WRONG[line] in found["error"]
    assert "\n" not in found["error"]
    json.dumps(found, allow_nan=False)
    run.step()
    assert run.state.faults.is_quiet
    assert not run.is_stopped


def test_before_the_first_tick_there_is_nothing_to_read(run):
    assert answer(b'{"do": "read"}', run) == {"ok": False, "error": "read: nothing was sent yet"}


@pytest.mark.parametrize(
    "text", ["0.0.0.0:5555", "10.0.0.1:80", "example.org:5555", "[::]:5555", "::1:5555", ":::9"]
)
def test_other_machines_have_no_access(text):
    with pytest.raises(ConfigError, match="loopback only"):
        parse_address(text)


@pytest.mark.parametrize("text", ["", "x", "65536", "-1", "127.0.0.1", "127.0.0.1:", "unix:", "٣", "1.5"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(ConfigError, match="was expected"):
        parse_address(text)


@pytest.mark.parametrize("text", ["5555", ":5555", "127.0.0.1:5555", "localhost:5555"])
def test_a_port_is_one_of_the_loopback_interface(text):
    assert parse_address(text).port == 5555


def test_the_socket_is_bound_to_the_loopback_interface_alone(client):
    assert client.socket.getpeername()[0] == "127.0.0.1"
    assert client.server._socket.getsockname()[0] == "127.0.0.1"


def test_a_run_without_the_option_opens_no_socket(monkeypatch, capsys):
    from vsensor import control

    monkeypatch.setattr(control, "ControlServer", None)
    assert main(["run", "--fast", "--duration", "1"]) == 0
    assert "control" not in capsys.readouterr().err


def test_a_run_says_where_its_socket_is_and_takes_it_away(tmp_path, capsys):
    path = tmp_path / "s"
    assert main(["run", "--fast", "--duration", "1", "--control", f"unix:{path}"]) == 0
    assert f"control at unix:{path}" in capsys.readouterr().err
    assert not path.exists()


def test_another_program_stops_a_run_that_never_ends(tmp_path):
    path = tmp_path / "socket"
    words = ["run", "--bus", "virtual:control", "--quiet", "--duration", "600", "--control", f"unix:{path}"]
    with subprocess.Popen(
        [sys.executable, "-m", "vsensor.cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            while f"control at unix:{path}" not in process.stderr.readline():
                assert process.poll() is None, "the run ended before it listened"
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
                client.settimeout(60)
                client.connect(str(path))
                client.sendall(b'{"do": "inject", "kind": "bus_off"}\n{"do": "stop"}\n')
                with client.makefile() as answers:
                    assert [json.loads(answers.readline())["ok"] for _ in range(2)] == [True, True]
            out, _ = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 0
    assert "slots dropped" in out
