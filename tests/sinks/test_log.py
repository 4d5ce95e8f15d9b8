"""The log sink: what was sent and nothing else, at its due time since 1970."""

from types import SimpleNamespace

import pytest

from vsensor.errors import LogError
from vsensor.logs import read_log
from vsensor.sinks.log import LogSink
from vsensor.types import Frame

EPOCH_NS = 1_700_000_000_000_001_000


def output(*frames):
    return SimpleNamespace(frames=frames)


def test_the_log_holds_just_the_frames_of_the_outputs_at_due_time_plus_epoch(tmp_path):
    sink = LogSink(tmp_path / "x.blf", EPOCH_NS)
    sink.write(
        output(Frame(due_ns=0, arbitration_id=1, data=b"a"), Frame(due_ns=500, arbitration_id=2, data=b""))
    )
    sink.write(output())
    sink.write(output(Frame(due_ns=40_000_000, arbitration_id=1, data=b"b")))
    sink.close()
    table = read_log(tmp_path / "x.blf")
    assert table.t_ns.tolist() == [EPOCH_NS, EPOCH_NS + 500, EPOCH_NS + 40_000_000]
    assert table.arbitration_id.tolist() == [1, 2, 1]
    assert [frame.data for frame in table.frames()] == [b"a", b"", b"b"]


def test_a_path_that_cannot_be_written_is_told_before_the_run(tmp_path):
    with pytest.raises(LogError, match="cannot be written"):
        LogSink(tmp_path / "nowhere" / "x.log")
