"""`plan`: which test to record next, for which constant or doubt."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

from pipeline.api.options import check_constants
from pipeline.crosscheck.plan import Aims, Known, Plan, Way, make_plan
from pipeline.crosscheck.registry import check_all, rules
from pipeline.estimation.registry import estimators, fit_all
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.storage.datasheets import read_datasheets
from pipeline.io.storage.limits import limits_file, required_constants
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import UsageError, meant
from pipeline.records.outcome import Outcome
from pipeline.settings import PlanSettings
from pipeline.stages.steps.campaigns import campaigns, outcome_of

# Relative standard uncertainties that a bench of calibrated instruments reaches.
U_REL = 0.02
U_REL_OF = {
    "r_phase_ohm": 0.005,
    "ld_h": 0.01,
    "lq_h": 0.01,
    "psi_pm_wb": 0.005,
    "kt_peak_nm_a": 0.005,
    "j_rotor_kgm2": 0.02,
    "torque_coulomb_nm": 0.05,
    "b_visc_nm_s_rad": 0.1,
    "cogging_peak_nm": 0.1,
    "cogging_amplitude_nm": 0.1,
    "rth_winding_k_w": 0.1,
    "temp_coeff_copper_1_k": 0.05,
    "temp_coeff_magnet_1_k": 0.2,
}
# A quarter of what the check `resistance_balance` allows.
U_OF = {"resistance_imbalance": 0.005}


def main(settings: PlanSettings) -> Outcome:
    """The plan of one motor, or of each, of an output folder or of a folder of captures.

    Parameters
    ----------
    settings
        The keys of `plan`.

    Raises
    ------
    UsageError
        There is no such motor or limits file.

    """
    check_constants(settings.constants)
    limits = limits_file(settings.limits, settings.config_dir)
    required = frozenset(required_constants(limits))
    if settings.input is not None:
        return _of_captures(settings, settings.input, required)
    sheets = read_datasheets(Path(settings.output))
    chosen = [s for s in sheets if settings.motor is None or s.motor_id == settings.motor]
    if not chosen:
        known = meant(settings.motor or "", (sheet.motor_id for sheet in sheets))
        raise UsageError(f"no motor {settings.motor!r} in {settings.output}", known)
    plans = [plan_of(sheet, required) for sheet in chosen]
    adding = next((s.model.adding() for s in chosen if s.model and s.model.adding()), "")
    next_ = f"{adding} output={shlex.quote(settings.output)}" if adding else ""
    return Outcome(text="\n\n".join(plan.text() for plan in plans), result=plans, next=next_)


def _of_captures(settings: PlanSettings, folder: str, required: frozenset[str]) -> Outcome:
    """The plans of what a run of these captures would find; nothing is written."""
    limits = ReadLimits(settings.read_seconds, settings.read_memory_mb)
    read = campaigns(folder, settings.source, settings.motor, limits, settings.config_dir)
    plans = []
    for recorded in read.campaigns:
        campaign = replace(recorded, stated=settings.constants)
        constants = fit_all(campaign, {})[0]
        tests = frozenset(capture.meta.test for capture in campaign.captures)
        checks = check_all(constants, campaign, {})
        known = Known(campaign.motor_id, constants.chosen(), checks, tests)
        plans.append(_planned(known, required))
    outcome = outcome_of(folder, read, [plan.text() for plan in plans], undecided=not plans)
    return replace(outcome, result=plans, next=f"run input={shlex.quote(folder)}")


def plan_of(sheet: Datasheet, required: frozenset[str]) -> Plan:
    """What to record next of the motor of a datasheet, to have `required` and settle its doubts.

    Parameters
    ----------
    sheet
        The motor's datasheet.
    required
        Constants that a release needs.

    """
    tests = frozenset(capture.test for capture in sheet.captures)
    known = Known(sheet.motor_id, sheet.constants, sheet.checks, tests, sheet.model)
    return _planned(known, required)


def _planned(known: Known, required: frozenset[str]) -> Plan:
    check_tests = {rule.name: rule.tests for rule in rules()}
    return make_plan(known, ways_of(), check_tests, Aims(required, U_REL, U_REL_OF, U_OF))


def ways_of() -> tuple[Way, ...]:
    """How each constant can be had, the preferred way first."""
    by_rank = sorted(estimators(), key=lambda estimator: (estimator.rank, estimator.name))
    return tuple(
        Way(
            e.gives,
            e.tests,
            e.experiment,
            tuple(name for name in e.uses if name not in (*e.aids, *e.either)),
            e.either,
        )
        for e in by_rank
    )
