import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.runner import Summary
from vsensor.timing import Samples, Timing


@given(st.lists(st.integers(-(10**12), 10**12), min_size=1, max_size=300))
def test_percentiles_are_those_of_numpy_and_the_maximum_is_the_largest(values):
    samples = Samples()
    for value in values:
        samples.add(value)
    expected = [*np.percentile(values, [50, 99, 99.9]) / 1e6, max(values) / 1e6]
    assert list(samples.figures_ms().values()) == pytest.approx(expected)


def test_memory_stays_flat_and_the_maximum_remembers_what_the_percentiles_forgot():
    samples = Samples(recent=100)
    samples.add(10**9)
    for _ in range(1000):
        samples.add(5)
    assert len(list(samples)) == 100
    assert set(samples) == {5}
    assert samples.figures_ms()["max"] == 1000.0
    assert samples.count == 1001


def test_without_samples_there_are_no_figures_and_no_lines():
    assert Samples().figures_ms() == {}
    assert Timing().named() == {}


def test_cycle_error_is_the_interval_on_the_bus_less_that_of_the_due_times():
    timing = Timing()
    for due_ns, stamp_ns in ((0, 100), (40_000, 40_150), (80_000, 80_020), (160_000, 160_021)):
        timing.on_bus(due_ns, stamp_ns)
    assert list(timing.cycle_error) == [50, 130, 1]
    assert list(timing.bus_lateness) == [100, 150, 20, 21]


def test_only_the_first_frame_of_a_burst_counts_on_the_bus():
    timing = Timing()
    for due_ns, stamp_ns in ((0, 7), (0, 300), (0, 600), (40_000, 40_007), (40_000, 40_300)):
        timing.on_bus(due_ns, stamp_ns)
    assert list(timing.bus_lateness) == [7, 7]
    assert list(timing.cycle_error) == [0]


def test_the_summary_has_a_line_for_each_thing_that_was_measured():
    summary = Summary(period_ns=40_000_000, ticks=1)
    summary.timing.lateness.add(1_500_000)
    summary.timing.burst.add(250_000)
    lines = summary.text().splitlines()
    assert "lateness of the first frame: p50 1.500, p99 1.500, p99.9 1.500, max 1.500 ms" in lines
    assert "burst, first to last frame: p50 0.250, p99 0.250, p99.9 0.250, max 0.250 ms" in lines
    assert not any("on the bus, kernel" in line for line in lines)
