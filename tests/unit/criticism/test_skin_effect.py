"""Skin effect held against an inductance beside a resistance (Foster), in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.effects.skin_effect import EFFECT
from pipeline.criticism.machine.coenergy import effect_flux
from tests.unit.criticism.machines import operating

BRANCH_OHM, LATE_S = 0.02, 0.7e-3


def values(x):
    """What a branch of a resistance beside an inductance is in the effect's own terms."""
    bend = (2.0 * np.pi * x.machine.scales["freq_hz"] * LATE_S) ** 2
    return {
        "rise": BRANCH_OHM / x.base["r_ohm"] * bend / (1.0 + bend),
        "meter_rise": 0.3,
        "inner": 1.0,
        "bend": bend,
    }


def test_a_turning_machine_has_the_impedance_of_the_branch():
    """Less j ω R τ, the inductance that the branch has at standstill."""
    x = operating(50)
    q = values(x)
    omega = 2.0 * np.pi * x.freq_hz
    branch = BRANCH_OHM * 1j * omega * LATE_S / (1.0 + 1j * omega * LATE_S)
    voltage = EFFECT.drop(x, q) + 1j * omega * effect_flux(EFFECT, x, q)[0]
    expected = (branch - 1j * omega * BRANCH_OHM * LATE_S) * x.i_a
    assert voltage == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("ts", [2e-6, 0.5 * LATE_S])
def test_a_step_finds_the_branch_as_a_resistance_first_and_an_inductance_at_last(ts):
    """A ramp of current: the branch takes R τ di/dt (1 − e^{−t/τ}), and no inductance besides, also
    where a sample is half as long as the field is late.
    """
    n, slope = 4000, 500.0
    t, still = ts * np.arange(n), np.zeros(n)
    x = replace(
        operating(n),
        id_a=slope * t,
        iq_a=still,
        omega_rad_s=still,
        freq_hz=still,
        inverter=False,
        ts_s=ts,
        cache={},
    )
    q = values(x)
    lost = np.gradient(effect_flux(EFFECT, x, q)[0].real, ts)
    whole = BRANCH_OHM * LATE_S * slope
    assert lost == pytest.approx(np.full(n, -whole), rel=1e-6)
    expected = whole * (1.0 - np.exp(-t / LATE_S))
    assert EFFECT.drop(x, q).real == pytest.approx(expected, abs=1e-9 * whole)


def metered(freq_hz):
    still = np.zeros(3)
    at = {"omega_rad_s": still, "freq_hz": still + freq_hz, "inverter": False, "ts_s": 1.0}
    return replace(operating(3), cache={}, **at)


def test_a_meter_above_the_machine_s_frequency_has_its_own_resistance_and_no_inner_field():
    x = metered(1e6)
    q = values(x)
    assert EFFECT.drop(x, q) == pytest.approx(0.3 * x.base["r_ohm"] * x.i_a)
    assert effect_flux(EFFECT, x, q)[0] == pytest.approx(-BRANCH_OHM * LATE_S * x.i_a, rel=1e-5)


def test_a_meter_at_a_frequency_of_the_machine_reads_what_the_machine_has_there():
    """At 120 Hz of 280, a resistance that is not the one of 1 MHz was held against the effect."""
    meter = metered(120.0)
    turning = replace(meter, omega_rad_s=np.full(3, 50.0), inverter=True, cache={})
    q = values(meter)
    assert EFFECT.drop(meter, q) == pytest.approx(EFFECT.drop(turning, q))
    fluxes = (effect_flux(EFFECT, x, q)[0] for x in (meter, turning))
    assert next(fluxes) == pytest.approx(next(fluxes))


def test_without_a_bend_resistance_grows_with_the_square_of_the_frequency():
    x = operating(50)
    q = {"rise": 0.2, "meter_rise": 0.0, "inner": 1.0, "bend": 0.0}
    square = (x.freq_hz / x.machine.scales["freq_hz"]) ** 2
    assert EFFECT.drop(x, q) == pytest.approx(0.2 * square * x.base["r_ohm"] * x.i_a)
    assert effect_flux(EFFECT, x, q)[0] == pytest.approx(np.zeros(50))
