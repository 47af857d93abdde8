"""Every number of the gate of levels of current from both sides, a few per cent away."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.contracts.test_gate_limits import capture, said


@pytest.mark.parametrize(("upper", "expected"), [(1.0515, "warned"), (1.0575, "")])
def test_levels_of_current_a_twentieth_apart(upper: float, expected: str) -> None:
    """0.049 and 0.054 of the larger."""
    current = np.repeat([1.0, upper], 500)
    made = capture("resistance", ia_a=-current, vab_v=-current)
    assert said("current_coverage", made) == expected


def test_two_levels_of_both_currents_make_a_flux_map() -> None:
    two, one = np.array([0.0, 1.0, 0.0, 1.0]), np.zeros(4)
    assert said("current_coverage", capture("flux_map", id_a=two, iq_a=two[::-1])) == ""
    assert said("current_coverage", capture("flux_map", id_a=one, iq_a=two)) == "refused"
    assert said("current_coverage", capture("flux_map", id_a=two, iq_a=one)) == "refused"
    assert said("current_coverage", capture("flux_map", id_a=two)) == ""


@pytest.mark.parametrize(("step_a", "expected"), [(0.5, ""), (0.0, "refused")])
def test_steps_of_current_under_a_ripple_of_the_back_emf(step_a: float, expected: str) -> None:
    """Thirteen levels below a ripple as large as all of them, of seven rows a period."""
    levels = np.repeat(np.arange(13.0) - 6.0, 1000) * step_a
    ripple = 3.0 * np.sin(0.9 * np.arange(levels.size))
    made = capture("torque_map", iq_a=levels + ripple, torque_shaft_nm=levels)
    assert said("current_coverage", made) == expected
