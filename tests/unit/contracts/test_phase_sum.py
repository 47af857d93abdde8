"""Every number of the gate of a sum of the lines from both sides, a few per cent away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.unit.contracts.signals import AMPS, VOLTS, turned
from tests.unit.contracts.test_gate_limits import TURN, capture, noise, said


@pytest.mark.parametrize(("share", "expected"), [(0.098, "warned"), (0.102, "refused"),
                                                 (0.0098, ""), (0.0102, "warned")])  # fmt: skip
def test_a_sum_of_the_lines(share: float, expected: str) -> None:
    """A steady sum s of currents of rms 1 a line: s over sqrt(3) of them."""
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    size = share * math.sqrt(3.0 * 0.5) / 3.0
    lines = {n: v + size / math.sqrt(1.0 - share**2 / 3.0) for n, v in
             turned(AMPS, phase, 1.0).items()}  # fmt: skip
    made = capture("drive", **lines)
    assert said("phase_sum", made) == expected
    volts = capture("drive", **dict(zip(VOLTS, lines.values(), strict=True)))
    assert said("phase_sum", volts) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.049, ""), (0.051, "warned")])
def test_five_times_a_stated_gain_excuses_a_sum(share: float, expected: str) -> None:
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    size = share * math.sqrt(1.5) / 3.0 / math.sqrt(1.0 - share**2 / 3.0)
    lines = {n: v + size for n, v in turned(AMPS, phase, 1.0).items()}
    assert said("phase_sum", capture("drive", meta={"u_rel_current": 0.01}, **lines)) == expected


@pytest.mark.parametrize(("times", "expected"), [(2.9, ""), (3.1, "warned")])
def test_a_sum_within_three_of_its_noise_is_any_channels(times: float, expected: str) -> None:
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    white = noise(20001)
    white -= white.mean()
    lines = turned(AMPS, phase, 40.0)
    lines["ia_a"] = lines["ia_a"] + white + times
    assert said("phase_sum", capture("drive", **lines)) == expected
