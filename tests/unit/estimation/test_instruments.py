"""What an instrument counts for that states its uncertainty, states 0, or states nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.machine.model import Model
from pipeline.estimation.registry import fit_all
from pipeline.estimation.uncertainty.instruments import instrument_uncertainties, unstated_note
from pipeline.records.capture import UNSTATED_U, Campaign, Capture, CaptureMeta
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import machine

NEEDED = {
    "resistance_ab", "current_step_d_0", "current_step_q_0", "open_circuit_forward",
    "torque_map_slow", "torque_map_backward", "spin_down_forward", "drive_0",
}  # fmt: skip
KEYS = ("u_rel_voltage", "u_rel_current", "u_temp_degc", "u_rel_torque")


def capture(**meta: object) -> Capture:
    said = CaptureMeta("m", "resistance", station="s", **meta)  # type: ignore[arg-type]
    return Capture("a.csv", "0", "verified", said, ())


def test_both_rooms_take_the_same_for_an_instrument_that_states_nothing() -> None:
    """`run` and `diagnose` judge one bench alike."""
    priors = {name: u for name, (_, u) in Model(machine(), ()).priors().items()}
    assert priors["gain_current"] == UNSTATED_U["u_rel_current"]
    assert priors["gain_voltage"] == priors["gain_commanded"] == UNSTATED_U["u_rel_voltage"]
    assert priors["gain_torque"] == UNSTATED_U["u_rel_torque"]
    assert priors["offset_temp_k"] == UNSTATED_U["u_temp_degc"]
    assert priors["gain_clock"] == UNSTATED_U["u_rel_clock"]


def test_what_one_capture_of_a_station_states_holds_for_all() -> None:
    """The largest stated; the default only where none states it; told in both cases."""
    both = (capture(), capture(u_rel_voltage=0.001), capture(u_rel_voltage=0.02))
    for order in (both, both[::-1]):
        found = instrument_uncertainties(order)
        assert found == {"current@s": 0.01, "temperature@s": 2.0, "voltage@s": 0.02}
    assert unstated_note(both) == (
        "u_rel_current not stated, taken as 0.01, u_temp_degc not stated, taken as 2 K"
    )


def test_a_stated_zero_is_taken_at_its_word_and_told() -> None:
    """0 is a claim, not an omission."""
    exact = (capture(u_rel_voltage=0.0),)
    assert instrument_uncertainties(exact, ("voltage",)) == {"voltage@s": 0.0}
    assert unstated_note(exact, ("voltage",)) == (
        "u_rel_voltage stated as 0, as if the instrument had no error"
    )


@pytest.fixture(scope="module")
def silent() -> dict[str, Estimate]:
    """The constants of a simulated motor whose bench states nothing; a capture or two a test."""
    plan = tuple(step for step in CAMPAIGN if step[0] in NEEDED)
    found = campaign_of(campaign(design("gimbal-5208"), Bench(), 3, plan))
    bare = tuple(
        replace(c, meta=replace(c.meta, **dict.fromkeys(KEYS), extra={})) for c in found.captures
    )
    return fit_all(Campaign("m", bare), {})[0].chosen()


@pytest.mark.parametrize(
    "name", ["r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "kt_peak_nm_a", "j_rotor_kgm2"]
)
def test_no_constant_is_known_better_than_its_instruments(
    silent: dict[str, Estimate], name: str
) -> None:
    """A bench that states nothing has gains of a percent: no u of parts per million."""
    estimate = silent[name]
    assert estimate.u > 0.009 * estimate.number, (estimate.u, estimate.number)
    assert "not stated" in estimate.note
