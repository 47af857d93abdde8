"""Every number of the gate of isolated readings from both sides, a few per cent away."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.gates import (
    isolated_readings,
)
from tests.unit.contracts.signals import OPTIONS
from tests.unit.contracts.test_gate_limits import GATES, capture, said


@pytest.mark.parametrize(("times", "count"), [(7.9, 0), (8.1, 1)])
def test_a_reading_alone_leaves_by_eight_times_what_is_usual(times: float, count: int) -> None:
    """A ramp of one a row, both ways: 99 % depart by nothing, the usual step is 1."""
    values = np.arange(1000.0)
    values[500] += times + 1.0
    # neighbours differ by 2, so the departure of `times` (to the next row) is against 2
    assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == 0
    values[500] = 500.0 + 2.0 * times + 1.0
    assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == count
    assert np.count_nonzero(isolated_readings.isolated(-values, 8.0)) == count
    flat = np.zeros(1000)
    flat[::2] = 0.1
    flat[501] = -0.1 * times
    assert np.count_nonzero(isolated_readings.isolated(flat, 8.0)) <= 1


def test_a_quantum_is_usual() -> None:
    """A shaft that rests and steps by one code now and then: seven codes are no stranger."""
    stairs = np.floor(np.arange(1000) / 100.0)
    for codes, count in ((8.0, 0), (9.0, 1)):
        values = stairs.copy()
        values[350] += codes
        assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == count


@pytest.mark.parametrize(("rows", "interval", "expected"), [
    (499, 1e-3, ""), (500, 1e-3, "warned"), (600, 0.0205, ""), (600, 0.0195, "warned"),
])  # fmt: skip
def test_isolated_readings_need_rows_and_a_rate(rows: int, interval: float, expected: str) -> None:
    t_s = np.arange(rows) * interval
    speed = 50.0 + np.arange(rows) * 0.01
    speed[200] = 0.0
    made = capture("drive", t_s=t_s, omega_mech_rad_s=speed)
    assert said("isolated_readings", made) == expected
    if expected:
        passed = GATES["isolated_readings"].check(made, OPTIONS["isolated_readings"])
        assert "the first 0 between 51.99 and 52.01" in passed.findings[0].message
        assert np.flatnonzero(passed.lost[0].rows).tolist() == [200]


@pytest.mark.parametrize(("times", "expected"), [(7.8, ""), (8.2, "warned")])
@pytest.mark.parametrize("other", [np.nan, np.inf])
def test_a_reading_alone_beside_one_that_is_no_number(
    times: float, expected: str, other: float
) -> None:
    """Of a ramp of one a row, whose neighbours are two apart."""
    values = np.arange(1000.0)
    values[500] = 500.0 + 2.0 * times + 1.0
    found = isolated_readings.isolated(np.where(values == 700.0, other, values), 8.0)
    assert found[500] == bool(expected)
    values[700] = np.nan
    made = capture("drive", t_s=np.arange(1000) * 1e-3, omega_mech_rad_s=values)
    assert said("isolated_readings", made) == expected
