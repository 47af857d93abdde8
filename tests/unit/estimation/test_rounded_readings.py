"""Constants from readings that a converter or a file rounds: the truth stays in the interval."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.electrical.operating_points import operating_points
from pipeline.estimation.estimators.flux_map import ESTIMATOR as FLUX_MAP
from pipeline.estimation.estimators.inductance_rated import ESTIMATOR as INDUCTANCE_RATED
from pipeline.estimation.estimators.resistance import ESTIMATOR as RESISTANCE
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.records.capture import Capture
from tests.unit.estimation.signals import capture, estimates, known_value

LEVELS_A = (5.5, 11.0, 2.75, -2.75, -11.0, -5.5)


def rounded(values, step):
    return step * np.round(values / step)


def three_digits(values):
    return np.array([float(f"{x:.3g}") for x in values])


def terminals(r_ohm: float, pair: str, step_v: float, noise_v: float, seed: int) -> Capture:
    """Six levels of current through a pair, and the ramps between them."""
    rng = np.random.default_rng(seed)
    current = np.concatenate([np.append(np.full(250, i), np.linspace(i, 0, 15)) for i in LEVELS_A])
    volts = r_ohm * current + noise_v * rng.standard_normal(current.size)
    return capture(
        "resistance", f"{pair}.csv", pair=pair, u_rel_voltage=0.0, u_rel_current=0.0,
        t_s=np.arange(current.size) * 1e-3,
        **{f"v{pair}_v": rounded(volts, step_v)},
        **{f"i{pair[0]}_a": current + 1e-4 * rng.standard_normal(current.size)},
        temp_winding_degc=np.full(current.size, 25.0),
    )  # fmt: skip


@pytest.mark.parametrize("pairs", [("ab",), ("ab", "bc", "ca")])
def test_resistance_by_a_meter_of_few_steps(pairs: tuple[str, ...]) -> None:
    """0.3 ohm at 11 A by steps of half a volt: three pairs read alike are off alike."""
    errors_u = []
    for seed in range(60):
        r_ohm = 0.3 * math.exp(np.random.default_rng(seed).uniform(-0.4, 0.4))
        logs = [terminals(r_ohm, pair, 0.5, 0.02, seed) for pair in pairs]
        one = estimates(RESISTANCE, *logs, u_rel_imbalance=0.0)["r_ll_ohm"]
        errors_u.append((one.number - r_ohm) / one.u)
    assert 0.7 < np.sqrt(np.mean(np.square(errors_u))) < 1.3


def test_noise_of_half_a_step_hides_the_rounding() -> None:
    fine, coarse = (
        estimates(RESISTANCE, terminals(0.3, "ab", step, 0.25, 1))["r_ab_ohm"]
        for step in (1e-6, 0.5)
    )
    assert coarse.u < 1.5 * fine.u


def linkages(ld_h: float, lq_h: float) -> Capture:
    """A table of seven by nine currents, which are read and not set, in three digits."""
    rng = np.random.default_rng(round(1e9 * ld_h))
    d, q = (one.ravel() for one in np.meshgrid(np.linspace(-14, 7, 7), np.linspace(-14, 14, 9)))
    d, q = (one + 0.01 * rng.standard_normal(one.size) for one in (d, q))
    columns = {"id_a": d, "iq_a": q, "psi_d_wb": 0.096 + ld_h * d, "psi_q_wb": lq_h * q}
    return capture(
        "flux_map", u_rel_voltage=0.0, u_rel_current=0.0,
        **{name: three_digits(values) for name, values in columns.items()},
    )  # fmt: skip


def test_inductances_of_a_table_in_three_digits() -> None:
    errors_u: dict[str, list[float]] = {"ld_h": [], "lq_h": []}
    for seed in range(40):
        share = np.random.default_rng(seed).uniform(0.7, 1.4, 2)
        true = {"ld_h": 3.7e-3 * share[0], "lq_h": 7.3e-3 * share[1]}
        found = estimates(FLUX_MAP, linkages(true["ld_h"], true["lq_h"]))
        for name, errors in errors_u.items():
            errors.append((found[name].number - true[name]) / found[name].u)
    for errors in errors_u.values():
        assert np.sqrt(np.mean(np.square(errors))) < 1.2
        assert np.max(np.abs(errors)) < 3.3


def test_currents_that_were_set_are_what_they_say() -> None:
    """Whole amperes are no reading that was rounded to one."""
    made = linkages(3.7e-3, 7.3e-3)
    table = made.tables[0]
    exact = {n: table[n].round(0) for n in ("id_a", "iq_a")}
    flux = {"psi_d_wb": 0.0961234567 + 3.7e-3 * exact["id_a"], "psi_q_wb": 7.3e-3 * exact["iq_a"]}
    noise = np.random.default_rng(1).standard_normal(table.height)
    flux = {n: v + 1e-7 * noise for n, v in flux.items()}
    found = estimates(FLUX_MAP, replace(made, tables=(pl.DataFrame({**exact, **flux}),)))
    assert found["ld_h"].u < 1e-4 * found["ld_h"].number


def turning_map(ld_h: float, lq_h: float, step_v: float, seed: int, lost: float = 0.0) -> Capture:
    """A map at 300 rad/s with its voltages in steps: five q currents at none and at rated i_d."""
    rng = np.random.default_rng(seed)
    levels = [(d, q) for d in (0.0, -20.0) for q in (-20.0, -10.0, 0.0, 10.0, 20.0)]
    d, q = (np.repeat([one[k] for one in levels], 200) for k in (0, 1))
    omega = 4 * 300.0
    columns = {
        "t_s": np.arange(d.size) * 1e-4,
        "theta_mech_rad": 300.0 * np.arange(d.size) * 1e-4,
        "id_a": d + 0.005 * rng.standard_normal(d.size),
        "iq_a": q + 0.005 * rng.standard_normal(d.size),
        "vd_v": rounded(0.02 * d - omega * lq_h * q, step_v),
        "vq_v": rounded(0.02 * q + omega * (0.01 + ld_h * d), step_v),
        "torque_shaft_nm": 0.06 * q + 6.0 * (ld_h - lq_h) * d * q
        + 1e-4 * rng.standard_normal(d.size),
    }  # fmt: skip
    for name in set(columns) - {"t_s"}:
        columns[name] = np.where(rng.uniform(size=d.size) < lost, np.nan, columns[name])
    return capture("torque_map", pole_pairs=4, u_rel_voltage=0.0, u_rel_current=0.0, **columns)


def test_rated_inductances_by_voltages_in_few_steps() -> None:
    """Tenths of a volt beside 5 V of ω L i: the file keeps that many digits of 24 V."""
    errors_u: dict[str, list[float]] = {"ld_rated_h": [], "lq_rated_h": []}
    for seed in range(40):
        share = np.random.default_rng(seed).uniform(0.7, 1.4, 2)
        true = {"ld_rated_h": 1.5e-4 * share[0], "lq_rated_h": 1.8e-4 * share[1]}
        made = turning_map(*true.values(), 0.1, seed)
        found = estimates(INDUCTANCE_RATED, made, known=_pairs())
        for name, errors in errors_u.items():
            errors.append((found[name].number - true[name]) / found[name].u)
    for errors in errors_u.values():
        assert np.sqrt(np.mean(np.square(errors))) < 1.3
        assert np.max(np.abs(errors)) < 3.3


def _pairs():
    from pipeline.records.constants import Constants

    return Constants((known_value("pole_pairs", 4.0),))


def test_a_map_that_lacks_a_value_in_twenty_has_its_points() -> None:
    whole, holes = (turning_map(1.5e-4, 1.8e-4, 1e-9, 3, lost) for lost in (0.0, 0.05))
    points = [operating_points([made], 4).points for made in (whole, holes)]
    assert len(points[0]) == len(points[1]) == 10
    assert np.isfinite([(p.torque_nm, p.omega_mech_rad_s, p.vd_v) for p in points[1]]).all()
    constant = [
        estimates(TORQUE_MAP, made, known=_pairs())["kt_peak_nm_a"] for made in (whole, holes)
    ]
    assert constant[0].number == pytest.approx(0.06, rel=1e-3)
    assert constant[1].number == pytest.approx(constant[0].number, rel=5e-4)
