"""A magnet that lost flux between two captures of a whole programme, on three motors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign, record
from pipeline.simulator.design import Bench
from tests.simulated import QUIET, campaign_of, design

TESTS = (
    *("resistance_ab", "open_circuit_forward", "open_circuit_backward_warm"),
    *("torque_map_slow", "torque_map_backward", "drive_0", "drive_1_warm"),
)
LATE = ("open_circuit_backward_warm", "torque_map_backward", "drive_1_warm")


def diagnosed(name, kept):
    """Captures of which the `LATE` ones have a share of the magnet's flux left."""
    motor = replace(design(name), effects={})
    late = {"changed": {"psi_pm_wb": kept * motor.psi_pm_wb}}
    plan = tuple(
        (stem, test, {**how, **(late if stem in LATE else {})})
        for stem, test, how in CAMPAIGN
        if stem in TESTS
    )
    return diagnose(campaign_of(campaign(motor, Bench(), 6, plan)), ModelSpec(), Constants())


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        pytest.param("gimbal-5208", 0.94, marks=pytest.mark.slow),
        pytest.param("joint-11p", 0.96, marks=pytest.mark.slow),
        pytest.param("servo-ipm", 0.92, marks=pytest.mark.slow),
    ],
)
def test_the_flux_that_a_magnet_lost_is_reported_with_its_captures(name, kept):
    found = diagnosed(name, kept)
    assert (found.verdict, found.missing) == ("unknown", ())
    note = next(note for note in found.notes if note.startswith("psi_wb is"))
    assert all(f"{stem}.mcap" in note for stem in LATE) or "higher" in note
    share = float(note.split()[2])
    assert share == pytest.approx(100.0 * (1.0 - kept), rel=0.1)


def test_a_capture_with_another_magnet_has_its_voltage():
    motor, how = design("gimbal-5208"), {"levels": (0.5,)}
    weak = {"changed": {"psi_pm_wb": 0.9 * motor.psi_pm_wb}}
    one, other = (
        record("open_circuit", motor, QUIET, np.random.default_rng(1), **how, **more).tables[0]
        for more in ({}, weak)
    )
    ratio = np.std(other["vab_v"]) / np.std(one["vab_v"])
    assert ratio == pytest.approx(0.9, rel=1e-3)
