"""Each case over a small sample here, twice as large a one with the slow tests, and over 1,000
seeds with `make recovery`.
"""

from __future__ import annotations

import pytest

from tests.recovery.harness import run
from tests.recovery.table import cases

MANY = 1000


@pytest.mark.parametrize("share", [0.25, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_few_seeds(case, share):
    """Nothing is broken beyond what so few seeds can tell."""
    verdicts = run(case, range(max(5, round(share * case.few))))
    assert verdicts
    assert {v.constant: v.faults for v in verdicts if v.faults} == {}


@pytest.mark.slow
@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name)
def test_thousand_seeds(case):
    """Bias below 0.1 u, coverage 92 to 98 %, scatter below 1.2 times the bound."""
    verdicts = run(case, range(MANY))
    assert {v.constant: v.faults for v in verdicts if v.faults} == {}
