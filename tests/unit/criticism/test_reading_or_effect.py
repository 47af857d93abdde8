"""What half a hold explains beside a small effect is not one larger effect.

A drive's voltage in the frame of the sampling instant is ahead by half a hold. The current that
feeds an iron's loss lowers the flux, which turns the voltage back a little. A delay of free size
takes both at once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.registry import effects
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection import stepwise
from pipeline.criticism.selection.other_readings import by_best_readings, reading_notes
from pipeline.criticism.selection.sizes import is_rare
from pipeline.criticism.selection.stepwise import _is_reading, search
from tests.unit.criticism.machines import BASE, fitted, held, log

LIBRARY = {name: effects()[name] for name in ("sample_delay", "iron_eddy", "windage")}
HALF_HOLD_S = 25e-6


def with_iron(loss_nm: float, seed: int) -> Segment:
    """The log of a machine whose iron's loss makes a drag [N·m] at 250 rad/s, and takes a current
    that does not magnetise.
    """
    segment = log(noise=1.0, seed=seed)
    exact = log().recorded
    omega = np.gradient(exact["theta_mech_rad"], segment.ts_s)
    i_d, i_q = exact["id_a"], exact["iq_a"]
    psi = BASE["ld_h"] * i_d + BASE["psi_wb"] + 1j * BASE["lq_h"] * i_q
    drag = loss_nm * omega / 250.0 * np.abs(psi / BASE["psi_wb"]) ** 2
    beside = 1j * psi * drag / (1.5 * 7 * np.abs(psi) ** 2)
    lost = BASE["ld_h"] * beside.real + 1j * BASE["lq_h"] * beside.imag
    volts = -np.gradient(lost, segment.ts_s) - 7j * omega * lost
    em = -1.5 * 7 * (lost.real * i_q - lost.imag * i_d)
    added = {"vd_v": volts.real, "vq_v": volts.imag, "torque_shaft_nm": em - drag}
    recorded = {**segment.recorded, **{k: segment.recorded[k] + v for k, v in added.items()}}
    return replace(segment, capture=f"map_{seed}", test="torque_map", recorded=recorded)


def late(delay_s: float, seed: int) -> Segment:
    """The log with voltages that are logged before they act."""
    segment = log(noise=1.0, seed=seed)
    omega = np.gradient(log().recorded["theta_mech_rad"], segment.ts_s)
    vector = segment.recorded["vd_v"] + 1j * segment.recorded["vq_v"]
    vector = vector * np.exp(7j * omega * delay_s)
    recorded = {**segment.recorded, "vd_v": vector.real, "vq_v": vector.imag}
    return replace(segment, capture=f"map_{seed}", test="torque_map", recorded=recorded)


def searched(segments):
    last = search(fitted(segments), LIBRARY)[-1]
    (frame,) = {segment.instrument.frame for segment in last.fit.segments}
    return last, frame


@pytest.mark.slow
def test_a_frame_beside_an_iron_loss_is_no_delay() -> None:
    last, frame = searched([held(0.5, with_iron(0.04, seed)) for seed in (5, 6)])
    assert last.added == ("iron_eddy",)
    assert last.fit.values["iron_eddy.drag_nm"] == pytest.approx(0.04, rel=0.05)
    assert frame == 0.5


def test_a_frame_beside_an_iron_loss_below_the_floor_is_no_delay() -> None:
    """Where the right name cannot be given, another is not given instead."""
    last, frame = searched([held(0.5, with_iron(0.02, seed)) for seed in (5, 6)])
    assert last.added == ()
    assert frame == 0.5
    (note,) = reading_notes(last.fit)
    assert "a sample_delay of half a period would look the same" in note


def test_an_effect_that_leaves_a_reading_its_share_is_not_in_its_place() -> None:
    """The reading is asked for again when the effect is in."""

    def dragged(segment: Segment) -> Segment:
        omega = np.gradient(log().recorded["theta_mech_rad"], segment.ts_s)
        torque = segment.recorded["torque_shaft_nm"] - 0.3 * omega * np.abs(omega) / 250.0**2
        return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})

    wide = linear_system(fitted([dragged(held(0.5, log(noise=1.0)))]))
    reread = by_best_readings(wide)
    assert reread is not wide
    windage = wide.fit.model.with_effects(LIBRARY["windage"])
    start = replace(wide.fit, model=windage, values={**wide.fit.values, "windage.drag_nm": 0.3})
    chosen = gauss_newton(start)
    assert chosen.deviance < wide.deviance - wide.policy.selection.tie
    assert not _is_reading(chosen, wide, reread, LIBRARY, 0, frozenset())


def test_what_was_chosen_by_another_reading_is_chosen_again() -> None:
    """In the wrong frame of the voltage, two shunts stood for the gains of three sensors."""

    def gained(segment: Segment) -> Segment:
        eps = 7 * log().recorded["theta_mech_rad"]
        vector = segment.recorded["id_a"] + 1j * segment.recorded["iq_a"]
        vector = vector + 0.02 * np.conj(vector) * np.exp(-2j * eps)
        recorded = {**segment.recorded, "id_a": vector.real, "iq_a": vector.imag}
        return replace(segment, recorded=recorded)

    fit = fitted([gained(held(0.5, log(noise=1.0, seed=seed))) for seed in (5, 6)])
    gain = effects()["current_gain"]
    chosen = dict.fromkeys((p.name for p in gain.parameters), 0.0) | {"shunts": 1.0, "bench": 1.0}
    values = {**fit.values, **{f"current_gain.{name}": value for name, value in chosen.items()}}
    begun = gauss_newton(replace(fit, model=fit.model.with_effects(gain), values=values)).fit
    last = search(begun, {})[-1].fit
    assert {segment.instrument.frame for segment in last.segments} == {0.5}
    assert last.values["current_gain.shunts"] == 0.0
    assert last.values["current_gain.cosine"] == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize(("times", "taken"), [(10.02, True), (15.0, False), (20.0, False)])
def test_a_choice_that_explains_as_much_is_taken_in_place_of_changing_friction(
    times: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether a wave's torque reaches the shaft looked like friction of a time constant."""
    wide = linear_system(fitted([log(noise=1.0), log(noise=1.0, seed=6)]))
    here, changing, chosen = (
        replace(wide, residual=one * wide.residual) for one in (20.0, 10.0, times)
    )
    chosen = here if times == 20.0 else chosen
    monkeypatch.setattr(stepwise, "by_best_readings", lambda system: system)
    monkeypatch.setattr(stepwise, "with_free_shares", lambda *_: None)
    monkeypatch.setattr(stepwise, "with_changing_friction", lambda *_: changing)
    monkeypatch.setattr(stepwise, "reconsidered", lambda *_, **__: chosen)
    instead = stepwise._instead_of_effect(None, here, LIBRARY, 0, frozenset())
    assert instead is (chosen if taken else changing)


def test_an_iron_loss_is_no_voltage_that_is_logged_after_it_acted() -> None:
    """A command is logged before it acts, so of two that tie the other one is named."""
    last, _ = searched([with_iron(0.031, seed) for seed in (5, 6)])
    assert last.added == ("iron_eddy",)


@pytest.mark.parametrize("name", ["sample_delay", "current_delay"])
@pytest.mark.parametrize(("delay_s", "rare"), [(-5e-6, True), (0.0, False), (5e-6, False)])
def test_a_delay_of_the_wrong_sign_is_rare(name: str, delay_s: float, rare: bool) -> None:
    """Nothing is logged before it flows: eddy currents were a current 20 µs early."""
    fit, effect = fitted([log(noise=1.0)]), effects()[name]
    model = fit.model.with_effects(effect)
    values = {f"{name}.{p.name}": 0.0 for p in effect.parameters_of(fit.machine)}
    values[f"{name}.delay_s"] = delay_s
    late_fit = replace(fit, model=model, values={**fit.values, **values})
    assert is_rare(effect, late_fit) == rare


@pytest.mark.parametrize(
    "delay_s",
    [
        10e-6,
        pytest.param(16e-6, marks=pytest.mark.slow),
        35e-6,
        pytest.param(60e-6, marks=pytest.mark.slow),
    ],
)
def test_a_delay_is_whole_and_not_what_another_frame_leaves_of_it(delay_s: float) -> None:
    """Of a delay beyond half a hold the frame takes a part first, and is usual again after it."""
    last, frame = searched([held(0.0, late(delay_s, seed)) for seed in (5, 6)])
    assert last.added == ("sample_delay",)
    assert frame == 0.0
    assert last.fit.values["sample_delay.delay_s"] == pytest.approx(delay_s, rel=0.1)
    (note,) = reading_notes(last.fit)
    assert "less by half a PWM period then" in note
