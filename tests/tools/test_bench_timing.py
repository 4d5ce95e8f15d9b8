"""The bench of time, encoding and decoding: its senders send, its tables judge what they should."""

import pytest

from tools.bench import codec, pictures, report, senders, timing
from vsensor import run
from vsensor.bus import FrameBus
from vsensor.types import Frame

MACHINE = {"processor": "", "cores": 1, "python": "", "numpy": "", "load_average": 0.0}


def row(who, p99, cycle_ms=10, bus="loopback", dropped=0, seconds=2.0):
    figures = {"p50": 0.001, "p99": p99, "p99.9": p99, "max": 2 * p99}
    counts = {"slots": 200, "slots_dropped": dropped} if who in ("ours", "realtime", "busy", "long") else {}
    return {"who": who, "cycle_ms": cycle_ms, "bus": bus, "seconds": seconds, **counts} | {
        "lateness": figures,
        "cycle_error": figures,
    }


def page(*rows):
    return report.markdown({"machine": MACHINE, "timing": {"seconds": 2.0, "rows": list(rows)}})


def test_what_is_late_or_later_than_python_cans_thread_is_called_missed():
    assert "0 of 2 targets missed" in page(row("ours", 0.2), row("thread", 0.25))
    assert "1 of 2 targets missed" in page(row("ours", 0.2), row("thread", 0.15))
    assert "2 of 2 targets missed" in page(row("ours", 0.4), row("thread", 0.35))


def test_realtime_has_narrower_targets_also_beside_busy_processes():
    assert "1 of 2 targets missed" in page(row("realtime", 0.2), row("thread", 0.3))
    assert "0 of 1 targets missed" in page(row("busy", 0.2))
    assert "1 of 1 targets missed" in page(row("busy", 0.4))


def test_a_slot_dropped_in_the_long_run_is_a_missed_target():
    assert "1 of 1 targets missed" in page(row("long", 0.1, dropped=1, seconds=600.0))
    assert "0 of 1 targets missed" in page(row("long", 0.1, seconds=600.0))


def test_in_user_mode_linux_lateness_is_told_not_judged():
    text = page(row("ours", 9.0, bus="socketcan:vcan0"), row("bcm", 0.1, bus="socketcan:vcan0"))
    assert "targets missed" in text
    assert "0 of 0" in text
    assert "9.000" in text


def test_every_sender_is_named_in_the_tables_and_drawn(tmp_path):
    rows = [row(who, 0.1, bus=bus) for who in timing.NAMES for bus in timing.PLACES]
    text = page(*rows)
    assert all(name in text for name in timing.NAMES.values())
    pictures.timing({"rows": rows}, tmp_path / "timing.png")
    assert (tmp_path / "timing.png").stat().st_size > 10_000


def test_the_stand_in_for_a_bus_tells_when_frames_were_there_by_the_kernels_clock():
    with FrameBus(senders.LoopbackPort(), "loopback", is_simulated=True) as bus:
        for k in range(5):
            assert bus.send(Frame(due_ns=k, arbitration_id=0x100 + k, data=b"12"))
        assert bus.drain() == []
        confirmed = bus.confirmed()
    assert [due_ns for due_ns, _ in confirmed] == list(range(5))
    stamps = [stamp_ns for _, stamp_ns in confirmed]
    assert stamps == sorted(stamps)
    assert stamps[-1] - stamps[0] < 10**9


@pytest.mark.parametrize("who", ["sleep", "thread"])
def test_peers_send_once_a_cycle(who):
    found = senders.WHO[who](5, 0.1, "loopback")
    assert found["lateness"]["p50"] >= 0.0
    assert 0.0 <= found["cycle_error"]["p50"] < 1000.0


def test_ours_sends_all_messages_in_every_cycle(monkeypatch):
    monkeypatch.setattr(run, "open_bus", run.open_bus)  # which the sender replaces
    found = senders.ours(20, 0.4, "loopback")
    assert found["slots"] == 20
    assert found["lateness"]
    assert found["age"]["max"] >= found["burst"]["max"]


def test_lateness_without_known_slots_is_against_the_best_frame():
    assert senders._after_best([1000, 2005, 2998, 4000], 1000) == [2, 7, 0, 2]


def test_encoding_and_decoding_are_measured_and_agree_with_cantools():
    encoded, decoded = codec.encoding(ticks=3, rounds=1), codec.decoding(frames=1300, rounds=1)
    assert encoded["frames_a_tick"] == 13
    assert decoded["unlike_cantools"] == 0
    assert decoded["times_faster"] > 1.0
    text = report.markdown({"machine": MACHINE, "encoding": encoded, "decoding": decoded})
    assert "signals unlike cantools" in text


def test_a_signal_that_cantools_reads_otherwise_is_counted(monkeypatch):
    import vsensor.codec as ours

    frame = Frame(due_ns=0, arbitration_id=0x322, data=bytes(range(8)))
    right = ours.decode
    monkeypatch.setattr(ours, "decode", lambda *words: {k: v + 1 for k, v in right(*words).items()})
    assert codec.unlike_cantools([frame]) > 3
