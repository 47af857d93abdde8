"""A shaft driven by a voltage without a current on record: what its log determines, no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.machine_scale import base_scales, machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.equations.driven_shaft import _across_l
from pipeline.criticism.machine.model import Model
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants

R_OHM, KE, J_KGM2, COULOMB_NM, VISCOUS = 0.11, 0.021, 2.2e-3, 0.03, 2e-4
KT = KE  # of a brushed equivalent, whose power is v i and not 1.5 v i
TRUE = {
    "ks_v": R_OHM * COULOMB_NM / KT,
    "kv_v_s_rad": KE + R_OHM * VISCOUS / KT,
    "ka_v_s2_rad": R_OHM * J_KGM2 / KT,
}
STEP_S = 2e-4


def turned(volts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angle and speed of a shaft from rest."""
    theta, omega = np.zeros(volts.size), np.zeros(volts.size)
    for k in range(volts.size - 1):
        torque = KT * (volts[k] - KE * omega[k]) / R_OHM
        sense = np.sign(omega[k]) or np.sign(torque)
        stands = omega[k] == 0.0 and abs(torque) <= COULOMB_NM
        gain = 0.0 if stands else (torque - COULOMB_NM * sense - VISCOUS * omega[k]) / J_KGM2
        omega[k + 1] = omega[k] + STEP_S * gain
        theta[k + 1] = theta[k] + 0.5 * STEP_S * (omega[k] + omega[k + 1])
    return theta, omega


def log(
    seed: int, late_s: float, *, period_s: float = 0.02, begins_s: float = 0.0, **more: float
) -> Campaign:
    """Ramps and steps of voltage in either sense, an encoder of 4096 steps read late."""
    rng = np.random.default_rng(seed)
    ramp = np.arange(0.0, 6.0, STEP_S)
    volts = np.concatenate([s * part for s in (1, -1) for part in (ramp, np.full(12000, 5.0))])
    theta, _ = turned(volts)
    rows = np.arange(0, volts.size, round(period_s / STEP_S))
    seen = np.maximum(rows - round(late_s / STEP_S), 0)
    step = 2 * np.pi / 4096
    recorded = {
        "t_s": rows * STEP_S,
        "vq_v": volts[rows] + 2e-3 * rng.normal(size=rows.size),
        "theta_mech_rad": np.round(theta[seen] / step) * step,
    }
    table = pl.DataFrame({n: c[rows * STEP_S >= begins_s] for n, c in recorded.items()})
    texts = {name: str(value) for name, value in more.items()}
    meta = CaptureMeta("m", "drive", voltage_kind="commanded", extra=texts)
    return Campaign("m", (Capture("log.csv", "0", "verified", meta, (table,)),))


@pytest.mark.parametrize(
    ("seed", "late_s"),
    [
        pytest.param(1, 0.0, marks=pytest.mark.slow),
        pytest.param(2, 0.03, marks=pytest.mark.slow),
        (3, 0.12),
    ],
)
def test_the_feedforward_constants_are_known_and_nothing_else(seed: int, late_s: float) -> None:
    """R, ψ, J and friction are not known one by one, nor are their ratios named a second time."""
    found = compare(log(seed, late_s), ModelSpec(), Constants({}))
    known = {one.expression.split(" ")[0]: one for one in found.combinations}
    for name, true in TRUE.items():
        one = known.pop(name)
        assert abs(one.value - true) < 2.5 * one.u, name
        assert one.u < 0.06 * true, name
    assert not known
    assert not [name for name, one in found.parameters.items() if one.known]
    assert found.held_out < 2.0


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True, reason="a late voltage stands for a part of the mechanical time constant"
)
def test_a_winding_that_settles_little_sooner_than_its_shaft_makes_no_other_inertia() -> None:
    """L/R of a hub motor is a third of its mechanical time constant: kA is that of the coast."""
    j_kgm2, electrical_s, step_s = 2.4e-5, 2e-3, 1e-4
    rng = np.random.default_rng(7)
    levels = np.repeat(rng.uniform(0.5, 1.0, 100) * np.repeat([5.0, -5.0], 50), 600)
    current, omega, theta = 0.0, 0.0, np.zeros(levels.size + 1)
    for k, volts in enumerate(levels.tolist()):
        current += step_s / electrical_s * ((volts - KE * omega) / R_OHM - current)
        drag = COULOMB_NM * (np.sign(omega) or np.sign(current)) + VISCOUS * omega
        omega += step_s / j_kgm2 * (KT * current - drag)
        theta[k + 1] = theta[k] + step_s * omega
    rows = np.arange(0, levels.size, 10)
    encoder = 2 * np.pi / 16384
    recorded = {
        "t_s": rows * step_s,
        "vq_v": levels[rows] + 2e-3 * rng.normal(size=rows.size),
        "theta_mech_rad": np.round(theta[rows] / encoder) * encoder,
    }
    meta = CaptureMeta("m", "drive", voltage_kind="commanded", extra={})
    capture = Capture("log.csv", "0", "verified", meta, (pl.DataFrame(recorded),))
    found = compare(Campaign("m", (capture,)), ModelSpec(), Constants({}))
    known = {one.expression.split(" ")[0]: one for one in found.combinations}
    true = R_OHM * j_kgm2 / KT
    assert abs(known["ka_v_s2_rad"].value - true) < 2.5 * known["ka_v_s2_rad"].u
    assert known["ka_v_s2_rad"].u < 0.3 * true


def test_the_voltage_of_an_inductance_leads_where_the_acceleration_rises() -> None:
    """v_L = L/R · (R J/Kt) · d³θ/dt³ = 2 ms · kA · 30 rad/s³ of a jerk that is constant."""
    campaign = log(1, 0.0)
    machine = machine_of(campaign, Constants({}))
    assert machine is not None
    model = Model(machine, ())
    (segment,) = segments(campaign, machine)
    bend = 30.0 * segment.ts_s * np.arange(segment.size)
    scales = base_scales(machine)
    ka = scales["r_ohm"] * scales["j_kgm2"] / (1.5 * machine.pole_pairs * scales["psi_wb"])
    volts = _across_l(segment, bend, model, {"electrical_s": 2e-3})
    assert volts == pytest.approx(2e-3 * ka * 30.0)


def test_of_stated_resistance_and_back_emf_the_inertia_follows() -> None:
    """The product is R J/ψ: with two of them stated, the third is measured."""
    # v = R i + Ke ω and T = 1.5 Ke i of the q axis: 1.5 times a brushed motor's resistance
    stated = {
        "r_phase_ohm": 1.5 * R_OHM, "u_r_phase_ohm": 1e-4, "pole_pairs": 1,
        "psi_pm_wb": KE, "u_psi_pm_wb": 1e-5,
    }  # fmt: skip
    found = compare(log(4, 0.02, **stated), ModelSpec(), Constants({}))
    for name, true in (("j_kgm2", J_KGM2), ("coulomb_friction.torque_nm", COULOMB_NM)):
        one = found.parameters[name]
        assert one.value is not None, name
        assert one.u is not None
        assert abs(one.value - true) < 2.5 * one.u
        # R stands for 25 °C, and nothing recorded the winding's temperature
        assert one.u < 0.1 * true


def test_nothing_is_missing_from_it() -> None:
    """Of a motor that hides nothing no effect is named."""
    found = diagnose(log(5, 0.04), ModelSpec(), Constants({}))
    assert found.missing == ()
    assert found.verdict in ("adequate", "insufficient")
    assert {one.expression.split(" ")[0] for one in found.combinations} >= set(TRUE)


def test_a_voltage_of_before_the_log_is_not_used() -> None:
    """A log that begins with the shaft turning leaves out what is driven from before it."""
    campaign = log(6, 0.12, begins_s=3.0)
    size = machine_of(campaign, Constants({}))
    assert size is not None
    assert abs(size.scales["late_s"] - 0.12) < 0.02
    (segment,) = segments(campaign, size)
    assert segment.kind == "driven"
    assert segment.weak is not None
    assert int(segment.weak.starts[0]) * segment.ts_s >= size.scales["late_s"] - segment.ts_s


def test_a_load_that_nothing_recorded_is_named_and_no_effect_of_the_motor() -> None:
    """What a load takes of the voltage follows neither speed nor acceleration."""
    campaign = log(7, 0.0)
    (one,) = campaign.captures
    (table,) = one.tables
    t_s, volts = (table[name].to_numpy() for name in ("t_s", "vq_v"))
    pull = pl.Series("vq_v", volts + 0.8 * np.sin(3.0 * t_s))
    loaded = replace(campaign, captures=(replace(one, tables=(table.with_columns(pull),)),))
    found = compare(loaded, ModelSpec(), Constants({}))
    assert found.errors == ()
    assert "log iq_a" in found.notes[0]
    told = diagnose(loaded, ModelSpec(), Constants({}))
    assert told.verdict == "insufficient"
    assert any("log iq_a" in note for note in told.notes)


@pytest.mark.parametrize(
    ("names", "needed"),
    [(("theta_mech_rad",), "vq_v"), (("vq_v",), "theta_mech_rad, omega_mech_rad_s")],
)
def test_a_log_of_no_use_says_what_it_lacks(names: tuple[str, ...], needed: str) -> None:
    """By its path, with the columns that the nearest equation has besides."""
    campaign = log(8, 0.0)
    (one,) = campaign.captures
    tables = tuple(table.select(["t_s", *names]) for table in one.tables)
    blind = replace(campaign, captures=(replace(one, tables=tables),))
    found = compare(blind, ModelSpec(), Constants({}))
    assert any("log.csv: " in note and needed in note for note in found.notes)
