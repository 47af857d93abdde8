"""Ripple of a switching inverter, against a period that is switched through step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.inverter import phase_ripple
from pipeline.criticism.machine.model import Model, evaluate
from tests.unit.criticism.machines import BASE, machine, operating

PWM_S, VDC_V, STEPS = 6e-5, 40.0, 200_000
L_H = 2.5e-4


def switched(n=12):
    """Operating points below the voltage limit, of a machine without saliency."""
    x = operating(n)
    x.omega_rad_s = x.omega_rad_s * 0.7
    x = replace(x, base={**BASE, "ld_h": L_H, "lq_h": L_H}, pwm_s=PWM_S, vdc_v=VDC_V)
    evaluate(Model(machine(), ()), x, x.base)
    return x


def phase_volts(x):
    stationary = (BASE["r_ohm"] * x.i_a + 7j * x.omega_rad_s * x.flux_wb) * np.exp(1j * x.eps_rad)
    return np.array([(stationary * np.exp(-2j * np.pi * k / 3)).real for k in range(3)])


def test_the_ripple_at_the_edges_is_that_of_a_period_switched_through():
    x = switched()
    volts, ripple = phase_volts(x), phase_ripple(x, x.eps_rad)
    at = (np.arange(STEPS) + 0.5) / STEPS - 0.5
    for n in range(x.eps_rad.size):
        mine = volts[:, n]
        duty = 0.5 + (mine - 0.5 * (mine.max() + mine.min())) / VDC_V
        assert 0.0 < duty.min() < duty.max() < 1.0
        on = np.abs(at)[None] < 0.5 * duty[:, None]
        line = VDC_V * (on - on.mean(axis=0))
        assert line.mean(axis=1) == pytest.approx(mine, abs=2e-3)
        over = np.cumsum(line - mine[:, None], axis=1) * PWM_S / STEPS / L_H
        for k in range(3):
            rise, fall = np.flatnonzero(np.diff(on[k].astype(int)))
            assert over[k, fall] == pytest.approx(ripple[k, n], abs=2e-3 * PWM_S * VDC_V / L_H)
            assert over[k, rise] == pytest.approx(-ripple[k, n], abs=2e-3 * PWM_S * VDC_V / L_H)


def test_without_switching_there_is_no_ripple():
    x = switched()
    for unknown in (replace(x, pwm_s=0.0), replace(x, vdc_v=0.0)):
        assert not phase_ripple(unknown, x.eps_rad).any()


def test_dead_time_fades_where_the_ripple_exceeds_the_current():
    """Both edges of a period then meet another sign of the current."""
    x = switched(40)
    dead = effects()["dead_time"].drop
    of = {"loss_v": 0.2, "width_a": 1e-6, "lag_s": 0.0, "on_v": 0.0, "ripple": 1.0}
    swing = np.abs(phase_ripple(x, x.eps_rad)).min(axis=0)
    assert swing.max() > 0.1
    size = np.abs(x.i_a)
    slow = replace(x, id_a=x.id_a * 0.1 * swing / size, iq_a=x.iq_a * 0.1 * swing / size)
    slow.psi_wb = x.psi_wb
    assert np.abs(dead(slow, {**of, "ripple": 0.0})).min() > 0.2
    faded = np.abs(dead(slow, of))
    assert np.median(faded) < 1e-9
    large = replace(x, id_a=1e3 * x.id_a, iq_a=1e3 * x.iq_a)
    large.psi_wb = x.psi_wb
    still = replace(large, pwm_s=0.0)
    assert dead(large, of)[size > 4.0] == pytest.approx(dead(still, of)[size > 4.0], abs=0.1)
