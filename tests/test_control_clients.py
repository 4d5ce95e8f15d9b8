"""Clients that misbehave: none delays the run, none disturbs another, none brings it down."""

import json
import socket
import stat

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.control_clients import Client, close_all, loop, server
from vsensor.control.server import LONGEST_LINE, MOST_CLIENTS, MOST_LINES, SKIPPED
from vsensor.errors import ConfigError

STATE = b'{"do": "state"}\n'


@pytest.fixture(scope="module")
def run():
    return loop()


@pytest.fixture(autouse=True)
def closed():
    """Close all clients after a test."""
    yield
    close_all()


@pytest.fixture
def opened():
    with server() as found:
        yield found


def test_several_clients_are_each_answered(opened, run):
    clients = [Client(opened, run) for _ in range(MOST_CLIENTS)]
    for number, client in enumerate(clients):
        client.send(b'{"do": "state", "id": %d}\n' % number)
    assert [client.answers()[0]["id"] for client in clients] == list(range(MOST_CLIENTS))


def test_one_client_too_many_is_told_so_and_may_come_when_another_has_gone(opened, run):
    clients = [Client(opened, run) for _ in range(MOST_CLIENTS)]
    assert clients[0].ask(do="state")["ok"]
    late = Client(opened, run)
    late.send(STATE)
    assert late.answers() == [{"ok": False, "error": "8 clients are connected, there is no room"}]
    assert late.is_closed()
    clients[0].close()
    assert Client(opened, run).ask(do="state")["ok"]


def test_who_comes_as_another_goes_finds_its_room(opened, run):
    clients = [Client(opened, run) for _ in range(MOST_CLIENTS)]
    assert clients[-1].ask(do="state")["ok"]
    clients[3].close()
    assert Client(opened, run).ask(do="state")["ok"]
    assert clients[-1].ask(do="state")["ok"]


def test_busy_clients_leave_each_its_turn(opened, run):
    """Eight that ask without end: each is answered, none more than a poll's share later than another."""
    clients = [Client(opened, run) for _ in range(MOST_CLIENTS)]
    for client in clients:
        client.send(STATE * 40)
    for _ in range(10):
        opened.poll(run)
    for client in clients:
        client.socket.settimeout(5)
        assert client.socket.recv(1 << 20).count(b"\n") >= 10


def test_a_line_in_pieces_is_one_request(opened, run):
    client = Client(opened, run)
    for place in range(len(STATE)):
        client.send(STATE[place : place + 1])
        opened.poll(run)
    assert client.answers()[0]["ok"]


def test_a_line_ends_as_windows_ends_it_too(opened, run):
    client = Client(opened, run)
    client.send(b'{"do": "state"}\r\n\r\n')
    assert client.answers() == [client.ask(do="state")]


def test_a_line_that_never_ends_is_refused_once_and_the_next_one_counts(opened, run):
    client = Client(opened, run)
    client.send(b"x" * (5 * LONGEST_LINE) + b"\n" + STATE)
    first, second = client.answers(2)
    assert first == {"ok": False, "error": f"a line longer than {LONGEST_LINE} bytes"}
    assert second["ok"]


def test_a_line_of_ten_megabytes_is_over_in_a_second_of_cycles_and_holds_no_memory(opened, run):
    client, other = Client(opened, run), Client(opened, run)
    client.socket.setblocking(False)
    rest = memoryview(b"x" * 10_000_000 + b"\n" + STATE)
    for _ in range(200):
        while rest:
            try:
                rest = rest[client.socket.send(rest) :]
            except BlockingIOError:
                break
        opened.poll(run)
        assert sum(len(one.incoming) for one in opened._clients) <= SKIPPED + LONGEST_LINE
        if not rest:
            break
    assert not rest
    first, second = client.answers(2)
    assert (first["ok"], second["ok"]) == (False, True)
    assert other.ask(do="state")["ok"]


def test_a_line_of_the_greatest_length_is_still_read(opened, run):
    client = Client(opened, run)
    client.send(STATE.rstrip().ljust(LONGEST_LINE) + b"\n")
    assert client.answers()[0]["ok"]


def test_a_flood_is_answered_in_bounded_parts_and_others_meanwhile(opened, run):
    flood, other = Client(opened, run), Client(opened, run)
    flood.send(STATE * 300)
    other.send(STATE)
    opened.poll(run)
    other.socket.settimeout(5)
    assert json.loads(other.socket.recv(4096))["ok"]
    flood.socket.settimeout(5)
    assert flood.socket.recv(1 << 20).count(b"\n") <= MOST_LINES


def test_a_client_that_does_not_read_is_no_burden(opened, run):
    run.step()
    deaf, other = Client(opened, run), Client(opened, run)
    deaf.socket.setblocking(False)
    for _ in range(3000):
        try:
            deaf.socket.send(b'{"do": "read"}\n' * 100)
        except BlockingIOError:
            break
        opened.poll(run)
    else:
        pytest.fail("what it sends is taken without end")
    held = sum(len(client.outgoing) + len(client.incoming) for client in opened._clients)
    assert held < 200_000
    assert other.ask(do="state")["ok"]


@pytest.mark.parametrize("data", [b"", b'{"do": "st', STATE * 20, b"\xff" * 100])
def test_a_client_that_goes_in_the_middle_of_a_line_is_forgotten(opened, run, data):
    client = Client(opened, run)
    client.send(data)
    client.close()
    for _ in range(10):
        opened.poll(run)
    assert opened._clients == []


def test_a_client_that_resets_its_connection_is_forgotten(opened, run):
    client = Client(opened, run)
    client.send(STATE)
    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00")
    client.close()
    for _ in range(10):
        opened.poll(run)
    assert opened._clients == []


def test_who_says_all_and_then_ends_is_still_answered(opened, run):
    client = Client(opened, run)
    client.send(STATE * 20)
    client.socket.shutdown(socket.SHUT_WR)
    assert len(client.answers(20)) == 20
    assert client.is_closed()


@pytest.mark.parametrize("line", [b"POST / HTTP/1.1\r\n", b"GET /x HTTP/1.0\r\n", b"OPTIONS * HTTP/1.1\r\n"])
def test_a_page_in_a_browser_commands_nothing(opened, run, line):
    client = Client(opened, run)
    client.send(line + b"Content-Type: text/plain\r\n\r\n" + b'{"do": "stop"}\n')
    assert client.answers()[0]["ok"] is False
    assert client.is_closed()
    assert not run.is_stopped


def test_leaving_the_run_closes_every_connection(run):
    with server() as opened:
        client = Client(opened, run)
        assert client.ask(do="state")["ok"]
    assert client.is_closed()
    with pytest.raises(ConnectionError):
        Client(opened, run)


def test_a_port_that_is_taken_is_told(opened):
    port = opened.name.partition(":")[2]
    with pytest.raises(ConfigError, match=rf"control 127.0.0.1:{port}: Address already in use"):
        server(port)


# ---- a Unix socket ---------------------------------------------------------------------------------


def test_a_unix_socket_answers_its_owner_alone_and_goes_with_the_run(tmp_path, run):
    path = tmp_path / "socket"
    with server(f"unix:{path}") as opened:
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert Client(opened, run).ask(do="state")["ok"]
    assert not path.exists()


def test_a_unix_socket_of_a_crashed_run_is_taken_over(tmp_path, run):
    path = tmp_path / "socket"
    left = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    left.bind(str(path))
    left.close()
    with server(f"unix:{path}") as opened:
        assert Client(opened, run).ask(do="state")["ok"]


def test_a_unix_socket_in_use_is_left_alone(tmp_path, run):
    path = tmp_path / "socket"
    with server(f"unix:{path}") as opened:
        with pytest.raises(ConfigError, match="Address already in use"):
            server(f"unix:{path}")
        assert Client(opened, run).ask(do="state")["ok"]


def test_a_file_in_the_place_of_a_unix_socket_is_left_alone(tmp_path):
    path = tmp_path / "file"
    path.write_text("mine")
    with pytest.raises(ConfigError, match="Address already in use"):
        server(f"unix:{path}")
    assert path.read_text() == "mine"


@pytest.mark.parametrize("name", ["x" * 200, "no/such/folder"])
def test_a_unix_socket_that_cannot_be_is_told(tmp_path, name):
    with pytest.raises(ConfigError, match=r"control unix:"):
        server(f"unix:{tmp_path}/{name}")


# ---- anything --------------------------------------------------------------------------------------

WORDS = st.sampled_from(
    ["do", "kind", "inject", "read", "state", "clear", "stop", "frame_lost", "number", "id"]
)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | WORDS | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(WORDS, inner, max_size=4),
    max_leaves=8,
)
LINES = st.one_of(
    st.binary(max_size=80).map(lambda data: data.replace(b"\n", b"")),
    JSON.map(lambda value: json.dumps(value).encode()),
    st.dictionaries(WORDS, WORDS, max_size=4).map(lambda value: json.dumps(value).encode()),
)


@settings(max_examples=150)
@given(st.lists(LINES, max_size=8), st.integers(1, 50))
def test_every_line_has_one_answer_whatever_it_holds(run, lines, size):
    lines = [line for line in lines if line.strip() and not line[:1].isupper()]
    with server() as opened:
        client = Client(opened, run)
        data = b"".join(line + b"\n" for line in lines)
        for start in range(0, len(data), size * 20):
            client.send(data[start : start + size * 20])
            opened.poll(run)
        found = client.answers(len(lines)) if lines else []
        assert all(isinstance(one["ok"], bool) and ("error" in one) != one["ok"] for one in found)
        assert len(found) == len(lines)
        assert client.ask(do="state")["ok"]
        client.close()
    run.step()
