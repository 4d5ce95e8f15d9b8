"""Layouts that are not the native one: pages, declared bursts, events, placeholders, lines without words."""

import pytest
from msgspec.structs import replace

from tests.accept.streams import found, verdict
from tests.bus_values import boundary, estimate
from tests.made_profiles import Sender, profile_of, values
from tests.profile.test_bursts import DBC as BURST_DBC
from tests.profile.test_bursts import TEXT as BURST_TEXT
from tests.profile.test_pages import LINES, PAGES
from vsensor.types import Side

GAP_NS = 250_000


def sent(profile, count=40, told=None):
    """Return the frames of `count` images, those of one image a quarter of a millisecond apart."""
    sender, frames = Sender(profile), []
    for k in range(count):
        more = told(k) if told else {}
        burst = sender({**values(), "image.index": float(k), **more})
        frames += [replace(frame, due_ns=frame.due_ns + place * GAP_NS) for place, frame in enumerate(burst)]
    return frames


# --- pages --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mux", ["together", "rotate"])
def test_a_multiplexed_message_is_accepted(tmp_path, mux):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux=mux))
    judgement = verdict(sent(profile), profile)
    assert judgement.findings == ()
    assert not any("no cycle" in remark for remark in judgement.remarks)


def test_pages_that_leave_together_are_missing_together(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="together"))
    frames = sent(profile)
    counts = found(frames[:20] + frames[22:], profile)
    assert counts[("missing", "M")] == 1


def test_pages_of_one_image_are_compared_with_each_other(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="together"))
    frames = sent(profile, told=lambda k: {"left.offset_m": -3.0} if k == 20 else {})
    crossed = [f for f in verdict(frames, profile, offset_step_m=10.0).findings if f.kind == "contradiction"]
    assert [f.count for f in crossed] == [1]


# --- declared bursts ----------------------------------------------------------------------------------


@pytest.fixture
def bursts(tmp_path):
    return profile_of(tmp_path, BURST_DBC, BURST_TEXT)


def test_a_burst_of_eight_frames_with_one_checksum_is_accepted(bursts):
    assert found(sent(bursts), bursts) == {}


def test_a_recording_may_begin_and_end_within_a_burst(bursts):
    assert found(sent(bursts)[3:-3], bursts) == {}


def test_a_changed_byte_breaks_the_checksum_over_the_burst(bursts):
    frames = sent(bursts)
    data = bytearray(frames[82].data)
    data[6] ^= 1
    frames[82] = replace(frames[82], data=bytes(data))
    assert found(frames, bursts) == {("burst_checksum", "image"): 1}


def test_a_lost_frame_leaves_its_burst_incomplete(bursts):
    frames = sent(bursts)
    counts = found(frames[:82] + frames[83:], bursts)
    assert counts == {("missing", "C"): 1, ("burst_incomplete", "image"): 1}


def test_a_doubled_frame_does_not_break_a_burst(bursts):
    frames = sent(bursts)
    again = replace(frames[82], due_ns=frames[82].due_ns + 1000)
    assert found([*frames[:83], again, *frames[83:]], bursts) == {("extra", "C"): 1}


# --- events -------------------------------------------------------------------------------------------

EVENT_DBC = 'BO_ 9 E: 8 CAM\n SG_ Off : 0|16@1- (0.001,0) [0|0] "m" ECU\n'


def event(tmp_path, send):
    text = f'[messages.E]\nsend = {{ {send} }}\n[messages.E.signals]\nOff = "left.offset_m"\n'
    return profile_of(tmp_path, EVENT_DBC, text)


def at(profile, *times_ms):
    frame = sent(profile, 1)[0]
    return [replace(frame, due_ns=round(t * 1e6)) for t in times_ms]


def test_a_message_sent_on_change_may_be_silent_for_any_time(tmp_path):
    profile = event(tmp_path, 'type = "on_change"')
    judgement = verdict(at(profile, 0, 50, 5000), profile)
    assert judgement.is_accepted
    assert any("no cycle is known" in remark for remark in judgement.remarks)
    assert verdict([], profile).is_accepted


def test_two_frames_closer_than_the_minimum_delay_are_found(tmp_path):
    profile = event(tmp_path, 'type = "on_change", min_delay_ms = 30')
    assert found(at(profile, 0, 40, 66, 5000), profile) == {}  # 4 ms early are within the jitter
    (finding,) = verdict(at(profile, 0, 40, 50, 5000), profile).findings
    assert (finding.kind, finding.count, finding.worst) == ("too_close", 1, pytest.approx(20.0))


def test_a_message_sent_on_change_and_in_cycles_is_missing_after_a_long_silence_only(tmp_path):
    profile = event(tmp_path, 'type = "cyclic_and_on_change", cycle_ms = 100')
    assert found(at(profile, 0, 100, 130, 200, 300), profile) == {}
    assert found(at(profile, 0, 100, 130, 400, 500), profile) == {("missing", "E"): 2}


# --- ranges and lane changes --------------------------------------------------------------------------


def one_line(tmp_path, range_):
    dbc = (
        f'BO_ 9 L: 8 CAM\n SG_ Left : 0|16@1- (0.001,0) {range_} "m" ECU\n'
        ' SG_ Right : 16|16@1- (0.001,0) [0|0] "m" ECU\n'
    )
    text = (
        'wide_ranges = "saturate"\n[messages.L]\ncycle_ms = 40\n'
        'signals = { Left = "left.offset_m", Right = "right.offset_m" }\n'
    )
    return profile_of(tmp_path, dbc, text)


def both(y_m):
    left, right = boundary(Side.LEFT, [y_m]), boundary(Side.RIGHT, [y_m - 3.5])
    return values(estimate(left, right))


@pytest.mark.parametrize(
    ("range_", "count"), [("[-1|1]", 40), ("[-2|2]", 0), ("[0|1]", 0), ("[0|0]", 0), ("[-99|1]", 0)]
)
def test_a_declared_range_counts_unless_it_is_a_placeholder_or_beyond_the_bits(tmp_path, range_, count):
    profile = one_line(tmp_path, range_)
    frames = sent(profile, told=lambda _: both(1.7))
    assert found(frames, profile).get(("out_of_range", "L"), 0) == count
    assert found(frames, profile, ranges=False) == {}


def test_where_the_bus_tells_no_lane_changes_a_step_of_a_lane_is_one(tmp_path):
    profile = one_line(tmp_path, "[0|0]")
    change = sent(profile, told=lambda k: both(0.1 if k < 20 else 3.6))
    judgement = verdict(change, profile)
    assert judgement.is_accepted
    assert any("count as lane changes" in remark for remark in judgement.remarks)
    jump = sent(profile, told=lambda k: both(0.1 if k < 20 else 1.4))
    assert found(jump, profile) == {("jump", "L"): 2}
