"""The residual test of a run gives the verdict of `diagnose`, or says early that one is missing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from pipeline.criticism import adequacy
from pipeline.criticism.adequacy import model_verdict
from pipeline.criticism.data.machine_scale import PAIRLESS
from pipeline.criticism.diagnosis import TOO_LITTLE, diagnose
from pipeline.criticism.library.registry import effects
from pipeline.execution.tasks.work import _with_notes
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import ReportedParameter, Unexcited
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.model_verdict import Excess, FoundEffect, ModelVerdict
from pipeline.stages.steps.campaigns import campaigns

DEMO = Path(__file__).parents[3] / "data" / "demo" / "G52-0601"
STANDARD, COGGING = ModelSpec("standard"), ModelSpec("standard", ("cogging",))
FEW = ("cogging", "spin_down")


@cache
def shipped() -> Campaign:
    return campaigns(str(DEMO))[0][0]


def only(*tests: str) -> Campaign:
    return replace(shipped(), captures=shipped().of(*tests))


def judged(campaign: Campaign, spec: ModelSpec, *, search: bool = False) -> ModelVerdict:
    return model_verdict(campaign, spec, Constants(), search=search)[0]


@cache
def unsearched() -> ModelVerdict:
    return judged(only(*FEW), STANDARD)


def test_released_with_what_diagnose_calls_missing() -> None:
    """Cogging of 250 noise floors: what it is in, where, and how many floors off."""
    campaign = only(*FEW)
    found = unsearched()
    assert (found.verdict, found.passed) == ("missing", False)
    assert found.worst is not None
    assert (found.worst.signal, found.worst.order) == ("torque_shaft_nm", 84)
    assert found.worst.capture in {c.path for c in campaign.of("cogging")}
    assert found.worst.floors == found.residual
    assert found.residual > 100.0
    assert 0.002 < found.worst.size < 0.02, "the amplitude of some 7 mN·m, as an rms"


def test_what_is_missing_is_named_with_its_size() -> None:
    """The names, sizes and errors of `diagnose`, and the residual of the model as asked for."""
    campaign = only(*FEW)
    found, told = model_verdict(campaign, STANDARD, Constants())
    assert told is not None
    assert (found.verdict, tuple(found.missing)) == (told.verdict, told.missing)
    assert list(found.missing) == ["cogging"]
    one = told.ranking[0]
    cogging = found.missing["cogging"]
    assert (cogging.parameters, cogging.headline) == (one.parameters, one.headline)
    assert cogging.headline.startswith("cogging torque of 7.2")
    assert found.held_out == told.ladder[0].held_out
    assert found.held_out_with == told.ladder[-1].held_out
    assert found.held_out_with < 1.5 < found.held_out
    quick = unsearched()
    assert (quick.verdict, quick.worst, quick.residual) == ("missing", found.worst, found.residual)
    assert (quick.missing, quick.held_out_with) == ({}, None)
    assert "with it, the error falls from " in found.headline()


def test_nothing_left_is_said_as_diagnose_says_it() -> None:
    """With cogging in the model nothing is over its floor; what no capture shows is told."""
    campaign = only(*FEW, "current_step")
    found, told = judged(campaign, COGGING), diagnose(campaign, COGGING, Constants())
    assert (found.verdict, told.verdict) == ("insufficient", "insufficient")
    assert found.passed
    assert found.held_out == pytest.approx(told.ladder[0].held_out, rel=1e-3)
    assert (found.worst, found.over, found.missing) == (None, 0, {})
    assert all(one.effect in found.note for one in told.unexcited)
    assert found.residual is not None
    assert found.residual < math.sqrt(2.0), "no variance is twice its floor's"


@pytest.mark.parametrize(("tests", "why"), [(("resistance",), TOO_LITTLE), ((), PAIRLESS)])
def test_captures_that_fit_no_model_are_insufficient(tests: tuple[str, ...], why: str) -> None:
    campaign = only(*tests) if tests else unnamed(only("drive"))
    found, told = judged(campaign, STANDARD), diagnose(campaign, STANDARD, Constants())
    assert (found.verdict, told.verdict) == ("insufficient", "insufficient")
    assert (found.note, found.tested, found.passed) == (why, False, False)


def unnamed(campaign: Campaign) -> Campaign:
    bare = (replace(c, meta=replace(c.meta, pole_pairs=None, extra={})) for c in campaign.captures)
    return replace(campaign, captures=tuple(bare))


def test_the_search_is_spared_only_where_its_end_is_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Large and no drift of the instruments: something is missing. A drift that explains it all:
    the ladder says, and names what it finds.
    """
    asked = []
    whole = adequacy.searched
    monkeypatch.setattr(adequacy, "searched", lambda *a: asked.append(a) or whole(*a))
    campaign = only(*FEW)
    assert judged(campaign, STANDARD).missing == {}
    assert asked == []
    monkeypatch.setattr(adequacy, "drifting_segments", lambda fit, *_: fit.segments)
    found = judged(campaign, STANDARD)
    assert len(asked) == 1
    assert (found.verdict, list(found.missing)) == ("missing", ["cogging"])
    assert found.missing["cogging"].parameters
    assert found.worst is not None, "what the model itself leaves, not what is left with the effect"


def test_the_record_comes_back_from_its_document() -> None:
    worst = Excess("a.csv", "torque_shaft_nm", 84, 250.0, 0.005, "N·m")
    found = ModelVerdict("missing", held_out=14.0, residual=250.0, worst=worst, over=9)
    windage = FoundEffect(
        {"loss_nm": ReportedParameter(0.1, 0.01, "N·m")}, "windage", ("stribeck",), "spin it fast"
    )
    unseen = (Unexcited("backlash", ("drive",), "reverse it", ("torque_shaft_nm",)),)
    named = replace(
        found, missing={"windage": windage}, effects=("-x",), held_out_with=0.6, unexcited=unseen
    )
    assert ModelVerdict.of(named.document()) == named
    assert ModelVerdict.of(ModelVerdict("not_tested", note="off").document()).note == "off"


def test_a_coupling_makes_inertia_that_of_all_that_turns() -> None:
    """Asked for or found: the datasheet's J is no rotor's, and says how much lies beyond."""
    share = {"share": ReportedParameter(0.84, 0.01, "1")}
    sizes = {"compliance": share, "stribeck": {}}
    (words,) = adequacy._touches(sizes, effects(None)).values()
    assert words.startswith("is of all that turns, not of the rotor alone: ")
    assert words.endswith("84.0 ± 2.0 % of the inertia beyond it")


def test_a_constant_that_is_known_says_what_it_means() -> None:
    known = Estimate("j_rotor_kgm2", 1e-4, "kg·m²", "measured", "inertia", note="by the drive")
    none = not_identifiable("j_rotor_kgm2", "kg·m²", "inertia", "record a drive")
    model = ModelVerdict("missing", touches={"j_rotor_kgm2": "is of all", "b_visc_nm_s_rad": "-"})
    assert _with_notes({known.name: known}, model)[known.name].note == "is of all; by the drive"
    assert _with_notes({none.name: none}, model)[none.name].note == "record a drive"
