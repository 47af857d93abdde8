"""What a fit is sure of where a bound prevents a step."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.criticism.regression.identifiability import Known
from pipeline.numerics.identifiability import identify


def known(step: float) -> Known:
    """One parameter, known to 0.1, and a step that its bound prevents."""
    identified = identify(np.array([[10.0]]), np.ones(1))
    return Known(identified, np.zeros((0, 1)), np.array([step]), np.zeros((1, 1)))


@pytest.mark.parametrize(("value", "sign"), [(0.9, 1.0), (-0.9, -1.0)])
def test_a_prevented_step_is_a_doubt_only_where_it_leads_to_zero(value, sign):
    one = np.ones(1)
    assert known(0.0).excludes_zero(value, one, 2.0)
    assert known(sign * 0.8).excludes_zero(value, one, 2.0)
    assert not known(-sign * 0.8).excludes_zero(value, one, 2.0)
    assert not known(sign * 0.8).excludes_zero(0.1 * value, one, 2.0)
