"""Space vectors against sampled three-phase systems."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.frames import space_vector, vector_of_lines


def _balanced(theta: np.ndarray, amplitude: float) -> list[np.ndarray]:
    shift = 2.0 * np.pi / 3.0
    return [amplitude * np.cos(theta - k * shift) for k in range(3)]


def test_a_balanced_system_is_one_length_and_turns_forward() -> None:
    theta = np.linspace(0.0, 6.0, 50)
    vector = space_vector(*_balanced(theta, 5.0))
    assert np.abs(vector) == pytest.approx(5.0)
    assert np.unwrap(np.angle(vector)) == pytest.approx(theta)


def test_power_needs_the_factor_three_halves() -> None:
    """Independent: the sum of the phases' v·i is 1.5 Re(v i*)."""
    volts, amps = (3.0, -1.0, -2.0), (0.5, 0.25, -0.75)
    by_phase = sum(v * i for v, i in zip(volts, amps, strict=True))
    v, i = space_vector(*volts), space_vector(*amps)
    assert 1.5 * float((v * np.conj(i)).real) == pytest.approx(by_phase)


@pytest.mark.parametrize("left_out", ["vab_v", "vbc_v", "vca_v", None])
def test_two_lines_give_what_three_phases_do(left_out: str | None) -> None:
    """Any two line voltages, or three with something common to them, are the phases' vector."""
    a, b, c = (np.array([3.0, -1.0]), np.array([-1.5, 4.0]), np.array([-1.5, -3.0]))
    common = 0.7 if left_out is None else 0.0
    lines = {"vab_v": a - b + common, "vbc_v": b - c + common, "vca_v": c - a + common}
    lines.pop(left_out or "", None)
    assert vector_of_lines(lines) == pytest.approx(space_vector(a, b, c))
    with pytest.raises(KeyError):
        vector_of_lines({"vab_v": a})
