"""A capture of a motor without losses or sensors' faults is what its constants say of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.physics.machine import DqMeans, air_gap_torque, dq_voltages
from pipeline.records.capture import Capture, CaptureMeta
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.stages.steps.replay import replay

CONSTANTS = {
    "pole_pairs": (4.0, "1"),
    "r_phase_ohm": (0.3, "ohm"),
    "ld_h": (2e-4, "H"),
    "lq_h": (3e-4, "H"),
    "psi_pm_wb": (0.01, "Wb"),
    "kt_peak_nm_a": (0.06, "N·m/A"),
    "j_rotor_kgm2": (1e-4, "kg·m²"),
    "torque_coulomb_nm": (5e-3, "N·m"),
    "b_visc_nm_s_rad": (1e-5, "N·m·s/rad"),
}
ROWS, PERIOD_S = 20_000, 5e-5


def make_sheet(**changed: float) -> Datasheet:
    told = {
        name: Estimate(name, changed.get(name, value), unit, "measured", "test")
        for name, (value, unit) in CONSTANTS.items()
    }
    sheet = Datasheet("m", None, None, "v", "provisional", (), (), "", "", told, (), ())
    return replace(sheet, constants={n: e for n, e in told.items() if e.number != 0.0})


def make_drive() -> Capture:
    """Smooth currents and speed, voltages and torque by the equations themselves."""
    t = np.arange(ROWS) * PERIOD_S
    slow = 2 * np.pi * 3.0
    id_a, iq_a = -2.0 + np.sin(slow * t), 8.0 * np.sin(2 * slow * t)
    omega = 150.0 + 40.0 * np.sin(slow * t)
    theta = 150.0 * t - 40.0 / slow * (np.cos(slow * t) - 1.0)
    rates = slow * np.cos(slow * t), 16.0 * slow * np.cos(2 * slow * t)
    state = DqMeans(id_a, iq_a, *rates, 4.0 * omega)
    vd, vq = dq_voltages(state, np.full(ROWS, 0.3), 2e-4, 3e-4, np.full(ROWS, 0.01))
    torque = air_gap_torque(id_a, iq_a, np.full(ROWS, 0.06), 4.0, -1e-4)
    torque -= 5e-3 + 1e-5 * omega + 1e-4 * 40.0 * slow * np.cos(slow * t)
    columns = {"t_s": t, "id_a": id_a, "iq_a": iq_a, "vd_v": vd, "vq_v": vq}
    columns |= {"theta_mech_rad": theta, "torque_shaft_nm": torque}
    return Capture("d", "0" * 64, "verified", CaptureMeta("m", "drive"), (pl.DataFrame(columns),))


def residuals(sheet: Datasheet, capture: Capture) -> dict[str, np.ndarray]:
    return {
        one.y_name: one.series[0].measured - one.series[0].fitted for one in replay(capture, sheet)
    }


def test_nothing_is_left_where_the_constants_are_right() -> None:
    left = residuals(make_sheet(), make_drive())
    assert list(left) == ["torque_shaft_nm", "vq_v", "vd_v"]
    assert np.abs(left["vq_v"]).max() < 2e-4
    assert np.abs(left["vd_v"]).max() < 2e-4
    assert np.abs(left["torque_shaft_nm"][100:-100]).max() < 2e-4


@pytest.mark.parametrize(
    ("name", "wrong", "signal", "factor"),
    [
        ("psi_pm_wb", 0.0101, "vq_v", 4 * 1e-4),
        ("r_phase_ohm", 0.31, "vq_v", 0.01),
        ("kt_peak_nm_a", 0.0606, "torque_shaft_nm", 6e-4),
    ],
)
def test_a_wrong_constant_is_left_over_in_proportion(
    name: str, wrong: float, signal: str, factor: float
) -> None:
    """A flux 1 % too large leaves −p Δψ ω in v_q, a resistance −ΔR i_q, a Kt −ΔKt i_q."""
    capture = make_drive()
    told = next(e for e in replay(capture, make_sheet(**{name: wrong})) if e.y_name == signal)
    series = told.series[0]
    data = capture.arrays("t_s", "iq_a", "theta_mech_rad")
    cause = data["iq_a"]
    if name == "psi_pm_wb":
        cause = np.gradient(data["theta_mech_rad"], data["t_s"])
    expected = -factor * np.interp(series.x, data["t_s"], cause)
    left = series.measured - series.fitted
    assert np.abs(left - expected)[100:-100].max() < 0.02 * np.abs(expected).max() + 2e-4


def test_what_the_datasheet_does_not_know_is_not_replayed() -> None:
    assert [e.y_name for e in replay(make_drive(), make_sheet(psi_pm_wb=0.0))] == [
        "torque_shaft_nm"
    ]
    assert [e.y_name for e in replay(make_drive(), make_sheet(kt_peak_nm_a=0.0))] == [
        "vq_v",
        "vd_v",
    ]


def test_where_the_load_jumps_the_torque_is_left_open_and_nothing_is_left_over() -> None:
    """A step of load accelerates the rotor within a window, where the windows cannot follow."""
    drive = make_drive()
    t = np.arange(ROWS) * PERIOD_S
    late = np.maximum(t - 0.5, 0.0)
    rows = drive.tables[0].with_columns(
        pl.col("theta_mech_rad") + 500.0 * late**2,
        pl.col("torque_shaft_nm") - np.where(late > 0, 0.1 + 1e-5 * 1000.0 * late, 0.0),
    )
    told = replay(replace(drive, tables=(rows,)), make_sheet())[0].series[0]
    left = told.measured - told.fitted
    open_s = told.x[np.isnan(left)]
    assert 0.49 < open_s.min() < open_s.max() < 0.51
    assert np.nanmax(np.abs(left[100:-100])) < 1e-3


def test_a_gap_in_the_record_leaves_no_window_across_it() -> None:
    whole = make_drive()
    rows = whole.tables[0]
    holed = replace(whole, tables=(pl.concat([rows[:5000], rows[9000:]]),))
    (told,) = [e for e in replay(holed, make_sheet()) if e.y_name == "vq_v"]
    t_s = told.series[0].x
    assert not ((t_s > 0.251) & (t_s < 0.449)).any()
    assert np.abs(told.series[0].measured - told.series[0].fitted).max() < 2e-4
