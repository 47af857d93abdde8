"""An effect of no size changes nothing, on any kind of capture, through any of its hooks."""

from __future__ import annotations

from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.equations import equations
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import LATE_TORQUE, PHASE_LCR, Model, zero
from pipeline.criticism.residuals.observability import observes
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from tests.unit.criticism.machines import BASE, machine

LIBRARY = effects()
DRIVE = ("t_s", "vd_v", "vq_v", "id_a", "iq_a", "theta_mech_rad", "torque_shaft_nm")
RECORDED: dict[str, tuple[str, tuple[str, ...]]] = {
    "dq": ("torque_map", (*DRIVE, "temp_winding_degc", "temp_magnet_degc")),
    "q": ("drive", ("t_s", "vq_v", "iq_a", "theta_mech_rad", "omega_mech_rad_s")),
    "motion": ("drive", ("t_s", "vq_v", "iq_a", "theta_mech_rad", "omega_mech_rad_s")),
    "driven": ("drive", ("t_s", "vq_v", "theta_mech_rad", "omega_mech_rad_s")),
    "load": ("torque_map", ("t_s", "iq_a", "theta_mech_rad", "torque_shaft_nm")),
    "shaft": ("spin_down", ("t_s", "theta_mech_rad")),
    "open": ("open_circuit", ("t_s", "vab_v", "vbc_v", "vca_v", "theta_mech_rad")),
    "terminal": ("resistance", ("t_s", "vab_v", "ia_a")),
    "lcr": ("lcr", ("theta_elec_deg", "lab_h", "rab_ohm", "freq_hz")),
    "flux_map": ("flux_map", ("id_a", "iq_a", "psi_d_wb", "psi_q_wb")),
    "steady": ("flux_map", ("id_a", "omega_mech_rad_s", "vq_v")),
    "torque_table": ("torque_table", ("id_a", "iq_a", "theta_mech_rad", "torque_shaft_nm")),
    "standing": ("holding_current", ("t_s", "theta_mech_rad", "iq_a")),
}


def signals(n: int = 4000) -> dict[str, np.ndarray]:
    """Columns that move, whatever they are of; nothing here obeys an equation."""
    random = np.random.default_rng(3)
    t = 5e-4 * np.arange(n)
    slow = {
        name: 3.0 * np.sin(7.0 * t + k) + 0.01 * random.normal(size=n)
        for k, name in enumerate(("vd_v", "vq_v", "id_a", "iq_a", "vab_v", "vbc_v", "torque"))
    }
    theta = 20.0 * np.sin(2.0 * t) + 1e-5 * random.normal(size=n)
    return {
        **slow,
        "t_s": t,
        "theta_mech_rad": theta,
        "omega_mech_rad_s": 40.0 * np.cos(2.0 * t) + 0.01 * random.normal(size=n),
        "vca_v": -slow["vab_v"] - slow["vbc_v"],
        "torque_shaft_nm": slow["torque"],
        "ia_a": np.full(n, 3.0),
        "temp_winding_degc": 25.0 + 10.0 * t,
        "temp_magnet_degc": 25.0 + 5.0 * t,
        "theta_elec_deg": np.arange(n) * 360.0 / n,
        "lab_h": 5e-4 + 1e-6 * random.normal(size=n),
        "rab_ohm": 0.62 + 1e-3 * random.normal(size=n),
        "freq_hz": np.full(n, 1000.0),
        "psi_d_wb": 0.01 + 1e-3 * slow["id_a"],
        "psi_q_wb": 1e-3 * slow["iq_a"],
    }


@cache
def segment_of(kind: str) -> Segment:
    test, names = RECORDED[kind]
    columns = signals()
    if kind == "motion":
        # a shaft that the current alone turns
        columns["iq_a"] = -0.2 * columns["theta_mech_rad"]
    if kind == "driven":
        # one that the voltage alone drives
        columns["vq_v"] = 0.4 * np.gradient(columns["theta_mech_rad"], columns["t_s"])
    if kind == "steady":
        columns["id_a"] = np.repeat([0.0, -4.0, -8.0, -12.0], 1000)
    if kind == "torque_table":
        columns["iq_a"] = np.repeat([-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0, 12.0], 500)
        columns["theta_mech_rad"] = np.repeat(np.linspace(0.0, 1.0, 80), 50)
    meta = CaptureMeta("m", test, pole_pairs=7, pair="ab", ambient_degc=31.0)
    table = pl.DataFrame({name: columns[name] for name in names})
    campaign = Campaign("m", (Capture("x.csv", "0", "verified", meta, (table,)),))
    return next(s for s in segments(campaign, machine()) if s.kind == kind)


@pytest.mark.parametrize("kind", RECORDED)
@pytest.mark.parametrize("name", LIBRARY)
def test_zero_parameters_are_zero_effect(kind: str, name: str) -> None:
    """Every hook at zero amplitude: flux, drop, drag and what the sensors are corrected by."""
    segment, effect = segment_of(kind), LIBRARY[name]
    plain = Model(machine(), ())
    model = plain.with_effects(effect)
    without = residual(segment, plain, BASE)
    with_it = residual(segment, model, {**BASE, **zero(effect, model)})
    size = np.abs(without).max(axis=1, keepdims=True)
    assert (size > 0.0).all()
    assert np.abs((with_it - without) / size).max() < 1e-9


@pytest.mark.parametrize("name", LIBRARY)
def test_an_effect_of_some_size_changes_some_capture(name: str) -> None:
    """So that the test above compares something that would be seen."""
    assert max(change_by(name, segment_of(kind)) for kind in RECORDED) > 0.0


def change_by(name: str, segment: Segment) -> float:
    """The most that an effect of typical size changes in a residual."""
    effect, plain = LIBRARY[name], Model(machine(), ())
    model = plain.with_effects(effect)
    values = {**BASE, **zero(effect, model)}
    for p in effect.parameters_of(machine()):
        if p.amplitude:
            values[f"{name}.{p.name}"] = p.typical * machine().scale(p)
    change = residual(segment, model, values) - residual(segment, plain, BASE)
    return float(np.abs(change).max())


@pytest.mark.parametrize("kind", [kind for kind in RECORDED if kind != "lcr"])
@pytest.mark.parametrize("name", LIBRARY)
def test_what_a_segment_does_not_hear_changes_nothing_in_it(kind: str, name: str) -> None:
    """No column is computed for it: were it observed, the fit would not know."""
    segment, effect = segment_of(kind), LIBRARY[name]
    if not observes(segment, effect):
        assert change_by(name, segment) == 0.0


@pytest.mark.parametrize("kind", RECORDED)
def test_a_constant_that_a_segment_does_not_hear_changes_nothing_in_it(kind: str) -> None:
    """But for less than a millionth: the ripple of a q log, and the creep of a held rotor. Gains,
    phases, and the lag of a transducer, go by the sensors that a segment has.
    """
    segment, plain = segment_of(kind), Model(machine(), ())
    here = residual(segment, plain, BASE)
    sensors = ("gain_", "offset_", "unlogged_", PHASE_LCR, LATE_TORQUE)
    constants = {c for c in BASE if not c.startswith(sensors)}
    observed = set(equations()[kind].observes.constants)
    assert constants >= observed
    for name in constants - observed:
        moved = {**BASE, name: BASE[name] + 1e-3 * max(abs(BASE[name]), 1.0)}
        change = np.abs(residual(segment, plain, moved) - here).max()
        assert change < 1e-6 * np.abs(here).max(), name
