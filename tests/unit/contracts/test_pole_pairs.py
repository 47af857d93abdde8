"""Every number of the gate of pole pairs from both sides, a few per cent away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.contracts.gates import (
    pole_pairs,
)
from pipeline.contracts.rotation import (
    turning,
)
from tests.unit.contracts.signals import OPTIONS, VOLTS, turned
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, said


def geared(count, *, cycles=30.0, ripple=0.0, plate=None, rows=8001):
    angle = np.linspace(0.0, cycles * TURN / count, rows)
    phase = count * angle + ripple * np.sin(np.linspace(0.0, 5.0, rows))
    return capture("open_circuit", theta_mech_rad=angle, meta={"pole_pairs": plate},
                   **turned(VOLTS, phase))  # fmt: skip


@pytest.mark.parametrize(
    ("count", "cycles", "expected"),
    [(7.019, 30.0, ""), (7.021, 30.0, "warned"), (6.981, 30.0, ""), (6.979, 30.0, "warned"),
     (7.3, 2.97, ""), (7.3, 3.03, "warned")],
)  # fmt: skip
def test_a_count_is_whole_to_a_fiftieth(count: float, cycles: float, expected: str) -> None:
    assert said("pole_pairs", geared(count, cycles=cycles)) == expected


@pytest.mark.parametrize(
    ("plate", "words"),
    [(7, None), (14, "number of poles"), (8, "nameplate says 8"), (None, None)],
)
def test_a_count_against_the_nameplate(plate, words) -> None:
    passed = GATES["pole_pairs"].check(geared(7.0, plate=plate), OPTIONS["pole_pairs"])
    assert [f.code for f in passed.findings] == ["pole_pairs_nameplate"] * (words is not None)
    if words:
        assert words in passed.findings[0].message
        assert ("number of poles" in passed.findings[0].message) is (plate == 14)


def test_the_unit_in_which_a_count_is_whole() -> None:
    """Degrees or rpm scale a count by 180/pi or 30/pi; a slip may meet a factor by chance."""
    degrees, rpm = math.pi / 180.0, math.pi / 30.0
    unit = pole_pairs._unit
    assert "degrees, which makes 7.000" in unit(7.0 * degrees, 0.0, 0.02, None)
    # what is whole in rpm is so in degrees too, six times as many: the nameplate tells
    assert unit(3.0 * rpm, 0.0, 0.02, 3) == "the speed is in rpm, which makes 3.000"
    assert unit(3.0 * rpm, 0.0, 0.02, 18) == "the angle is in degrees, which makes 18.000"
    assert "makes 18.000, or the speed is in rpm, which" in unit(3.0 * rpm, 0.0, 0.02, None)
    # rpm makes of 9 a count of 0.94: only the nameplate tells it from a slip
    assert unit(9.0 * rpm, 0.0, 0.02, None) == ""
    assert "9.000" in unit(9.0 * rpm, 0.0, 0.02, 9)
    assert unit(7.019 * degrees, 0.0, 0.02, None) != ""
    assert unit(7.021 * degrees, 0.0, 0.02, None) == ""
    # two u of the count in that unit widen it; where u there is a tenth, nothing is said
    assert unit(7.05 * degrees, 0.016 * degrees, 0.02, None) != ""
    assert unit(7.0 * degrees, 0.099 * degrees, 0.02, None) != ""
    assert unit(7.0 * degrees, 0.101 * degrees, 0.02, None) == ""
    assert unit(0.01 * degrees, 0.0, 0.02, None) == ""
    # 28 and 29 degrees are below one half of a count, 30 are not
    assert unit(28.0 * degrees, 0.0, 0.02, None) != ""
    assert unit(30.0 * degrees, 0.0, 0.02, None) == ""


@pytest.mark.parametrize(("u", "expected"), [(0.097, "warned"), (0.103, "")])
def test_a_count_that_is_known_to_a_tenth(u: float, expected: str) -> None:
    """Blocks of equal travel of 7.3 ± d cycles a turn: u = d/sqrt(n - 1)."""
    blocks, each = 200, 20
    d = u * math.sqrt(blocks - 1)
    step = np.repeat(7.3 + d * (-1.0) ** np.arange(blocks), each) * 0.01
    angle = np.arange(blocks * each + 1) * 0.01
    phase = np.concatenate([[0.0], np.cumsum(step)])
    made = capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, phase))
    found = turning(made)
    assert found is not None
    assert found.u == pytest.approx(u, rel=0.01)
    assert said("pole_pairs", made) == expected
