"""What keeps a datasheet from its release."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from pipeline.crosscheck.rules import resistance_temperature
from pipeline.crosscheck.verdict import verdict
from pipeline.fit import registry
from pipeline.fit.protocol import Estimator, Fit
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_a

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
    status, why = verdict(known.chosen(), (), (), ("r_phase_ohm",), "auto")
    assert status == "provisional"
    assert len(why) == 1
    assert why[0].startswith("impossible: temp_coeff_copper_1_k (came out as 0.0344 1/K")
    assert "a.csv" in why[0]


def test_one_that_is_out_by_its_scatter_keeps_nothing_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coefficient of -0.001 ± 0.002 is only not identifiable; the rest may be released."""
    known = fitted(monkeypatch, -0.001, 0.002)
    assert known.best("temp_coeff_copper_1_k") is None
    assert verdict(known.chosen(), (), (), ("r_phase_ohm",), "auto") == ("released", ())


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
