"""Dead time of a switching inverter, against periods that are switched through step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.inverter import lost_shares, swept_shares
from pipeline.criticism.machine.model import Model, evaluate, zero
from pipeline.criticism.operating import Supply
from pipeline.criticism.regression.noise_floors import steep_drops
from tests.unit.criticism.machines import BASE, machine, operating

PWM_S, VDC_V, LOSS_V, L_H = 6e-5, 40.0, 0.5, 2.5e-4
AXES = np.exp(2j * np.pi * np.arange(3) / 3.0)
TEXTBOOK_V = 4.0 / np.pi * LOSS_V
STEPS, ROUNDS = 1600, 20


def point(i_d, i_q, speed, angles=12, l_q=L_H):
    """A machine at one current and speed, or at some, at angles over a turn."""
    each = np.broadcast_arrays(*(np.atleast_1d(np.float64(one)) for one in (i_d, i_q, speed)))
    x = operating(angles * each[0].size)
    x.id_a, x.iq_a, x.omega_rad_s = (np.repeat(one, angles) for one in each)
    x.eps_rad = np.tile(np.linspace(0.0, 2.0 * np.pi, angles, endpoint=False), each[0].size)
    x = replace(x, base={**BASE, "ld_h": L_H, "lq_h": l_q}, supply=Supply(PWM_S, VDC_V))
    evaluate(Model(machine(), ()), x, x.base)
    return x


def phases(x, vector):
    return (vector * np.exp(1j * x.eps_rad) * np.conj(AXES)[:, None]).real


def rotor(x, legs):
    return 2.0 / 3.0 * (AXES @ legs) * np.exp(-1j * x.eps_rad)


def over_inductance(x, volts):
    """Slopes of the phase currents [3, n, A/s] under voltages without a common part."""
    if x.base["ld_h"] == x.base["lq_h"]:
        return volts / L_H
    vector = rotor(x, volts)
    return phases(x, vector.real / x.base["ld_h"] + 1j * vector.imag / x.base["lq_h"])


def switched(x, told, winding, begin):
    """One period: lost volts of each leg, means of the currents and their ends [3, n].

    Two switches a leg, each on a dead time late; diodes conduct while both are off and there is
    current, else the leg floats.
    """
    dead = LOSS_V / VDC_V
    middle = 0.5 * (told.max(axis=0) + told.min(axis=0))
    duty = 0.5 + (told - middle) / VDC_V
    current, lost, mean = begin.copy(), np.zeros_like(begin), np.zeros_like(begin)
    for at in (np.arange(STEPS) + 0.5) / STEPS - 0.5:
        upper = (at >= -0.5 * duty + dead) & (at < 0.5 * duty)
        off = ~upper & ~((at < -0.5 * duty) | (at >= 0.5 * duty + dead))
        leg = np.where(upper, 1.0, np.where(off & (current < 0.0), 1.0, 0.0))
        floats = off & (current == 0.0)
        for k in range(3):
            others = leg.sum(axis=0) - leg[k]
            level = np.clip(0.5 * others + 1.5 * winding[k] / VDC_V, 0.0, 1.0)
            leg[k] = np.where(floats[k], level, leg[k])
        lost += VDC_V / STEPS * ((abs(at) < 0.5 * duty) - leg)
        volts = VDC_V * (leg - leg.mean(axis=0)) - winding
        step = over_inductance(x, volts) * PWM_S / STEPS
        after = np.where(off & (current * (current + step) < 0.0), 0.0, current + step)
        mean += 0.5 * (current + after) / STEPS
        current = after
    return lost, mean, current


def settled(x):
    """Voltage that is asked for [n], and what is lost of it [n], with the currents of `x`."""
    winding = phases(x, BASE["r_ohm"] * x.i_a + 7j * x.omega_rad_s * x.flux_wb)
    wanted = phases(x, x.i_a)
    told, begin = winding + LOSS_V * np.sign(wanted), wanted.copy()
    for _ in range(ROUNDS):
        lost, mean, end = switched(x, told, winding, begin)
        drift = end - begin
        told = told - 0.3 * (drift - drift.mean(axis=0)) * L_H / PWM_S
        begin = begin - 0.5 * (mean - wanted)
    return rotor(x, told), rotor(x, lost)


def lost_by(x, width=1e-4):
    shares = lost_shares(x, x.eps_rad, phases(x, x.i_a), LOSS_V, width)
    return rotor(x, LOSS_V * shares)


POINTS = ((0.0, 0.4, 8.0), (0.0, 0.2, 80.0), (-3.0, 0.2, 80.0), (0.0, 3.0, 60.0))
"""Current along d and q [A], and speed [rad/s]."""


SALIENT = (0.0, 0.6, 120.0)
"""The same of a machine of twice the inductance along q."""


@pytest.fixture(scope="module")
def losses():
    """Of each of the points: voltage [angles] that is found to be lost, and that is lost. Periods
    of all points are switched through side by side.
    """
    x = point(*np.transpose(POINTS))
    told, lost = settled(x)
    both = np.stack([lost_by(x.fed(volts_v=told)), lost], axis=1)
    return dict(zip(POINTS, both.reshape(len(POINTS), -1, 2), strict=True))


@pytest.mark.slow
def test_the_ripple_of_unequal_inductances_turns_with_the_rotor():
    """By their mean it was off by a seventh of what is lost, where it just exceeds the current."""
    x = point(*SALIENT, angles=25, l_q=2.0 * L_H)
    told, lost = settled(x)
    found = lost_by(x.fed(volts_v=told))
    mean = replace(x, base={**x.base, "ld_h": 1.5 * L_H, "lq_h": 1.5 * L_H})
    by_mean = lost_by(mean.fed(volts_v=told))
    errors = (np.sqrt((np.abs(one - lost) ** 2).mean()) for one in (found, by_mean))
    own, of_mean = (float(error) / TEXTBOOK_V for error in errors)
    assert own < 0.07
    assert of_mean > 2.0 * own


@pytest.mark.parametrize("at", POINTS)
def test_what_is_lost_is_what_a_period_switched_through_loses(losses, at):
    found, lost = losses[at].T
    assert np.abs(found.mean() - lost.mean()) < 0.1 * TEXTBOOK_V
    assert np.sqrt((np.abs(found - lost) ** 2).mean()) < 0.15 * TEXTBOOK_V


def test_dead_time_fades_where_the_ripple_exceeds_the_current():
    """Both edges of a period then meet another sign of the current."""
    slow, fast, large = point(0.0, 0.2, 4.0), point(0.0, 0.2, 200.0), point(0.0, 40.0, 200.0)
    assert lost_by(slow).imag.mean() > 0.85 * TEXTBOOK_V
    assert abs(lost_by(fast).mean()) < 0.05 * TEXTBOOK_V
    assert lost_by(large).imag.mean() == pytest.approx(TEXTBOOK_V, rel=0.03)


def test_thresholds_act_by_the_current_of_each_moment():
    """Of a period stepped through: where the ripple exceeds a current, its sense changes within."""
    width, x = 0.05, point([0.0, -2.0, 0.0], [0.2, 0.1, 3.0], [80.0, 150.0, 30.0])
    winding = phases(x, BASE["r_ohm"] * x.i_a + 7j * x.omega_rad_s * x.flux_wb)
    middle = 0.5 * (winding.max(axis=0) + winding.min(axis=0))
    duty = 0.5 + (winding - middle) / VDC_V
    at = (np.arange(STEPS) + 0.5) / STEPS - 0.5
    high = (np.abs(at)[:, None, None] < 0.5 * duty).astype(float)
    volts = VDC_V * (high - high.mean(axis=1, keepdims=True)) - winding
    ripple = np.cumsum(volts, axis=0) * PWM_S / STEPS / L_H
    mean = phases(x, x.i_a)
    current = mean + ripple - ripple.mean(axis=0)
    assert (np.ptp(ripple, axis=0) > 2.0 * np.abs(mean)).any()
    stepped = np.tanh(current / width).mean(axis=0)
    assert swept_shares(x, x.eps_rad, mean, width) == pytest.approx(stepped, abs=0.01)
    plain = swept_shares(x.fed(pwm_s=0.0), x.eps_rad, mean, width)
    assert plain == pytest.approx(np.tanh(mean / width))
    assert np.abs(plain - stepped).max() > 0.2


def test_at_little_voltage_a_resting_current_loses_what_is_told():
    """A leg without current passes through the dead time: its voltage moves, nothing else."""
    x = point(0.0, 0.0, 0.0)
    shift = 0.3 * LOSS_V * np.exp(1j * (np.pi / 6.0 - x.eps_rad))
    lost = lost_by(x.fed(volts_v=shift), width=1e-6)
    assert lost == pytest.approx(shift, abs=0.05 * LOSS_V)


def test_without_switching_the_current_alone_decides():
    x = point(1.0, 2.0, 50.0)
    plain = np.tanh(phases(x, x.i_a) / 0.3)
    for unknown in (x.fed(pwm_s=0.0), x.fed(vdc_v=0.0)):
        assert lost_shares(unknown, x.eps_rad, phases(x, x.i_a), 0.2, 0.3) == pytest.approx(plain)


def test_where_a_drop_jumps_with_the_current_its_floor_is_that_jump():
    """A twentieth of the current decides of much of the loss there, and of nothing elsewhere."""
    effect = effects()["dead_time"]
    model = Model(machine(), (effect,))
    of = {
        "loss_v": LOSS_V,
        "width_a": 1e-3,
        "ripple": 1.0,
    }
    values = {**BASE, "ld_h": L_H, "lq_h": L_H, **zero(effect, model)}
    values |= {f"dead_time.{name}": value for name, value in of.items()}

    def jump(i_q, speed):
        return np.abs(steep_drops(model, values, point(0.0, i_q, speed))).mean()

    speeds = np.linspace(10.0, 150.0, 15)
    at_half = min(speeds, key=lambda w: abs(lost_by(point(0.0, 0.2, w)).imag.mean() - 0.6 * LOSS_V))
    assert jump(0.2, at_half) > 0.05 * LOSS_V
    assert jump(4.0, 10.0) < 0.01 * LOSS_V


def test_what_a_period_takes_is_computed_once_a_state(monkeypatch):
    """Along the voltage and along the drop of the switches it stays; with width, lag or inductance
    it is another.
    """
    calls, effect = [], effects()["dead_time"]
    monkeypatch.setattr(
        "pipeline.criticism.effects.dead_time.swept_shares",
        lambda *given: calls.append(given) or swept_shares(*given),
    )
    start = zero(effect, Model(machine(), (effect,)))
    q = {name.partition(".")[2]: value for name, value in start.items()}
    q |= {"loss_v": LOSS_V, "width_a": 0.1, "ripple": 2.0}
    q = {**{p.name: 0.0 for p in effect.every(machine())}, **q}
    x = point(1.0, 2.0, 50.0)
    once = effect.drop(x, q)
    assert effect.drop(x, {**q, "loss_v": 2.0 * LOSS_V}) == pytest.approx(2.0 * once)
    effect.drop(x, {**q, "on_v": 0.1})
    assert len(calls) == 1
    other = replace(x, base={**x.base, "ld_h": 2.0 * L_H})
    for state, moved in ((x, {"width_a": 0.2}), (x, {"lag_s": 1e-5}), (other, {})):
        found = effect.drop(state, {**q, **moved})
        assert found == pytest.approx(effect.drop(replace(state, cache={}), {**q, **moved}))
        assert not np.allclose(found, once)
    assert len(calls) == 7
