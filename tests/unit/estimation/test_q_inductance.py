"""q inductance of a drive log, where no test at standstill gives it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators.q_inductance import ESTIMATOR
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from tests.simulated import design
from tests.unit.estimation.mechanical import recorded

MOTOR = design("gimbal-5208")


def of(campaign: Campaign) -> Estimate:
    """What the drives or maps give."""
    known: Constants = fit_all(campaign, {}, only=frozenset({"lq_h"}))[0]
    return next(e for e in known.all_of("lq_h") if e.method == ESTIMATOR.name)


def stating(campaign: Campaign, pole_pairs: int | None) -> Campaign:
    captures = tuple(
        replace(c, meta=replace(c.meta, pole_pairs=pole_pairs)) for c in campaign.captures
    )
    return replace(campaign, captures=captures)


@pytest.mark.parametrize(("test", "most"), [("drive", 0.24), ("torque_map", 0.12)])
def test_a_log_at_speed_gives_the_q_inductance_within_its_interval(test: str, most: float) -> None:
    """Of a drive the current also makes the shaft gather speed, and its frame may be behind."""
    found = of(stating(recorded(tests=(test,)), MOTOR.pole_pairs))
    assert found.status == "measured"
    assert found.number == pytest.approx(MOTOR.lq_h, rel=0.03)
    assert abs(found.number - MOTOR.lq_h) < 2.0 * found.u < most * MOTOR.lq_h
    assert any(part.source == "assumed:lq_h_at_speed" for part in found.budget)


def test_a_frame_that_is_behind_by_acceleration_is_within_the_interval() -> None:
    """A tracking loop of 1000 rad/s. Without that part of it the interval would be too narrow."""
    drive = stating(recorded(tests=("drive",)), MOTOR.pole_pairs)
    turned = []
    for capture in drive.captures:
        table = capture.tables[0]
        t, theta = (table[name].to_numpy() for name in ("t_s", "theta_mech_rad"))
        smooth = np.convolve(np.gradient(theta, t), np.ones(41) / 41.0, "same")
        behind = np.exp(1j * 1e-6 * MOTOR.pole_pairs * np.gradient(smooth, t))
        columns = []
        for d, q in (("id_a", "iq_a"), ("vd_v", "vq_v")):
            seen = (table[d].to_numpy() + 1j * table[q].to_numpy()) * behind
            columns += [pl.Series(d, seen.real), pl.Series(q, seen.imag)]
        turned.append(replace(capture, tables=(table.with_columns(columns),)))
    plain, found = of(drive), of(replace(drive, captures=tuple(turned)))
    by_source = {part.source: part.u for part in found.budget}
    assert found.number - plain.number == pytest.approx(by_source["assumed:lq_h_frame"], rel=0.2)
    assert abs(found.number - MOTOR.lq_h) < 2.0 * found.u


def test_it_says_on_which_pole_pairs_it_rests_and_scales_with_them() -> None:
    drive = recorded(tests=("drive",))
    right, wrong = (of(stating(drive, n * MOTOR.pole_pairs)) for n in (1, 2))
    assert f"rests on the {MOTOR.pole_pairs} pole pairs that the captures state" in right.note
    assert wrong.number == pytest.approx(0.5 * right.number, rel=0.05)


def test_without_pole_pairs_they_are_asked_for() -> None:
    found = of(stating(recorded(tests=("drive",)), None))
    assert found.status == "not_identifiable"
    assert "state pole_pairs" in found.note


def test_a_drive_without_an_encoder_is_asked_for_its_angle() -> None:
    """An observer's lag under acceleration would read as inductance."""
    drive = stating(recorded(tests=("drive",)), MOTOR.pole_pairs)
    blind = tuple(
        replace(c, tables=tuple(t.drop("theta_mech_rad") for t in c.tables)) for c in drive.captures
    )
    found = of(replace(drive, captures=blind))
    assert found.status == "not_identifiable"
    assert "theta_mech_rad" in found.note


def test_a_test_at_standstill_is_not_widened_by_a_rougher_value() -> None:
    found = of(recorded(tests=("lcr", "drive")))
    assert found.status == "not_identifiable"
    assert "standstill" in found.note
