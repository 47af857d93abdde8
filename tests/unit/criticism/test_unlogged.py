"""A temperature that was not recorded is a nuisance of the fit, and in its uncertainties."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
U_K = DEFAULT.priors.unlogged_k
REACH = 1.96


def spins(*without: str) -> Campaign:
    plan = (
        ("cold", "open_circuit", {}),
        ("warm", "open_circuit", {"temp_magnet_degc": 58.0, "levels": (-0.3, -0.6)}),
    )
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, plan))
    kept = (
        replace(one, tables=tuple(t.drop(without, strict=False) for t in one.tables))
        for one in whole.captures
    )
    return replace(whole, captures=tuple(kept))


def flux(captures: Campaign):
    result = compare(captures, ModelSpec(), Constants())
    return result.parameters["psi_wb"], result


def test_a_warm_magnet_without_a_thermometer():
    """It gave psi 3.7 % low, by 40 of its uncertainties."""
    both = spins("temp_magnet_degc")
    warm = replace(both, captures=tuple(c for c in both.captures if c.path == "warm.mcap"))
    psi, result = flux(warm)
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value == pytest.approx(U_K * 0.0011, rel=0.1)
    assert any(f"± {U_K:g} K" in note for note in result.notes)


def test_a_recorded_temperature_leaves_the_flux_as_sharp_as_the_instruments():
    psi, _ = flux(spins())
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value < 0.005


@pytest.mark.parametrize("lost", [("theta_mech_rad",), ("theta_mech_rad", "omega_mech_rad_s")])
def test_a_trace_of_line_voltages_without_an_encoder_has_the_flux(lost):
    psi, result = flux(spins(*lost))
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value < 0.005
    assert not any("not used" in note for note in result.notes)
