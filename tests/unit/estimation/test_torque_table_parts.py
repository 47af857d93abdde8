"""Torque tables of a clamped shaft: their slope and its scatter on small ones."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators import (
    torque_table,
)
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value


def clamped(kt=0.12, *, offset=0.03, sag=0.0, stick=0.0, noise=1e-5, levels=None, d=None, seed=0):
    levels = (
        np.array([-8.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0, 8.0] * 2) if levels is None else levels
    )
    rng = np.random.default_rng(seed)
    id_ = np.zeros(levels.size) if d is None else d
    t = offset + kt * levels - sag * levels**3 - stick * np.sign(levels) + 0.002 * id_ * levels
    return capture("torque_table", f"table_{offset}", u_rel_torque=0.004, iq_a=levels, id_a=id_,
                   torque_shaft_nm=t + noise * rng.standard_normal(levels.size))  # fmt: skip


def test_the_slope_of_a_clamped_shaft() -> None:
    found = estimates(torque_table.ESTIMATOR, clamped(), clamped(offset=-0.5, seed=1))[
        "kt_peak_nm_a"
    ]
    assert found.number == pytest.approx(0.12, rel=1e-4)
    parts = {p.source: p.u for p in found.budget}
    assert parts["torque@s"] == pytest.approx(0.004 * found.number, rel=1e-6)
    assert parts["current@s"] == pytest.approx(-0.002 * found.number, rel=1e-5)
    assert found.at["iq_a"] == 8.0
    sagging = estimates(torque_table.ESTIMATOR, clamped(sag=1e-4))["kt_peak_nm_a"]
    assert sagging.number == pytest.approx(0.12, rel=1e-3)
    assert "sags" in sagging.note
    sticky = estimates(torque_table.ESTIMATOR, clamped(stick=0.02))["kt_peak_nm_a"]
    assert sticky.number == pytest.approx(0.12, rel=1e-3)
    moving = estimates(torque_table.ESTIMATOR, clamped(d=np.tile([-2.0, 0.0, 1.0, -1.0], 4)))[
        "kt_peak_nm_a"
    ]
    assert moving.number == pytest.approx(0.12, rel=1e-3)


def test_the_scatter_of_a_clamped_slope_and_its_magnets() -> None:
    made = clamped(noise=1e-3)
    found = estimates(torque_table.ESTIMATOR, made)["kt_peak_nm_a"]
    data = made.arrays("iq_a", "torque_shaft_nm")
    fit = linear_fit(np.column_stack([np.ones(16), data["iq_a"]]), data["torque_shaft_nm"])
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(fit.u(1))
    assert scatter.dof == 14
    warm = made.tables[0].with_columns(temp_magnet_degc=np.full(16, 65.0))
    known = Constants((known_value("temp_coeff_magnet_1_k", -0.001, 1e-4),))
    hot = estimates(torque_table.ESTIMATOR, replace(made, tables=(warm,)), known=known)[
        "kt_peak_nm_a"
    ]
    assert hot.number == pytest.approx(found.number / 0.96)
    part = {p.source: p.u for p in hot.budget}["test:temp_coeff_magnet_1_k"]
    assert part == pytest.approx(-hot.number * 40.0 / 0.96 * 1e-4, rel=1e-3)


def test_few_rows_or_levels_are_no_slope() -> None:
    """Five rows and one a table; four currents a hundredth of their range apart."""
    for levels, there in (
        ([-4.0, -2.0, 0.0, 2.0, 4.0], False),
        ([-4.0, -2.0, 0.0, 2.0, 4.0, 4.0], True),
        ([-4.0, -4.0, 0.0, 0.0, 4.0, 4.0], False),
        ([-4.0, -3.97, 0.0, 0.0, 4.0, 4.0], False),
        ([-4.0, -3.8, 0.0, 0.0, 4.0, 4.0], True),
    ):
        found = estimates(torque_table.ESTIMATOR, clamped(levels=np.array(levels)))
        assert found["kt_peak_nm_a"].known is there


def test_columns_of_a_clamped_shaft() -> None:
    iq, id_ = np.array([2.0, -4.0]), np.array([1.0, 3.0])
    base, more = torque_table.torque(iq, id_, np.array([0.9, 1.0]), np.array([0.1, 0.2]))
    assert base.tolist() == [[1.0, 1.8, 2.0], [1.0, -4.0, -12.0]]
    assert more["iq^3"].tolist() == [8.0, -64.0]
    assert more["iq^5"].tolist() == [32.0, -1024.0]
    assert more["sign iq"].tolist() == [1.0, -1.0]
    assert more["iq cos 6"] == pytest.approx([2.0 * math.cos(0.6), -4.0 * math.cos(1.2)])
    assert more["iq sin 12"] == pytest.approx([2.0 * math.sin(1.2), -4.0 * math.sin(2.4)])
    for share, width in ((0.048, 2), (0.052, 3)):
        for other in (0.0, 6.0 * share):
            steady = np.array([other, 6.0 * share])
            assert torque_table.torque(iq, steady, iq * 0 + 1.0)[0].shape[1] == width
