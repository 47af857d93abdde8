"""Voltage and current of a terminal pair from whichever equivalent columns a capture holds."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.electrical.terminals import pair_signals
from tests.unit.estimation.signals import capture

T = np.arange(5) * 1e-3
CURRENT = np.array([0.0, 1.0, 2.0, -1.0, -2.0])


@pytest.mark.parametrize(
    "lines",
    [
        {"ib_a": CURRENT},
        {"ic_a": -CURRENT},
        # what the two do not share is an offset of their own and no current of the pair
        {"ib_a": CURRENT + 0.1, "ic_a": -CURRENT + 0.1},
    ],
)
def test_current_is_positive_into_the_first_terminal(lines):
    """What flows into b comes out of c: i = (i_b - i_c) / 2."""
    found = pair_signals(capture("resistance", t_s=T, vbc_v=0.4 * CURRENT, **lines), "bc")
    assert found["i_a"] == pytest.approx(CURRENT)
    assert found["v_v"] == pytest.approx(0.4 * CURRENT)


def test_voltage_is_that_between_the_phases():
    phases = {"vb_v": 0.2 * CURRENT + 1.0, "vc_v": -0.2 * CURRENT + 1.0}
    found = pair_signals(capture("resistance", t_s=T, ib_a=CURRENT, **phases), "bc")
    assert found["v_v"] == pytest.approx(0.4 * CURRENT)
