"""A rotor held at many angles, and nothing else: what is named of it, with which size."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.criticism.data.holding_cells import holding_cells
from pipeline.criticism.equations.holding import measured
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.effects import parameters
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, machine
from tests.unit.criticism.test_zero_effects import segment_of


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


def test_a_cell_where_the_rotor_turns_back_is_of_neither_sense() -> None:
    """It holds there with the current of both: one cell of 720 was 60 floors off."""
    motor = replace(design("gimbal-5208"), effects={})
    (held,) = campaign_of(campaign(motor, Bench(), 2, (("h", "holding_current", {}),))).captures
    cells = holding_cells(held, DEFAULT)
    assert cells is not None
    up, down = (cells.iq_a[cells.sense == sense] for sense in (1.0, -1.0))
    for one in (up, down):
        assert np.abs(one - np.median(one)).max() < 0.1 * abs(np.median(up) - np.median(down))
    both, last = cells.theta_mech_rad, held.tables[0]["theta_mech_rad"].max()
    assert both.max() < last


def sound(**sensors):
    """A holding current of a sound motor by such sensors."""
    motor, plan = replace(design("servo-ipm"), effects={}), (("h", "holding_current", {}),)
    (held,) = campaign_of(campaign(motor, replace(Bench(), **sensors), 2, plan)).captures
    return held


@pytest.mark.parametrize("noise", [0.3, 3.0])
def test_what_all_rows_of_a_position_have_in_common_is_noise(noise):
    """Phase currents stay while the rotor is held, and so does their rounding: of four rows by 12
    bits a mean was taken to be twice as good as one, and a sound motor was `unknown`.
    """
    cells = holding_cells(sound(adc_bits=12, noise_scale=noise), DEFAULT)
    assert cells is not None
    scatter = math.sqrt(np.mean([np.var(cells.iq_a[cells.sense == s]) for s in (1.0, -1.0)]))
    # twice a floor's power is what a verdict counts as over it
    assert scatter / math.sqrt(2.0) < cells.noise_a < math.sqrt(2.0) * scatter


def test_a_current_that_a_bus_holds_is_read_at_the_angles_of_its_own_rows():
    held = sound()
    (table,) = held.tables
    slow = table.gather_every(5).select("t_s", "id_a", "iq_a")
    apart = replace(held, tables=(table.drop("id_a", "iq_a"), slow))
    cells = holding_cells(apart, DEFAULT)
    assert cells is not None
    every = holding_cells(replace(held, tables=(table.gather_every(5),)), DEFAULT)
    assert every is not None
    assert np.array_equal(cells.iq_a, every.iq_a)
    assert cells.noise_a == every.noise_a


def test_a_shunt_that_is_off_zero_is_no_cogging():
    """It turns against the rotor that the drive holds: a wave of the pole pairs in the q current,
    which was a `cogging` of 14 mN·m.
    """
    motor = replace(design("joint-11p"), effects={})
    tests = ("holding_current", "resistance_ab", "drive_1_warm")
    plan = tuple(step for step in CAMPAIGN if step[0] in tests)
    off = motor.having(current_offset=0.5 * parameters("current_offset", motor)["size"])
    whole = campaign_of(campaign(off, Bench(), 2, plan))
    found = pipeline.diagnose(pipeline.Recordings({whole.motor_id: whole}))[whole.motor_id]
    assert "cogging" not in found.missing
    assert not any(left.capture == "holding_current.mcap" for left in found.remainder)


@pytest.mark.parametrize("name", ["zero", "current_offset."])
def test_zeros_of_the_shunts_turn_against_the_rotor_that_they_hold(name):
    """Im(−(α + jβ) e^(−jpθ)) of the true q current, of usual ones and of an effect."""
    effect = effects()["current_offset"]
    segment, model = segment_of("standing"), Model(machine(), (effect,))
    base = {**BASE, **zero(effect, model)}
    alpha, beta = (f"{name}{axis}_a" for axis in ("_alpha", "_beta"))
    off = {alpha.replace("._", "."): 0.2, beta.replace("._", "."): -0.1}
    was, now = (measured(segment, segment.recorded, model, one)[0] for one in (base, base | off))
    eps = model.machine.pole_pairs * segment.recorded["theta_mech_rad"]
    assert now - was == pytest.approx(0.2 * np.sin(eps) + 0.1 * np.cos(eps))
