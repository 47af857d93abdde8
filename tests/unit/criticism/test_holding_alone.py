"""A rotor held at many angles, and nothing else: what is named of it, with which size."""

from __future__ import annotations

import math

import pipeline
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design


def test_holding_currents_alone_name_the_cogging_with_its_size() -> None:
    """Without pole pairs; the torque constant is stated. It was said that they cannot tell."""
    motor = design("gimbal-5208")
    true = truth(motor)["constants"]
    kt, plan = true["kt_peak_nm_a"], (("holding", "holding_current", {}),)
    whole = campaign_of(campaign(motor, Bench(instruments=EXACT), 2, plan))
    stated = {"kt_peak_nm_a": kt, "u_kt_peak_nm_a": 0.01 * kt}
    found = pipeline.diagnose(
        pipeline.Recordings({whole.motor_id: whole}), constants=stated
    ).motors[whole.motor_id]
    assert found.missing == ("cogging",)
    (ranked,) = (one for one in found.ranking if one.effect == "cogging")
    waves = [ranked.parameters[f"{part}_{true['cogging_order']}_nm"] for part in ("sin", "cos")]
    size = math.hypot(*(wave.value for wave in waves))
    assert abs(size - true["cogging_amplitude_nm"]) < 0.02 * true["cogging_amplitude_nm"]
    assert all(wave.u < 0.02 * size for wave in waves)
