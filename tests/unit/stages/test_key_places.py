"""Each key takes its parts from where they are: what is kept is not found when one has changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path

import pytest

from pipeline.contracts.registry import gates
from pipeline.crosscheck.registry import rules
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.registry import estimators
from pipeline.execution.caches import fits, keys, run_cache
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.work import Stamp
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.identification import Question, identify
from pipeline.io.ingest.survey import Survey, survey
from pipeline.io.maps.source_map import FieldMap, SourceMap
from pipeline.records.constants import Constants
from pipeline.records.errors import UsageError
from pipeline.records.estimate import Estimate
from pipeline.records.ledger import Revocation
from pipeline.settings import RunSettings, configuration_folder
from pipeline.stages import run
from tests.changes import changes

HALL = SourceMap("hall", header="^Time", fields=(FieldMap("Time", "t_s"), FieldMap("I", "iq_a")))
EXACT = Estimate("r_phase_ohm", 0.3, "ohm", "measured", "resistance")
MOTOR = MotorJob("m", (), "in", "out", "d" * 64, (), "manual", report=False, recordings=False)


def test_a_fit_is_kept_until_one_part_of_its_key_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []

    def fitted(
        job: MotorJob = MOTOR,
        readings: tuple[str, ...] = ("r1",),
        version: str = "v",
        known: tuple[Estimate, ...] = (EXACT,),
        options: Mapping[str, float] = {"share": 0.1},
    ) -> bool:
        """Whether the fit was made."""

        def fit() -> Fit:
            calls.append("fit")
            return Fit((EXACT,))

        stamp = Stamp(version, readings, "d" * 64, "1", "numpy 2", [job.motor_id, *readings])
        memory = fits.FitMemory(replace(job, output=str(tmp_path)), stamp)
        before = len(calls)
        memory(estimator, Constants(known), options, fit)
        memory.save()
        return len(calls) > before

    estimator = Estimator("resistance", ("r_phase_ohm",), ("resistance",), "", lambda *_: Fit(()))
    assert fitted()
    assert not fitted()
    revoked = replace(MOTOR, revoked=(Revocation("v", "c", "A", "off"),))
    for changed in (
        {"readings": ("r2",)},
        {"readings": ("r1", "r2")},
        {"job": revoked},
        {"known": ()},
        {"known": (replace(EXACT, value=0.31),)},
        {"options": {"share": 0.2}},
    ):
        assert fitted(**changed), changed  # type: ignore[arg-type]
        assert fitted(), "the one before was put in its place"
    assert fitted(job=replace(MOTOR, motor_id="other"))
    assert fitted(job=revoked)
    assert not fitted(job=revoked), "doubted once"
    assert fitted(job=revoked, version="w"), "of another version the fits of before count"
    assert not fitted()
    for name in ("libraries_version", "closure_digest"):
        with monkeypatch.context() as patch:
            patch.setattr(fits, name, lambda *_: "other")
            assert fitted(), name
        assert fitted()


def test_an_answer_is_kept_until_what_it_hangs_on_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """File, sidecar, manifest row, source maps, limits, recovery, code: one at a time."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    folder, output = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    log, beside = folder / "a.txt", folder / "a.meta.yaml"
    log.write_text("Time,I\n0,1\n")
    beside.write_text("motor_id: m\ntest: drive\n")
    question = Question("a.txt", "a.meta.yaml", (("lot", "7"),))
    sources, limits = {"hall": HALL}, ReadLimits()
    answer = identify(folder, question, sources)
    assert answer.entry is not None

    def known(
        asked: Question = question,
        sources: Mapping[str, SourceMap] = sources,
        limits: ReadLimits = limits,
        recover: bool = False,
    ) -> bool:
        kept = run_cache.RunCache(folder, output, on=True)
        monkeypatch.setattr(kept._inputs, "sha256", lambda _: answer.sha256)
        return kept.known_answers([asked], sources, limits, recover=recover) == {0: answer}

    first = run_cache.RunCache(folder, output, on=True)
    assert first.known_answers([question], sources, limits, recover=False) == {}
    first.keep_answers([question], [answer])
    assert known()
    for where, other in changes(question):
        assert not known(asked=other), where
    for where, other in changes(sources):
        assert not known(sources=other), where
    for where, other in changes(limits):
        assert not known(limits=other), where
    assert not known(recover=True)
    said = beside.read_text()
    beside.write_text(said + "station: hall\n")
    assert not known()
    beside.unlink()
    assert not known()
    beside.write_text(said)
    assert known()
    monkeypatch.setattr(run_cache, "tools", lambda _: "other")
    assert not known()


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Survey:
    folder = tmp_path_factory.mktemp("found")
    (folder / "a.txt").write_text("Time,I\n0,1\n")
    (folder / "a.meta.yaml").write_text("motor_id: m\ntest: drive\n")
    return survey(folder, {"hall": HALL})


def job_of(settings: RunSettings, found: Survey, limits: Path | None = None) -> MotorJob:
    place = limits or configuration_folder() / "limits" / "default.yaml"
    (job,) = run._jobs(settings, found, place)
    return job


def test_every_setting_that_changes_a_result_changes_the_work(found: Survey) -> None:
    """Configuration (so the version) and key of a motor; the others change neither."""
    base = job_of(RunSettings(), found)
    marked = {f.name for f in fields(RunSettings) if f.metadata.get("result", True)}
    for where, settings in changes(RunSettings()):
        try:
            job, name = job_of(settings, found), where.split(".")[0]
        except UsageError:
            continue
        assert (job.config_sha256 != base.config_sha256) == (name in marked), where
        free = name in keys.NOT_OF_A_BATCH or name in ("registry", "prune")
        assert (job.key != base.key) == (not free) or not settings.cache, where


def test_every_option_of_every_plug_in_changes_the_work(found: Survey) -> None:
    base = job_of(RunSettings(), found)
    groups = {
        "fit": {e.name: e.options for e in estimators()},
        "gates": {g.name: g.settings() for g in gates()},
        "crosscheck": {r.name: r.options for r in rules()},
    }
    asked = 0
    for group, plug_ins in groups.items():
        for name, options in plug_ins.items():
            for option, value in options.items():
                settings = RunSettings(**{group: {name: {option: value + 1e-9}}})
                job = job_of(settings, found)
                assert job.config_sha256 != base.config_sha256, (group, name, option)
                assert job.key != base.key, (group, name, option)
                asked += 1
    assert asked > 100


def test_of_a_limits_file_what_a_release_needs_changes_the_work(
    found: Survey, tmp_path: Path
) -> None:
    """What a lot is held to changes no datasheet, so the same job comes of it."""
    default = (configuration_folder() / "limits" / "default.yaml").read_text()
    said = tmp_path / "limits.yaml"

    def key(text: str) -> str | None:
        said.write_text(text)
        return job_of(RunSettings(), found, said).key

    base = key(default)
    looser = default.replace("tolerance: 15 %", "tolerance: 16 %", 1)
    assert looser != default
    assert key(looser) == base
    assert key(f"# a word more\n{default}") == base
    needed = job_of(RunSettings(), found, said).required
    for name in needed:
        fewer = default.replace(f"  - {name}\n", "", 1)
        assert fewer != default
        assert key(fewer) != base, name
    told = default.replace("model_gates: yes", "model_gates: no", 1)
    assert key(told) != base
    assert not job_of(RunSettings(), found, said).model_gates
