"""Mechanical constants of recordings that this project did not make."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from pipeline.estimation.registry import fit_all
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.map_file import load_source_maps
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.settings import configuration_folder

DATA = Path(__file__).parents[4] / "shared" / "data"
needs_rig = pytest.mark.skipif(not (DATA / "rig").is_dir(), reason="../shared/data/rig is not here")
needs_laas = pytest.mark.skipif(
    not (DATA / "real" / "laas_solo").is_dir(), reason="../shared/data/real/laas_solo is not here"
)


@cache
def constants(folder: str) -> Constants:
    """Every estimate from the recordings of one folder of the shared data."""
    where = DATA / folder
    found = survey(where, load_source_maps(configuration_folder() / "source"))
    captures = tuple(read_capture(where, entry) for entry in found.entries)
    return fit_all(Campaign(captures[0].meta.motor_id, captures), {})[0]


def true_constants(motor: str) -> dict[str, Any]:
    constants: dict[str, Any] = json.loads((DATA / "rig" / motor / "truth.json").read_bytes())
    return constants["constants"]


# Every estimate of one of these motors takes ten seconds and more; tests/e2e/test_rig.py has P0,
# tests/unit/estimation/test_electrical.py the electrical constants of P1.
MOTORS = [pytest.param(name, marks=pytest.mark.slow) for name in ("P1", "P2", "P3", "P4")]


@needs_rig
@pytest.mark.parametrize("motor", MOTORS)
@pytest.mark.parametrize(
    "name", ["kt_peak_nm_a", "j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad"]
)
def test_truth_lies_in_the_interval_whatever_is_hidden(motor: str, name: str) -> None:
    """Dead time and cogging, saturation, Stribeck and an eccentric encoder, an unknown brake."""
    truth = true_constants(motor)[name]
    found = constants(f"rig/{motor}").best(name)
    if motor == "P4" and name == "b_visc_nm_s_rad":
        assert found is None or found.interval()[0] <= truth <= found.interval()[1]
        return
    assert found is not None
    low, high = found.interval()
    assert low <= truth <= high
    assert found.u < 0.1 * truth


@needs_rig
@pytest.mark.slow
@pytest.mark.parametrize("motor", ["P0", "P2", "P3", "P4"])
def test_no_cogging_is_invented(motor: str) -> None:
    assert constants(f"rig/{motor}").best("cogging_order") is None


@needs_rig
def test_cogging_and_pole_pairs_are_found_where_they_are() -> None:
    true, found = true_constants("P1"), constants("rig/P1").chosen()
    assert found["pole_pairs"].value == 10
    assert found["cogging_order"].value == true["cogging_order"]
    low, high = found["cogging_amplitude_nm"].interval()
    assert low <= true["cogging_amplitude_nm"] <= high
    assert found["cogging_amplitude_nm"].number == pytest.approx(
        true["cogging_amplitude_nm"], rel=0.02
    )


@needs_laas
def test_small_outrunner_on_a_real_bench() -> None:
    """T-Motor MN4004-KV300, 12 pole pairs, 18 slots: Ke 0.0184 from KV, order 72 = LCM(18, 24)."""
    known = constants("real/laas_solo")
    ke, order = known.best("ke_phase_peak_v_s_rad"), known.best("cogging_order")
    left, inertia = known.best("holding_residual_a"), known.best("j_rotor_kgm2")
    assert ke is not None
    assert order is not None
    assert left is not None
    assert inertia is not None
    assert 0.0184 <= ke.number <= 0.0195
    kv = known.best("kv_ll_peak_rpm_v")
    assert kv is not None
    assert abs(kv.number - 300.0) < 2.0 * kv.u
    assert order.number == 72
    assert left.number + 2.0 * left.u < 0.03
    assert inertia.number == pytest.approx(5.4e-6, rel=0.1)


@needs_laas
def test_holding_current_keeps_to_a_handful_of_orders() -> None:
    """The real orders 12, 18, 24 and 72 are named; not the 160 that would fit and not predict."""
    order = constants("real/laas_solo").best("cogging_order")
    assert order is not None
    for named in ("72 (LCM of slots and poles)", "18 (slots)", "12 (pole pairs)", "24 (poles)"):
        assert named in order.note
