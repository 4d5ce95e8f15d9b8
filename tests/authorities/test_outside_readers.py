"""Programs of others read our frames through the native DBC and get what we sent, signal by signal.

`candump | cantools decode` stands in tests/vcan/test_run.py, the C code that cantools generates in tests/ecu.
"""

import sys

import numpy as np
import pytest

from tests.authorities.recorded import DBC, frames_of, ours, raws, written

TICKS = 250


@pytest.fixture(scope="module")
def frames():
    return frames_of(TICKS)


@pytest.fixture(scope="module")
def expected(frames):
    return ours(frames)


def test_what_is_compared_has_numbers_and_missing_ones(expected):
    assert sum(len(signals) for signals in expected.values()) == 102
    offsets = np.array(expected["LDS_LeftLine"]["LeftOffset"])
    assert np.sum(offsets == -32.768) == 5  # not available while the sensor starts
    assert len(np.unique(offsets)) > 50


@pytest.mark.skipif(sys.version_info >= (3, 13), reason="opendbc has no release for Python 3.13 and later")
def test_opendbcs_parser_reads_every_signal_of_every_frame(frames, expected):
    """opendbc 0.3.1's CANParser, which takes the DBC by its path."""
    from opendbc.can import CANParser

    parser = CANParser(str(DBC), [(name, 25) for name in expected], 0)
    found = {name: {signal: [] for signal in signals} for name, signals in expected.items()}
    names = {message.address: name for name, message in parser.dbc.name_to_msg.items()}
    for frame in frames:
        assert parser.update([(frame.due_ns + 1, [(frame.arbitration_id, frame.data, 0)])])
        name = names[frame.arbitration_id]
        for signal, value in parser.vl[name].items():
            found[name][signal].append(value)
    assert parser.can_valid
    for name, signals in expected.items():
        assert found[name].keys() == signals.keys()
        for signal, values in signals.items():
            np.testing.assert_allclose(found[name][signal], values, rtol=1e-12, atol=1e-12, err_msg=signal)


@pytest.fixture(scope="module")
def decoded_by_asammdf(frames, tmp_path_factory):
    """Signal -> (raw, physical) as asammdf's own bus decoding of our MF4 log has it."""
    from asammdf import MDF

    path = written(frames, tmp_path_factory.mktemp("mf4") / "drive.mf4")
    with MDF(path) as recording, recording.extract_bus_logging({"CAN": [(str(DBC), 0)]}) as bus:
        names = [channel.name for group in bus.groups for channel in group.channels if channel.name != "time"]
        return {name: (bus.get(name, raw=True).samples, bus.get(name).samples) for name in names}


def test_asammdf_decodes_our_mf4_bit_for_bit(decoded_by_asammdf, frames):
    expected = raws(frames)
    assert decoded_by_asammdf.keys() == expected.keys()
    for name, (raw, _) in decoded_by_asammdf.items():
        np.testing.assert_array_equal(raw, expected[name], err_msg=name)


def test_asammdf_scales_every_number_as_we_do(decoded_by_asammdf, expected):
    """It shows a number whose value table names it (SNA) as NaN, and codes as texts."""
    numbers = {name: values for signals in expected.values() for name, values in signals.items()}
    compared = 0
    for name, (_, physical) in decoded_by_asammdf.items():
        if physical.dtype.kind != "S":
            there = ~np.isnan(physical.astype(float))
            theirs, own = physical.astype(float)[there], np.array(numbers[name])[there]
            np.testing.assert_allclose(theirs, own, rtol=1e-12, atol=1e-12, err_msg=name)
            compared += there.any()
    assert compared > 70
