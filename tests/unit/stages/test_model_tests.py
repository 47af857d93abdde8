"""The residual test of a motor is made once, and costs nobody else anything where it breaks."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipeline.criticism import adequacy
from pipeline.execution.caches.fits import ModelMemory
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.model_tests import judged_model
from pipeline.execution.tasks.work import Stamp
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate
from pipeline.records.ledger import Revocation
from pipeline.records.model_verdict import Excess, ModelVerdict
from pipeline.settings import RunSettings
from pipeline.stages.steps.beside import beside_motors

CAMPAIGN = Campaign("m", (Capture("a.csv", "0", "verified", CaptureMeta("m", "drive"), ()),))
FOUND = ModelVerdict(
    "missing",
    held_out=1.0 / 3.0,
    residual=76.0,
    worst=Excess("a.csv", "vd_v", 0, 76.0, 0.1, "V"),
    over=1,
)
DIAGNOSIS = Diagnosis("m", "standard", "missing", (), (), (), None, (), ())
KNOWN = Constants((Estimate("pole_pairs", 7, "1", "measured", "open_circuit"),))


@pytest.fixture
def job(tmp_path: Path) -> MotorJob:
    return MotorJob("m", (), "in", str(tmp_path), "c" * 64, (), "auto", True, True)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[ModelSpec]:
    """The models that were held against captures, none of them recalled."""
    asked: list[ModelSpec] = []

    def verdict(
        campaign: Campaign, model: ModelSpec, start: Constants, *, search: bool
    ) -> tuple[ModelVerdict, Diagnosis]:
        asked.append(model)
        return (replace(FOUND, note="searched") if search else FOUND), DIAGNOSIS

    monkeypatch.setattr(adequacy, "model_verdict", verdict)
    return asked


def test_a_verdict_is_kept_while_nothing_that_it_hangs_on_changes(
    job: MotorJob, made: list[ModelSpec]
) -> None:
    """Captures as read, model, constants to start from, a revocation: each makes it anew."""
    spec = ModelSpec()
    doubted = replace(job, revoked=(Revocation("v", "0" * 64, "A", "wrong"),))

    def tested(
        of: MotorJob = job, reading: str = "r", model: ModelSpec = spec, known: Constants = KNOWN
    ) -> int:
        before = len(made)
        given = [of.motor_id, reading]
        memory = ModelMemory(of, Stamp("v", (reading,), "c" * 64, "0.1.0", "", given))
        found = judged_model(CAMPAIGN, model, known, memory, of.diagnose)
        searched = of.diagnose != "false"
        assert found.verdict == (replace(FOUND, note="searched") if searched else FOUND)
        assert found.findings == ()
        assert found.diagnosis == (DIAGNOSIS if of.diagnose == "true" else None)
        return len(made) - before

    assert (tested(), tested()) == (1, 0)
    assert (tested(reading="other"), tested(), tested(known=Constants())) == (1, 1, 1)
    assert tested(model=ModelSpec("ideal")) == 1
    assert tested(model=ModelSpec("standard", ("cogging",))) == 1
    assert (tested(), tested()) == (1, 0)
    assert (tested(doubted), tested(doubted)) == (1, 0)
    whole, unsearched = replace(job, diagnose="true"), replace(job, diagnose="false")
    assert (tested(), tested(whole), tested(whole)) == (1, 1, 1), "a diagnosis is not remembered"
    assert (tested(), tested(unsearched), tested(unsearched), tested()) == (0, 1, 0, 1)


def test_a_test_that_breaks_costs_itself_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> ModelVerdict:
        raise ValueError("odd data")

    monkeypatch.setattr(adequacy, "model_verdict", broken)
    found, (finding,), _ = judged_model(CAMPAIGN, ModelSpec(), KNOWN)
    assert (found.verdict, found.passed) == ("not_tested", False)
    assert "odd data" in found.note
    assert (finding.code, finding.severity) == ("residual_test_failed", "warning")


def test_a_model_that_there_is_not_is_no_fault_of_the_captures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unknown(*_: object, **__: object) -> ModelVerdict:
        raise UsageError("unknown model x", "known are ...")

    monkeypatch.setattr(adequacy, "model_verdict", unknown)
    with pytest.raises(UsageError, match="unknown model"):
        judged_model(CAMPAIGN, ModelSpec("x"), KNOWN)


def test_switched_off_is_not_tested(made: list[ModelSpec]) -> None:
    found, findings, _ = judged_model(CAMPAIGN, None, KNOWN)
    assert (found.verdict, found.note, findings, made) == (
        "not_tested",
        "residual_test=false",
        (),
        [],
    )


def test_two_that_need_a_verdict_at_once_make_it_once(
    job: MotorJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker makes the test beside the motor's fits; the motor waits for it and takes it over."""
    begun, made = threading.Event(), []

    def verdict(*_: object, **__: object) -> tuple[ModelVerdict, Diagnosis]:
        made.append(threading.current_thread().name)
        begun.set()
        time.sleep(0.2)
        return FOUND, DIAGNOSIS

    monkeypatch.setattr(adequacy, "model_verdict", verdict)

    def tested() -> ModelVerdict:
        memory = ModelMemory(job, Stamp("v", ("r",), "c" * 64, "0.1.0", "", ["m", "r"]))
        return judged_model(CAMPAIGN, ModelSpec(), KNOWN, memory).verdict

    with ThreadPoolExecutor(1, "beside") as pool:
        beside = pool.submit(tested)
        assert begun.wait(10.0)
        assert tested() == beside.result() == FOUND
    assert made == ["beside_0"]


def test_a_verdict_whose_maker_broke_is_made_by_the_motor(
    job: MotorJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> ModelVerdict:
        raise ValueError("odd data")

    memory = ModelMemory(job, Stamp("v", ("r",), "c" * 64, "0.1.0", "", ["m", "r"]))
    with monkeypatch.context() as patch:
        patch.setattr(adequacy, "model_verdict", broken)
        assert judged_model(CAMPAIGN, ModelSpec(), KNOWN, memory).findings
    monkeypatch.setattr(adequacy, "model_verdict", lambda *_, **__: (FOUND, DIAGNOSIS))
    assert judged_model(CAMPAIGN, ModelSpec(), KNOWN, memory).verdict == FOUND


@pytest.mark.parametrize(
    ("changes", "motors", "workers", "beside"),
    [
        ({}, 1, 2, 1),
        ({}, 1, 8, 1),
        ({}, 2, 3, 1),
        ({}, 2, 2, 0),
        ({}, 5, 2, 0),
        ({"diagnose": "true"}, 1, 2, 0),
        ({"residual_test": False}, 1, 2, 0),
        ({"cache": False}, 1, 2, 0),
        ({"executor": "dask"}, 1, 2, 0),
    ],
)
def test_only_a_worker_that_would_be_idle_makes_a_test_beside(
    job: MotorJob, changes: dict[str, Any], motors: int, workers: int, beside: int
) -> None:
    jobs = [replace(job, motor_id=f"m{n}") for n in range(motors)]
    found = beside_motors(replace(RunSettings(), **changes), jobs, workers)
    assert [one.job.motor_id for one in found] == [f"m{n}" for n in range(beside)]
    assert all(one.name == f"the residual test of {one.job.name}" for one in found)
    assert all(one.without("a.csv", "slow").job.refused == (("a.csv", "slow"),) for one in found)


def test_what_a_test_leaves_in_cycles_goes_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Segments and what is kept of them: a worker grew by 3 MB a motor."""

    class Kept(list[Any]):
        """A list that a weak reference can follow."""

    left: list[weakref.ref[Kept]] = []

    def verdict(*_: Any, **__: Any) -> tuple[ModelVerdict, Diagnosis]:
        segment = Kept()
        segment.append(segment)
        left.append(weakref.ref(segment))
        return FOUND, DIAGNOSIS

    monkeypatch.setattr(adequacy, "model_verdict", verdict)
    gc.disable()
    try:
        judged_model(CAMPAIGN, ModelSpec(), KNOWN)
    finally:
        gc.enable()
    assert [one() for one in left] == [None]
