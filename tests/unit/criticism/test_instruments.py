"""Each instrument has a gain of its own, with the uncertainty that its captures state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.instruments import gains_of, stated_u
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import Instrument
from pipeline.criticism.machine.model import Model, base_of
from pipeline.criticism.regression.gauss_newton import first_fit, rough_fit
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants

R_OHM = 0.41


def two_terminals(name, u_amps, u_volts, reads=1.0, seed=0):
    """Levels of current through a pair; `reads` is the gain of the ammeter of that day."""
    rng = np.random.default_rng(seed)
    t = np.arange(6000) * 1e-4
    amps = 2.0 * (1 + np.floor(t / 0.1) % 3)
    columns = {
        "t_s": t,
        "vab_v": 2.0 * R_OHM * amps + rng.normal(0.0, 1e-4, t.size),
        "ia_a": reads * amps + rng.normal(0.0, 1e-4, t.size),
    }
    meta = CaptureMeta(
        "m", "resistance", pole_pairs=4, pair="ab", u_rel_current=u_amps, u_rel_voltage=u_volts
    )
    return Capture(name, "0", "verified", meta, (pl.DataFrame(columns),))


def other(test, u_amps, u_volts, *columns, **meta):
    table = pl.DataFrame({name: [0.0, 1.0] for name in columns})
    known = CaptureMeta("m", test, u_rel_current=u_amps, u_rel_voltage=u_volts, **meta)
    return Capture(test, "0", "verified", known, (table,))


def test_a_scope_a_multimeter_a_drive_and_a_bridge_are_four_instruments():
    captures = (
        other("drive", 0.01, 0.005, "id_a", "iq_a", "vd_v", "vq_v", voltage_kind="commanded"),
        other("open_circuit", 0.004, 0.015, "vab_v", "vbc_v"),
        other("resistance", 0.004, 0.003, "vab_v", "ia_a"),
        other("lcr", 0.05, 0.05, "theta_elec_deg", "lab_h"),
        other("spin_down", 0.2, 0.2, "omega_mech_rad_s"),
    )
    gains = gains_of(captures)
    assert gains["drive"] == {"gain_current": "gain_current", "gain_commanded": "gain_commanded"}
    assert gains["open_circuit"] == {"gain_voltage": "gain_voltage_2"}
    assert gains["resistance"] == {
        "gain_current_bench": "gain_current_bench",
        "gain_voltage": "gain_voltage",
    }
    assert gains["lcr"] == gains["spin_down"] == {}
    u = stated_u(captures)
    assert u.pop("gain_lcr") == u.pop("phase_lcr_rad") == pytest.approx(0.05 * 2**0.5)
    assert u == {
        "gain_current": 0.01,
        "gain_commanded": 0.005,
        "gain_voltage_2": 0.015,
        "gain_current_bench": 0.004,
        "gain_voltage": 0.003,
    }


def test_an_instrument_that_states_nothing_is_beside_one_that_does_known_to_a_percent():
    captures = (two_terminals("a", 0.001, 0.001), two_terminals("b", None, 0.001))
    assert stated_u(captures)["gain_current_bench_2"] == 0.01
    assert "gain_current_bench" not in stated_u(captures[1:])


def test_two_ammeters_may_disagree_by_what_they_state_and_the_better_one_counts():
    """With the larger u for both and one gain, they could not: R stood between the two."""
    off = 0.006
    campaign = Campaign(
        "m",
        (
            two_terminals("analyser", 0.0005, 0.0005, seed=1),
            two_terminals("shunts", 0.003, 0.0005, 1.0 + off, seed=2),
        ),
    )
    found = machine_of(campaign, Constants())
    rows = segments(campaign, found)
    assert [s.instrument.ammeter for s in rows] == ["gain_current_bench", "gain_current_bench_2"]
    system = first_fit(rough_fit(rows, Model(found, ())))
    assert system.fit.values["r_ohm"] == pytest.approx(R_OHM, rel=3e-4)
    apart = system.fit.values["gain_current_bench_2"] - system.fit.values["gain_current_bench"]
    assert apart == pytest.approx(off, rel=0.05)
    assert system.reduced_chi2(system.residual).max() < 1.3
    costs = dict(zip((c.name for c in system.columns), system.prior_costs(), strict=True))
    assert costs["gain_current_bench_2"] == pytest.approx((off / 0.003) ** 2, rel=0.15)
    assert costs["gain_current"] == pytest.approx(0.0, abs=1e-6)
    assert "gain_current_bench_2" in {constant.name for constant in base_of(found)}


@pytest.mark.parametrize(
    ("kind", "name"), [("measured", "gain_current_rest_1"), ("commanded", "gain_current")]
)
def test_what_measures_a_rotor_at_rest_has_an_ammeter_of_its_own(kind, name):
    """An analyser of the maps and the supply of a heat run may state the same uncertainty."""
    columns = ("id_a", "iq_a", "vd_v", "vq_v")
    captures = (
        other("torque_map", 0.001, 0.0005, *columns, voltage_kind="measured"),
        other("heat_run", 0.001, 0.0005, *columns, voltage_kind=kind),
    )
    gains = gains_of(captures)
    assert gains["torque_map"]["gain_current"] == "gain_current"
    assert name in gains["heat_run"].values()
    assert stated_u(captures)[name] == 0.001


def test_what_another_station_recorded_is_by_other_instruments():
    """Both state the same uncertainties, and share nothing but the motor."""
    dq = ("id_a", "iq_a", "vd_v", "vq_v", "torque_shaft_nm", "temp_winding_degc")
    kinds = {"u_rel_torque": 0.003, "u_temp_degc": 1.0, "voltage_kind": "commanded"}
    captures = tuple(
        replace(other("torque_map", 0.004, 0.003, *dq, station=at, **kinds), path=at)
        for at in ("lab", "line")
    )
    gains = gains_of(captures)
    assert gains["lab"] == {kind: kind for kind in gains["lab"]}
    assert gains["line"] == {kind: f"{kind}_2" for kind in gains["lab"]}
    assert set(gains["lab"]) == {"gain_current", "gain_commanded", "gain_torque", "offset_temp_k"}
    u = stated_u(captures)
    assert u["gain_torque_2"] == u["gain_torque"] == 0.003
    assert u["offset_temp_k_2"] == u["offset_temp_k"] == 1.0
    assert u["gain_current_2"] == 0.004 and u["gain_commanded_2"] == 0.003


def test_two_stations_may_disagree_by_what_each_states():
    """With one ammeter for both, R stood between the two at many times their noise."""
    off = 0.006
    captures = tuple(
        replace(one, meta=replace(one.meta, station=one.path))
        for one in (
            two_terminals("lab", 0.003, 0.0005, seed=1),
            two_terminals("line", 0.003, 0.0005, 1.0 + off, seed=2),
        )
    )
    found = machine_of(Campaign("m", captures), Constants())
    rows = segments(Campaign("m", captures), found)
    system = first_fit(rough_fit(rows, Model(found, ())))
    assert system.reduced_chi2(system.residual).max() < 1.3
    apart = system.fit.values["gain_current_bench_2"] - system.fit.values["gain_current_bench"]
    assert apart == pytest.approx(off, rel=0.05)


def test_a_second_drives_voltage_is_commanded_as_well():
    assert Instrument("drive", "instant", "gain_commanded_2").commanded
    assert not Instrument("drive", "instant", "gain_voltage_2").commanded


def test_thermometers_of_another_station_have_an_offset_in_kelvin():
    dq = ("id_a", "iq_a", "vd_v", "vq_v", "temp_winding_degc")
    stations = (
        replace(other("torque_map", 0.004, 0.003, *dq, station=at, pole_pairs=3), path=at)
        for at in ("lab", "line")
    )
    found = machine_of(Campaign("m", tuple(stations)), Constants())
    second = next(c for c in base_of(found) if c.name == "offset_temp_k_2")
    assert (second.unit, second.curved) == ("K", True)
