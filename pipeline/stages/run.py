"""`run`: recordings in, motor datasheets out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.api.options import check_options
from pipeline.criticism.policy.policy import policy_changes
from pipeline.execution.caches.keys import batch_parts, key_of, motor_parts
from pipeline.execution.caches.run_cache import Batch, RunCache
from pipeline.execution.caches.stamp import configuration_digest
from pipeline.execution.caches.versions import RUN, tools
from pipeline.execution.jobs import ModelTest, MotorJob, MotorResult, WarmUp
from pipeline.execution.outputs.publishing import (
    fleet_of,
    other_motors,
    others_note,
    outcome_of,
    publish,
    removed_note,
    with_folder_names,
)
from pipeline.execution.outputs.registration import Registered, register
from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.execution.outputs.statuses import (
    findings_of,
    histories_of,
    status_now,
    with_current_statuses,
)
from pipeline.execution.run_job import job_of
from pipeline.execution.tasks.survey_tasks import survey_with
from pipeline.execution.workers.gate import HeldJob
from pipeline.execution.workers.pools import Cluster, core_count, open_pool
from pipeline.execution.workers.worker_pool import WorkerPool
from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.files import input_folder, size_bytes
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.identification import Answer, Question, identify_by_head
from pipeline.io.ingest.survey import Survey, survey
from pipeline.io.maps.places import source_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.registry.store import Registry
from pipeline.io.storage.datasheets import read_datasheets
from pipeline.io.storage.limits import limits_file, release_conditions
from pipeline.io.storage.publish import output_folder
from pipeline.performance.conditions import check_stated
from pipeline.records.comparison import ModelSpec
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import MachineError, UsageError
from pipeline.records.finding import Finding
from pipeline.records.ledger import Revocation
from pipeline.records.outcome import Outcome, Stopwatch, faults_of, first_that_applies
from pipeline.report.text.progress import progress
from pipeline.report.text.waiting import waiting
from pipeline.settings import RunSettings
from pipeline.stages.steps.beside import begun_ahead, beside_motors, due_jobs
from pipeline.stages.steps.registry import opened

PROGRESS = ".work"
Revocations = Mapping[str, tuple[Revocation, ...]]


def main(settings: RunSettings) -> Outcome:
    """Processes every motor of `input`; refused captures are named and the others go on.

    Parameters
    ----------
    settings
        The keys of `run`.

    """
    check_options(settings)
    check_stated(asdict(settings.operate))
    ReadLimits(settings.read_seconds, settings.read_memory_mb)
    input_folder(settings.input)
    if settings.residual_test:
        from pipeline.criticism.library.registry import known_effects

        known_effects(settings.model.effects)
    policy_changes(settings.policy)
    if settings.watch and settings.json:
        raise UsageError("watch=true prints a line a motor, no JSON", "leave json=true out")
    if settings.settle_s < 0.0:
        raise UsageError(f"settle_s={settings.settle_s} is negative", "1 is usual")
    if settings.workers < 0:
        raise UsageError(f"workers={settings.workers} is negative", "0 is one a core")
    registry = None if settings.registry is None else opened(settings)
    cluster = Cluster(settings.scheduler, settings.tls_ca, settings.tls_cert, settings.tls_key)
    pool = open_pool(settings.executor, cluster)
    output = output_folder(settings.output)
    with ExitStack() as stack:
        workers = WorkerPool(pool, settings.workers or core_count(), output / PROGRESS)
        stack.enter_context(workers)
        if settings.watch:
            from pipeline.stages.steps.watch import Watch

            start = WarmUp(shares=settings.residual_test and workers.count > 1)
            workers.map_tasks(process_motor, [start] * workers.count)
            memory = SheetMemory()
            perform = partial(_run, settings, registry, workers, memory)
            return Watch(settings, perform, stack.pop_all(), memory).begin()
        outcome = _run(settings, registry, workers, SheetMemory())
    if not settings.json:
        return outcome
    sheets = [sheet.document() for sheet in read_datasheets(output)]
    return replace(outcome, result=sheets, faults=faults_of(findings_of(Path(output))))


def process_motor(job: MotorJob | HeldJob | ModelTest | WarmUp) -> MotorResult | None:
    """One motor, in a worker: what it needs is imported there and not in the driver.

    Parameters
    ----------
    job
        What to do with one motor, and how, at once or behind a gate; its residual test alone,
        beside it; or nothing but the imports.

    """
    from pipeline.stages.steps import motor

    if isinstance(job, MotorJob):
        return motor.process_motor(job)
    if isinstance(job, HeldJob):
        return motor.process_motor(job.job, job.gate)
    if isinstance(job, ModelTest):
        motor.test_model(job.job)
    else:
        motor.warm_up(job)
    return None


def _run(
    settings: RunSettings,
    registry: Registry | None,
    workers: WorkerPool,
    memory: SheetMemory,
    surveyed: Callable[[], object] = lambda: None,
    *,
    ahead: bool = False,
) -> Outcome:
    """One run; `surveyed` is called when every file was looked at, before anything is written.

    With `ahead` motors and the residual tests beside them begin before it is called; until then
    they write to the cache alone.
    """
    watch = Stopwatch()
    folder, output = Path(settings.input), Path(settings.output)
    limits = limits_file(settings.limits, settings.config_dir)
    sources = source_maps(settings.source, settings.config_dir)
    cache = RunCache(folder, output, on=settings.cache)
    with ExitStack() as stack:
        with waiting("looking at the files of " + settings.input), watch.stage("survey"):
            ask = partial(_answers, settings, sources, workers, cache)
            files = survey(folder, sources, ask, recover=settings.recover)
            plain = _jobs(settings, files, limits)
            begun = None
            if ahead:
                due = due_jobs(_with_revoked(plain, _revocations(registry)), cache)
                begun = stack.enter_context(begun_ahead(settings, due, workers, process_motor))
            surveyed()
        batch = _batch_key(settings, plain, files, registry)
        if (cached := _cached_outcome(settings, registry, cache, batch)) is not None:
            return replace(cached, timings=watch.table())
        means = workers, cache, watch, memory
        return _computed(settings, registry, means, files, plain, begun)


def _computed(
    settings: RunSettings,
    registry: Registry | None,
    means: tuple[WorkerPool, RunCache, Stopwatch, SheetMemory],
    survey: Survey,
    plain: Sequence[MotorJob],
    begun: Sequence[HeldJob] | None,
) -> Outcome:
    """Motors worked on, registered and published; `plain` are the jobs without revocations, `begun`
    the motors that were begun with the tests beside them, None where nothing was.
    """
    (workers, cache, watch, memory), output = means, Path(settings.output)
    revoked = _revocations(registry)
    jobs = _with_revoked(plain, revoked)
    with watch.stage("motors"):
        motors, died = _process(settings, jobs, workers, cache, begun)
    others = other_motors(output, [job.motor_id for job in jobs], prune=settings.prune)
    with watch.stage("registry"):
        registered = register(registry, output, motors, memory)
        # before the statuses are read: a later decision is not in them
        batch = _batch_key(settings, plain, survey, registry)
        histories = histories_of(registry)
        motors, statuses = with_current_statuses(output, motors, histories, memory)
    with watch.stage("fleet"):
        fleet = fleet_of(output, motors, others, memory)
        datasheets = fleet.datasheets
        of_others = {one.motor_id: status_now(output, one, histories) for one in fleet.others}
        of_motors = {finding for motor in motors for finding in motor.finished.findings}
        findings = sorted(of_motors.union(survey.findings), key=Finding.order)
        files, removed = publish(
            settings, motors, fleet, tuple(findings), {**of_others, **statuses}, others
        )
        outcome = outcome_of(datasheets, findings, survey, statuses, report=settings.report)
    lasting = not died and all(motor.lasting for motor in motors)
    if lasting and registered.code == 0 and _revocations(registry) == revoked:
        cache.keep_outcome(batch, Batch(outcome, _contents(datasheets, motors)), files)
    cache.forget_others([*others, *(job.motor_id for job in jobs)])
    outcome = with_folder_names(outcome, settings)
    for name, seconds in (spent for motor in motors for spent in motor.seconds.items()):
        watch.seconds[f"  {name}"] = watch.seconds.get(f"  {name}", 0.0) + seconds
    notes = (*removed_note(removed, settings.output), *others_note(others, settings.output))
    return _final(outcome, registered, notes, died, watch)


def _final(
    outcome: Outcome,
    registered: Registered,
    notes: Sequence[str],
    died: Sequence[MachineError],
    watch: Stopwatch,
) -> Outcome:
    """The outcome of a run with what the registry and the workers report."""
    return Outcome(
        first_that_applies(outcome.exit_code, registered.code, *(e.exit_code for e in died)),
        "\n".join(filter(None, [outcome.text, registered.text])),
        (*outcome.errors, *notes, *registered.errors, *(f"error: {e}" for e in died)),
        watch.table(),
        next=outcome.next,
    )


def _contents(
    datasheets: Sequence[Datasheet], results: Sequence[MotorResult]
) -> tuple[tuple[tuple[str, str], str], ...]:
    """Motor and version of each datasheet, and the digest of its file."""
    written = (file for motor in results for file in motor.finished.files)
    digests = [sha256 for name, sha256 in written if name.startswith("datasheets/")]
    return tuple(
        ((sheet.motor_id, sheet.version), sha256)
        for sheet, sha256 in zip(datasheets, digests, strict=True)
    )


def _answers(
    settings: RunSettings,
    sources: Mapping[str, SourceMap],
    workers: WorkerPool,
    cache: RunCache,
    questions: Sequence[Question],
) -> list[Answer]:
    """The survey's answers: cached ones, and those of the workers for the other files."""
    folder = Path(settings.input)
    limits = ReadLimits(settings.read_seconds, settings.read_memory_mb)
    answers = cache.known_answers(questions, sources, limits, recover=settings.recover)
    for number, question in enumerate(questions):
        if (
            number not in answers
            and (answer := identify_by_head(folder, question, sources)) is not None
        ):
            answers[number] = answer
    open_ = [number for number in range(len(questions)) if number not in answers]
    unanswered = [questions[number] for number in open_]
    surveyed = survey_with(workers, folder, sources, limits, unanswered, recover=settings.recover)
    answers.update(zip(open_, surveyed, strict=True))
    all_answers = [answers[number] for number in range(len(questions))]
    if open_:
        cache.keep_answers(questions, all_answers)
    return all_answers


def _jobs(settings: RunSettings, survey: Survey, limits: Path) -> list[MotorJob]:
    conditions = required, model_gates = release_conditions(limits)
    changes = policy_changes(settings.policy)
    model = ModelSpec(settings.model.name, tuple(settings.model.effects), policy=changes)
    by_maps = {_source_names(entries): entries for entries in survey.motors.values()}
    digests = {
        names: configuration_digest(
            settings, required, [e.source for e in entries], model_gates=model_gates
        )
        for names, entries in by_maps.items()
    }
    jobs = []
    for motor_id, entries in survey.motors.items():
        paths, digest = {e.path for e in entries}, digests[_source_names(entries)]
        findings = tuple(f for f in survey.findings if f.file in paths)
        jobs.append(job_of(settings, motor_id, digest, conditions, model, entries, findings))
    return [_keyed(job) for job in jobs] if settings.cache else jobs


def _source_names(entries: Sequence[Entry]) -> frozenset[str | None]:
    """The names of the source maps that captures are read by; None for the contract's own form."""
    return frozenset(None if entry.source is None else entry.source.name for entry in entries)


def _keyed(job: MotorJob) -> MotorJob:
    return replace(job, key=key_of(motor_parts(tools(RUN), job)))


def _batch_key(
    settings: RunSettings, jobs: Sequence[MotorJob], survey: Survey, registry: Registry | None
) -> str:
    """Digest of everything that the outcome of a batch depends on, except folders."""
    commit = None if registry is None else registry.last_commit()
    keys = [job.key for job in jobs]
    return key_of(batch_parts(tools(RUN), settings, keys, survey, commit))


def _revocations(registry: Registry | None) -> Revocations:
    """The revocations by motor; empty where the registry fails, as publishing reports the error."""
    if registry is not None:
        with suppress(MachineError):
            return registry.revocations()
    return {}


def _with_revoked(jobs: Sequence[MotorJob], revoked: Revocations) -> list[MotorJob]:
    """The jobs with the revoked versions of their motors, which are part of the key."""
    knowing = (replace(job, revoked=revoked.get(job.motor_id, ())) for job in jobs)
    return [job if job.key is None or not job.revoked else _keyed(job) for job in knowing]


def _cached_outcome(
    settings: RunSettings, registry: Registry | None, cache: RunCache, key: str
) -> Outcome | None:
    """The cached outcome of a batch, if all its files and registered versions still exist."""
    batch = cache.outcome(key) if settings.cache else None
    if batch is None:
        return None
    text = ""
    if registry is not None and batch.contents:
        if not registry.has_files(batch.contents):
            return None
        text = f"registry {registry.place}: 0 new, {len(batch.contents)} known"
    outcome = with_folder_names(batch.outcome, settings)
    return replace(outcome, text="\n".join(filter(None, [outcome.text, text])))


def _process(
    settings: RunSettings,
    jobs: Sequence[MotorJob],
    workers: WorkerPool,
    cache: RunCache,
    begun: Sequence[HeldJob] | None,
) -> tuple[list[MotorResult], tuple[MachineError, ...]]:
    """The results in the order of the jobs, and an error for each unfinished one."""
    ends: list[Any] = [None] * len(jobs)
    for number, job in enumerate(jobs):
        if job.key is not None and (done := cache.finished(job.motor_id, job.key)) is not None:
            ends[number] = MotorResult(job.motor_id, done, {})
    due = [number for number, end in enumerate(ends) if end is None]
    motors = [jobs[number] for number in due]
    beside = beside_motors(settings, motors, workers.count) if begun is None else []
    tasks = [next((held for held in begun or () if held.job == job), job) for job in motors]

    def advance(at: int, _: MotorResult | None) -> None:
        if at < len(due):
            bar.advance(at)

    with progress([_size(settings, job) for job in motors]) as bar:
        for held in tasks:
            if isinstance(held, HeldJob):
                held.gate.open()
        outcomes = workers.map_tasks(process_motor, [*tasks, *beside], advance)
    for number, end in zip(due, outcomes, strict=False):
        ends[number] = end
    died = tuple(end for end in ends if isinstance(end, MachineError))
    return [end for end in ends if isinstance(end, MotorResult)], died


def _size(settings: RunSettings, job: MotorJob) -> tuple[int, int]:
    """Captures and bytes of a job."""
    folder = Path(settings.input)
    return len(job.entries), sum(size_bytes(folder / entry.path) for entry in job.entries)
