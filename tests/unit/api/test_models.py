"""Compare and diagnose as functions: the same as the commands, and frames of what they say."""

from __future__ import annotations

import polars as pl
import pytest

import pipeline

STEPS = ("spin_down", "drive", "open_circuit", "torque_map")
FEW = ("spin_down", "cogging")
ONE = ("cogging",)


@pytest.fixture(scope="module")
def recordings():
    """A motor with cogging, as its design has it, and a bump of friction at low speed."""
    return pipeline.simulate("gimbal-5208", ["stribeck"], seed=3, exact=True).only(
        tests=STEPS + FEW
    )


@pytest.mark.parametrize(
    ("tests", "known", "hidden"),
    [
        (ONE, [], "cogging"),
        pytest.param(FEW, ["cogging"], "stribeck", marks=pytest.mark.slow),
        pytest.param(STEPS, ["cogging"], "stribeck", marks=pytest.mark.slow),
    ],
)
def test_a_hidden_effect_is_found_added_and_gone(recordings, tests, known, hidden):
    recordings = recordings.only(tests=tests)
    diagnoses = pipeline.diagnose(recordings, effects=known)
    motor = recordings.motors[0]
    assert diagnoses[motor].missing == (hidden,)
    ladder = diagnoses.ladder.unique("step", maintain_order=True)
    assert ladder["added"].to_list() == ["", hidden]
    assert ladder["held_out"][1] < 0.5 * ladder["held_out"][0]
    assert diagnoses.verdicts["missing"].to_list() == [[hidden]]
    found = diagnoses.ranking.filter(pl.col("missing"))
    assert found["effect"].to_list() == [hidden]
    assert "<svg" in diagnoses.plot().svg
    with_it = pipeline.compare(recordings, effects=[*known, hidden])
    without = pipeline.compare(recordings, effects=known)
    assert with_it[motor].held_out < 0.5 * without[motor].held_out
    worst = without.errors.sort("ratio").row(-1, named=True)
    assert worst["signal"] in ("alpha_mech_rad_s2", "torque_shaft_nm", "omega_mech_rad_s")


def test_traces_are_measured_less_model(recordings):
    result = pipeline.compare(recordings.only(tests=("drive", "open_circuit")))
    traces = result.residuals.filter(pl.col("model").is_finite())
    assert traces.height > 100
    assert (traces["measured"] - traces["model"] - traces["residual"]).abs().max() == 0.0
    row = traces.row(0, named=True)
    assert row["signal"] in result.plot(row["signal"], row["capture"]).title
    with pytest.raises(KeyError, match="no trace of"):
        result.plot("nothing", row["capture"])
