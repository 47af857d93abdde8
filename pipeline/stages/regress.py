"""`regress`: does a lot, or a version of the code, still give the same as the baseline."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.estimation.registry import estimator_terms
from pipeline.execution.outputs.page_links import LOTS, links_of, relink_index
from pipeline.io.recordings.seal import write_checksummed
from pipeline.io.storage.diagnoses import read_diagnoses
from pipeline.io.storage.limits import limits_file, read_limits
from pipeline.io.storage.publish import canonical_json, output_folder, write_whole
from pipeline.lots.code import compare_versions
from pipeline.lots.limits_lint import lint
from pipeline.lots.regression import compare_lots
from pipeline.physics.glossary import CONSTANTS, Term
from pipeline.records.errors import UsageError
from pipeline.records.limits import Limits
from pipeline.records.lot_regression import LotRegression
from pipeline.records.outcome import Outcome
from pipeline.report.pages.lot_page import render_regression
from pipeline.report.text.junit import junit_xml
from pipeline.report.text.lot_text import regression_text
from pipeline.settings import RegressSettings
from pipeline.stages.steps.registry import opened
from pipeline.stages.steps.selection import Chosen, choose

MODES = ("auto", "lots", "code")
EXIT_CODES = {"pass": 0, "marginal": 0, "fail": 1}
UNDECIDED = 4


def main(settings: RegressSettings) -> Outcome:
    """Writes `regression/report.{json,html,xml}`; 0 the same, 1 not, 4 undecided, 2 wrong usage.

    Every verdict that is neither a pass nor a failure (CONFOUNDED, INSUFFICIENT_HISTORY and the
    like) is undecided.

    Parameters
    ----------
    settings
        The keys of `regress`.

    """
    terms = estimator_terms() | CONSTANTS
    limits = read_limits(limits_file(settings.limits, settings.config_dir))
    faults = lint(limits, terms)
    if faults:
        lines = tuple(f"error: limits {limits.name}: {fault}" for fault in faults)
        return Outcome(2, errors=lines)
    if settings.lint:
        text = f"limits {limits.name}: {len(limits.family())} constants, no fault"
        trial = f"regress limits={shlex.quote(settings.limits)} baseline=lot:A candidate=lot:B"
        return Outcome(text=text, next=trial)
    if settings.mode not in MODES:
        raise UsageError(f"regress: no mode {settings.mode!r}", f"one of {', '.join(MODES)}")
    for name in ("baseline", "candidate"):
        if not getattr(settings, name).strip():
            raise UsageError(f"regress: {name}= is missing", f"write {name}=lot:A, or a tag, ...")
    registry, mode = opened(settings), settings.mode
    chosen = choose(registry, settings.baseline, settings.candidate, mode, limits.golden)
    output = output_folder(settings.output)
    regression = _compare(settings, chosen, limits, terms)
    files = _write(output, regression)
    text = regression_text(regression, files)
    return Outcome(
        EXIT_CODES.get(regression.verdict, UNDECIDED),
        text,
        result=regression.document(),
        next=_next(regression, settings.output),
    )


def _next(regression: LotRegression, output: str) -> str:
    """A look at the comparison of the candidate's lot, which its recording shows."""
    lots = regression.candidate.lots
    lot = f" lot={shlex.quote(lots[0])}" if lots and lots[0] else ""
    return f"review{lot} output={shlex.quote(output)}"


def _compare(
    settings: RegressSettings, chosen: Chosen, limits: Limits, terms: dict[str, Term]
) -> LotRegression:
    if chosen.pairs:
        groups = chosen.samples.baseline, chosen.samples.candidate
        return compare_versions(chosen.pairs, groups, limits, terms, chosen.notes)
    diagnoses = read_diagnoses(_diagnosis_folders(settings))
    samples = replace(chosen.samples, diagnoses=diagnoses)
    return compare_lots(samples, limits, terms, chosen.notes)


def _diagnosis_folders(settings: RegressSettings) -> Sequence[Path]:
    if settings.diagnoses not in ("", "auto"):
        folders = [Path(name.strip()) for name in settings.diagnoses.split(",") if name.strip()]
        for folder in folders:
            if not folder.is_dir():
                raise UsageError(f"diagnoses={folder} is no folder", "name what `diagnose` wrote")
        return folders
    place = opened(settings).place
    beside = [] if "://" in place else [Path(place).parent / "diagnosis"]
    return [*beside, Path(settings.output) / "diagnosis"]


def _write(output: Path, regression: LotRegression) -> tuple[str, ...]:
    folder = output / "regression"
    links = links_of(output, LOTS, coming=["regression/report.json"])
    files = {
        "report.json": canonical_json(regression.document()),
        "report.xml": junit_xml(regression),
        "report.html": render_regression(regression, links).encode(),
    }
    for name, content in files.items():
        write_whole(folder / name, content)
    from pipeline.io.recordings.lots import lots_bytes, lots_name

    recording = output / "recordings" / lots_name(regression)
    write_checksummed(recording, lots_bytes(regression))
    relink_index(output)
    return (*((folder / name).as_posix() for name in files), recording.as_posix())
