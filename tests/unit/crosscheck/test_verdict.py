"""What keeps a datasheet from its release."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from pipeline.crosscheck.rules import resistance_temperature
from pipeline.crosscheck.verdict import verdict
from pipeline.estimation import registry
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.datasheet import AWAITS_APPROVAL, left_to_a_person
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import Excess, FoundEffect, ModelVerdict
from pipeline.records.uncertainty import type_a

SOUND = ModelVerdict("adequate", held_out=0.5, residual=1.1)
CAMPAIGN = Campaign("m", (Capture("a.csv", "0", "verified", CaptureMeta("m", "heat_run"), ()),))


def fitted(monkeypatch: pytest.MonkeyPatch, alpha: float, u: float) -> Constants:
    """A sound resistance, and a copper coefficient [1/K] that the glossary holds to 0 to 0.02."""

    def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
        sound = Estimate("r_phase_ohm", 0.3, "ohm", "measured", "odd")
        budget = type_a("scatter:odd", u)
        odd = Estimate(
            "temp_coeff_copper_1_k", alpha, "1/K", "measured", "odd", budget, captures=("a.csv",)
        )
        return Fit((sound, odd))

    gives = ("r_phase_ohm", "temp_coeff_copper_1_k")
    estimator = Estimator("odd", gives, ("heat_run",), "record it", fit)
    monkeypatch.setattr(registry, "estimators", lambda: (estimator,))
    return registry.fit_all(CAMPAIGN, {})[0]


def test_a_constant_that_no_motor_has_keeps_the_datasheet_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """R from kelvin is whole, its copper coefficient is nine times copper's: provisional, named."""
    known = fitted(monkeypatch, 0.0344, 1e-4)
    status, why = verdict(known.chosen(), (), (), ("r_phase_ohm",), "auto", None)
    assert status == "provisional"
    assert len(why) == 1
    assert why[0].startswith("impossible: temp_coeff_copper_1_k (came out as 0.0344 1/K")
    assert "a.csv" in why[0]


def test_one_that_is_out_by_its_scatter_keeps_nothing_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coefficient of -0.001 ± 0.002 is only not identifiable; the rest may be released."""
    known = fitted(monkeypatch, -0.001, 0.002)
    assert known.best("temp_coeff_copper_1_k") is None
    assert verdict(known.chosen(), (), (), ("r_phase_ohm",), "auto", None) == ("released", ())


WORST = Excess("drive_0.mcap", "vd_v", 0, 76.3, 0.9, "V")
OVER = ModelVerdict("missing", held_out=31.0, residual=76.3, worst=WORST, over=3)
FOUND = FoundEffect({"loss_nm": ReportedParameter(0.1, 0.01, "N·m")}, "windage of 0.10 ± 0.02 N·m")
BELOW = ModelVerdict("missing", held_out=1.0, residual=1.2, missing={"windage": FOUND})
NOTHING = ModelVerdict("insufficient", note="record a torque map")
OFF = ModelVerdict("not_tested", note="residual_test=false")


def released_with(model: ModelVerdict, release: str = "auto") -> tuple[str, tuple[str, ...]]:
    """The verdict on a datasheet that lacks nothing else."""
    sound = {"r_phase_ohm": Estimate("r_phase_ohm", 0.3, "ohm", "measured", "odd")}
    return verdict(sound, (), (), ("r_phase_ohm",), release, model.reason("m"))


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (
            OVER,
            "misses vd_v of drive_0.mcap by 76 noise floors and 2 more; `diagnose input=FOLDER",
        ),
        (
            BELOW,
            "lacks windage of 0.10 ± 0.02 N·m; `run input=FOLDER",
        ),
        (NOTHING, "model: record a torque map"),
        (OFF, "was held against the captures: residual_test=false"),
    ],
)
def test_released_with_76_noise_floors_left(model: ModelVerdict, said: str) -> None:
    """What a model leaves over the noise, or was not tested on, is at most provisional, and `why`
    says which signal, capture and command; a person may still approve it.
    """
    status, why = released_with(model)
    assert (status, len(why)) == ("provisional", 1)
    assert said in why[0]
    assert left_to_a_person(why[0])
    assert released_with(model, "manual")[1] == (*why, AWAITS_APPROVAL)


def test_a_model_that_explains_its_captures_keeps_nothing_back() -> None:
    """Also where some effect could not have shown: its residuals were tested and hold."""
    assert released_with(SOUND) == ("released", ())
    unseen = replace(SOUND, verdict="insufficient", note="no test here excites backlash")
    assert released_with(unseen) == ("released", ())


def test_no_approval_settles_what_is_not_about_the_model() -> None:
    assert not left_to_a_person("unverified: model.csv")
    assert not left_to_a_person("missing: lq_h (no capture of it)")


def test_the_copper_check_does_not_ask_for_a_heat_run_that_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It tells what the heat run came to; without one it asks for one."""
    rule = resistance_temperature.RULE
    check = rule.check(fitted(monkeypatch, 0.0344, 1e-4), CAMPAIGN, rule.options)
    assert check.status == "not_evaluated"
    assert "came out as 0.0344" in check.meaning
    assert "needs" not in check.meaning
    without = rule.check(Constants(), Campaign("m", ()), rule.options)
    assert without.meaning == "needs a heat_run over some tens of kelvin"
