"""Every number of the gate of the sampling rate from both sides, a few per cent away."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.contracts.signals import VOLTS, turned
from tests.unit.contracts.test_gate_limits import TURN, capture, said


@pytest.mark.parametrize(("per", "expected"), [(2.45, "refused"), (2.55, "warned"),
                                               (4.9, "warned"), (5.1, "")])  # fmt: skip
def test_samples_an_electrical_period_of_a_spin(per: float, expected: str) -> None:
    """By the voltages themselves where there is an angle, else by the stated pole pairs."""
    phase = np.arange(2000) * TURN / per
    made = capture("open_circuit", theta_mech_rad=phase / 5.0, **turned(VOLTS, phase))
    assert said("sampling_rate", made) == expected
    speed = np.full(400, TURN / (5.0 * per * 1e-4))
    stated = capture("open_circuit", omega_mech_rad_s=speed, vab_v=np.zeros(400),
                     meta={"pole_pairs": 5})  # fmt: skip
    assert said("sampling_rate", stated) == expected


@pytest.mark.parametrize(("per", "expected"), [(2.45, "refused"), (5.1, "")])
def test_phase_voltages_have_a_rate_as_lines_have(per: float, expected: str) -> None:
    of_phases = turned(("va_v", "vb_v", "vc_v"), np.arange(400) * TURN / per)
    speed = np.full(400, TURN / (5.0 * per * 1e-4))
    made = capture("open_circuit", omega_mech_rad_s=speed, **of_phases, meta={"pole_pairs": 5})
    assert said("sampling_rate", made) == expected


def test_a_line_without_a_value_leaves_the_step_to_the_others() -> None:
    t = np.arange(-200, 2000)
    current = np.where(t > 0, -np.expm1(-t / 5.0), 0.0)
    blank = np.full(t.size, np.nan)
    made = capture("current_step", ia_a=blank, ib_a=10.0 * current)
    assert said("sampling_rate", made) == "warned"


@pytest.mark.parametrize(("timing", "expected"), [("instant", "warned"), ("centred", "")])
def test_means_in_the_rotors_frame_alias_nothing(timing: str, expected: str) -> None:
    """0.4 readings an electrical period."""
    speed, steady = np.full(400, TURN / (5.0 * 0.4 * 1e-4)), np.ones(400)
    dq = dict.fromkeys(("vd_v", "vq_v", "id_a", "iq_a", "torque_shaft_nm"), steady)
    made = capture("torque_map", omega_mech_rad_s=speed, **dq,
                   meta={"pole_pairs": 5, "voltage_timing": timing})  # fmt: skip
    assert said("sampling_rate", made) == expected
