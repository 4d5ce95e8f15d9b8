"""Every hard case keeps its error within the bound that its reason allows."""

import math

import pytest

from tests.hard_cases import table


@pytest.mark.parametrize("part", table.PARTS)
def test_no_error_exceeds_its_bound(part):
    found = table.rows_of(part)
    assert [row for row in found if not row.worst <= row.bound] == []


@pytest.mark.parametrize("part", table.PARTS)
def test_every_case_was_measured_and_says_against_what(part):
    found = table.rows_of(part)
    assert found
    assert all(row.reference and math.isfinite(row.worst) and row.worst >= 0.0 for row in found)
    assert len({(row.case, row.quantity) for row in found}) == len(found)


def test_the_table_has_one_line_for_each_row():
    found = table.rows_of("far_out")
    assert table.text(found).count("\n") == len(found) + 1
