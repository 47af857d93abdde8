"""Joints of robots: current and angle of an arm that swings below a turn, without pole pairs."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pipeline
from pipeline.records.capture import Campaign
from tests.unit.estimation.signals import capture

J_KGM2, DRY_NM, VISCOUS = 0.2, 1.5, 0.1
KT = {"kt_peak_nm_a": 1.0, "u_kt_peak_nm_a": 1e-3}


def arm(
    weight_nm: float, swing_rad: float, share: float = 0.0, light: float = 1.0
) -> pipeline.Recordings:
    """A minute of slow sines, the arm's weight largest where it is level."""
    t = np.arange(0.0, 60.0, 5e-3)
    theta, omega, alpha = np.zeros((3, t.size))
    for part, hz, phase in ((0.7, 0.31, 0.0), (0.3, 0.83, 1.0)):
        w = 2.0 * math.pi * hz
        theta += swing_rad * part * np.sin(w * t + phase)
        omega += swing_rad * part * w * np.cos(w * t + phase)
        alpha -= swing_rad * part * w**2 * np.sin(w * t + phase)
    torque = light * (J_KGM2 * alpha + DRY_NM * np.tanh(omega / 0.01) + VISCOUS * omega)
    torque += weight_nm * np.cos(theta - 0.4)
    # a gear whose friction has a share of the torque in it, as long as it does not hold the arm
    torque /= 1.0 - share * np.sign(omega * torque)
    rng, count = np.random.default_rng(4), 2.0 * math.pi / 2**19
    log = capture(
        "drive",
        "arm",
        t_s=t,
        theta_mech_rad=count * np.floor(theta / count),
        iq_a=torque + rng.normal(0.0, 5e-3, t.size),
    )
    return pipeline.Recordings({"arm": Campaign("arm", (log,))})


@pytest.mark.parametrize(
    ("weight_nm", "swing_rad", "names"),
    [(6.0, 1.5, ("unbalance",)), (6.0, 0.75, ("unbalance",)), (0.0, 1.5, ())],
)
def test_the_weight_of_an_arm_is_named(weight_nm: float, swing_rad: float, names: tuple) -> None:
    """It was left out below a turn. Without it no inertia is large enough, and no step led back;
    or an offset of the phase currents was named, of a motor whose pole pairs nobody knows.
    """
    (found,) = pipeline.diagnose(arm(weight_nm, swing_rad), constants=KT).motors.values()
    assert found.missing == names
    if names:
        parameters = found.ladder[-1].parameters
        size = math.hypot(*(parameters[f"unbalance.{n}_nm"].value for n in ("sin", "cos")))
        assert size == pytest.approx(weight_nm, rel=0.02)


def test_the_weight_of_a_light_arm_is_named() -> None:
    """Next to all of its torque is weight. Without the weight the inertia comes out thousands of
    times too large, where the step to the weight is beyond its bounds; in 1/J it is exact.
    """
    (found,) = pipeline.diagnose(arm(4.0, 1.5, light=0.05), constants=KT).motors.values()
    assert found.missing == ("unbalance",)
    assert found.ladder[-1].held_out < 1.5


@pytest.mark.slow
def test_friction_of_a_gear_is_named_beside_the_weight_of_its_arm() -> None:
    """A twentieth of a weight, by which its sine might be wrong, was as large as the friction."""
    (found,) = pipeline.diagnose(arm(20.0, 1.5, share=0.05), constants=KT).motors.values()
    assert found.missing == ("unbalance", "load_dependent_friction")
    share = found.ladder[-1].parameters["load_dependent_friction.share"].value
    assert share == pytest.approx(0.05, rel=0.1)
