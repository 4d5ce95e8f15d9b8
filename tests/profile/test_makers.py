"""Production lane layouts by a profile alone: sent, read by cantools, decoded back, checked."""

import math

import pytest

from tests.bus_values import boundary, estimate
from tests.made_profiles import Sender, raws, reference, sent, values
from tests.shared import SHARED_DATA, needs_shared
from tests.test_profile import assert_bulk_equals_single
from vsensor.profile import load_profile
from vsensor.types import MarkingKind, Side

LINES = estimate(
    boundary(Side.LEFT, [1.83, 0.01, 1e-3, 1e-6], kind=MarkingKind.SOLID, x_max_m=70.0),
    boundary(Side.RIGHT, [-1.71, 0.012, 9e-4, 2e-6], kind=MarkingKind.DASHED, quality=3, x_max_m=55.0),
    index=37,
)

HONDA = """
schema = "vsensor.profile/1"
[geometry]
origin = "camera"
origin_x_m = 1.9
positive = "right"
heading = "angle"
"""
HONDA_LINE = """
[messages.{message}_1]
cycle_ms = 40
e2e = {{ crc = "CHECKSUM", counter = "COUNTER", profile = "nibble_sum" }}
[messages.{message}_1.signals]
LINE_DISTANCE_VISIBLE = "{line}.x_max_m"
LINE_PROBABILITY = {{ quantity = "{line}.quality", factor = 0.24 }}
LINE_OFFSET = "{line}.offset_m"
LINE_ANGLE = "{line}.heading"
FRAME_INDEX = {{ quantity = "image.index", wrap = true }}
[messages.{message}_2]
cycle_ms = 40
e2e = {{ crc = "CHECKSUM", counter = "COUNTER", profile = "nibble_sum" }}
[messages.{message}_2.signals]
LINE_SOLID = {{ quantity = "{line}.kind", table = {{ solid = 1, double_solid = 1, other = 0 }} }}
LINE_DASHED = {{ quantity = "{line}.kind", table = {{ dashed = 1, double_dashed = 1, other = 0 }} }}
LINE_CURVATURE = "{line}.curvature_per_m"
FRAME_INDEX = {{ quantity = "image.index", wrap = true }}
"""

HYUNDAI = """
schema = "vsensor.profile/1"
[geometry]
positive = "left"
origin_x_m = 1.9
heading = "angle"
[tables.quality]
0 = 0
1 = 0
2 = 1
3 = 2
4 = 3
[messages.FR_CMR_03_50ms]
cycle_ms = 40
e2e = { crc = "FR_CMR_Crc3Val", counter = "FR_CMR_AlvCnt3Val", profile = "hyundai_canfd" }
[messages.FR_CMR_03_50ms.signals]
Info_LftLnQualSta = { quantity = "left.quality", table = "quality", error = "Error indicator" }
Info_LftLnPosVal = "left.offset_m"
Info_LftLnHdingAnglVal = "left.heading"
Info_LftLnCvtrVal = "left.curvature_per_m"
Info_LftLnCrvtrDrvtvVal = "left.curvature_rate_per_m2"
Info_RtLnQualSta = { quantity = "right.quality", table = "quality", error = 7 }
Info_RtLnPosVal = "right.offset_m"
Info_RtLnHdingAnglVal = "right.heading"
Info_RtLnCvtrVal = { quantity = "right.curvature_per_m", sna = -1 }
Info_RtLnCrvtrDrvtvVal = "right.curvature_rate_per_m2"
"""

TESLA = """
schema = "vsensor.profile/1"
[geometry]
heading = "angle"
[messages.DAS_lanes]
cycle_ms = 40
e2e = { counter = "DAS_lanesCounter" }
[messages.DAS_lanes.signals]
DAS_leftLaneExists = "left.available"
DAS_rightLaneExists = "right.available"
DAS_virtualLaneWidth = "lane.width_m"
DAS_virtualLaneViewRange = "centre.x_max_m"
DAS_virtualLaneC0 = "centre.offset_m"
DAS_virtualLaneC1 = "centre.heading"
DAS_virtualLaneC2 = "centre.c2_per_m"
DAS_virtualLaneC3 = "centre.c3_per_m2"
DAS_leftLineUsage = { quantity = "left.available", table = { no = "REJECTED_UNAVAILABLE", yes = "FUSED" } }
DAS_rightLineUsage = { quantity = "right.available", table = { no = "REJECTED_UNAVAILABLE", yes = "FUSED" } }
"""


def maker(tmp_path, text, database):
    path = tmp_path / "maker.toml"
    path.write_text(text)
    return load_profile(path, SHARED_DATA / "dbc" / f"{database}.dbc")


def honda(tmp_path):
    lines = (("LEFT_LANE_LINE", "left"), ("RIGHT_LANE_LINE", "right"))
    text = HONDA + "".join(HONDA_LINE.format(message=message, line=line) for message, line in lines)
    return maker(tmp_path, text, "honda_bosch_lane_lines_extract")


@needs_shared
def test_two_frames_a_line_unsigned_with_offset_and_a_frame_index_in_either_byte_order(tmp_path):
    profile = honda(tmp_path)
    frames = sent(profile, values(LINES))
    told = [reference(profile).decode_message(f.arbitration_id, f.data) for f in frames]
    y, slope = 1.83 + 1.9 * (0.01 + 1.9 * (1e-3 + 1.9e-6)), 0.01 + 1.9 * (2e-3 + 1.9 * 3e-6)
    assert told[0]["LINE_OFFSET"] == pytest.approx(-y, abs=0.002)
    assert told[0]["LINE_ANGLE"] == pytest.approx(-math.atan(slope), abs=0.00025)
    assert told[1]["LINE_CURVATURE"] == pytest.approx(-(2e-3 + 6 * 1.9e-6), abs=5e-6)
    assert [frame["FRAME_INDEX"] for frame in told] == [37 % 16] * 4
    assert [told[1][name] for name in ("LINE_SOLID", "LINE_DASHED")] == [1, 0]
    assert [told[3][name] for name in ("LINE_SOLID", "LINE_DASHED")] == [0, 1]
    assert (told[0]["LINE_DISTANCE_VISIBLE"], told[2]["LINE_DISTANCE_VISIBLE"]) == (68, 53)
    assert_bulk_equals_single(profile, list(frames), check=True)


@needs_shared
def test_two_bit_counters_and_nibble_checksums_hold_over_many_slots(tmp_path):
    profile, counters = honda(tmp_path), []
    sender = Sender(profile)
    for _ in range(9):
        frames = sender(values(LINES))
        assert all(profile.decode(frame, check=True) for frame in frames)
        counters.append(raws(profile, frames)[2]["COUNTER"])
    assert counters == [k % 4 for k in range(9)]


@needs_shared
def test_32_bytes_of_can_fd_with_a_crc16_and_an_error_indicator(tmp_path):
    profile = maker(tmp_path, HYUNDAI, "hyundai_canfd_fr_cmr_03_extract")
    frames = sent(profile, values(LINES))
    assert (len(frames[0].data), frames[0].is_fd) == (32, True)
    told = profile.decode(frames[0], check=True)
    assert told["left.offset_m"] == pytest.approx(1.83 + 1.9 * (0.01 + 1.9 * (1e-3 + 1.9e-6)), abs=0.002)
    assert told["left.quality"] == 4
    assert told["right.quality"] == 3
    spoilt = bytearray(frames[0].data)
    spoilt[9] ^= 4
    assert (
        profile.decode(type(frames[0])(due_ns=0, arbitration_id=437, data=bytes(spoilt)), check=True) is None
    )


@needs_shared
def test_eight_bit_coefficients_of_one_virtual_lane(tmp_path):
    profile = maker(tmp_path, TESLA, "tesla_das_lanes_extract")
    frames = sent(profile, values(LINES))
    told = profile.decode(frames[0])
    assert told["centre.offset_m"] == pytest.approx(0.06, abs=0.0175)
    assert told["centre.c2_per_m"] == pytest.approx(9.5e-4, abs=1e-5)
    assert told["centre.x_max_m"] == 55
    assert told["left.available"] == told["right.available"] == 1
    read = raws(profile, frames)[0]
    assert (read["DAS_leftLineUsage"], read["DAS_rightFork"], read["DAS_lanesCounter"]) == (2, 0, 0)
    assert raws(profile, sent(profile, values(estimate())))[0]["DAS_leftLineUsage"] == 0
