"""A capture in; the same capture with its masks, and the warnings, out; or a refusal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import polars as pl
import polars.selectors as cs

from pipeline.contracts.clocks import held_apart, stamps_counted, streams_split
from pipeline.contracts.gates import missing_values
from pipeline.contracts.protocol import Lost, warning, with_time
from pipeline.contracts.registry import gates
from pipeline.contracts.rotor_frame import in_rotor_frame
from pipeline.contracts.schemas import check_columns, check_metadata, check_tables
from pipeline.contracts.settled_points import as_settled_points
from pipeline.numerics.alike import same_but_for_noise
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError, merged
from pipeline.records.finding import Finding

TORQUE = "torque_shaft_nm"
_ELECTRICAL, _MOTION = "theta_elec_rad", ("theta_mech_rad", "omega_mech_rad_s")
_DRIVEN = ("drive", "torque_map")
BROKEN = (ValueError, ArithmeticError, LookupError, TypeError, np.linalg.LinAlgError)


def validate(
    capture: Capture, options: Mapping[str, Mapping[str, float]]
) -> tuple[Capture, tuple[Finding, ...]]:
    """Holds a capture against its contract, then against every gate of its test.

    Parameters
    ----------
    capture
        As recorded.
    options
        Of each gate by its name, over its defaults: the configuration's `gates`.

    Returns
    -------
    capture
        With the masks of the gates, without values that are no readings, with dq columns that the
        electrical angle makes of the phases', as a `torque_table` where a `torque_map` is one,
        without columns that hold no value, and without a torque that is the current in other units;
        slow streams that were written into a fast table have a table of their own.
    findings
        Warnings.

    Raises
    ------
    CaptureError
        It is of no use, with every reason at once. A gate that breaks on what it was not made for
        refuses the capture too, for it has not been judged; it goes unsaid where another gate knows
        the reason.

    Notes
    -----
    Gates look at the capture as recorded, none at another's masks, so that their order does not
    matter.

    """
    check_metadata(capture.meta)
    capture, turned = in_rotor_frame(capture)
    capture, settled = as_settled_points(capture)
    check_columns(capture)
    masks: list[Mask] = []
    lost: list[Lost] = []
    capture, unfilled = _filled_rows(capture)
    capture, twice = _rows_once(capture)
    check_tables(capture)
    capture, counted = stamps_counted(capture)
    capture, held = held_apart(capture)
    capture, findings = _without_blanks(capture)
    capture, computed = _without_computed_torque(capture)
    findings = [*turned, *settled, *unfilled, *twice, *counted, *held, *findings, *computed]
    refusals: dict[str, CaptureError] = {}
    broken: list[CaptureError] = []
    for gate in gates():
        chosen = {**gate.settings(), **options.get(gate.name, {})}
        if capture.meta.test not in gate.tests or not chosen["enabled"]:
            continue
        try:
            passed = gate.check(capture, chosen)
        except CaptureError as refusal:
            refusals[gate.name] = with_time(capture, refusal)
        except BROKEN as error:
            broken.append(_broken(gate.name, error))
        else:
            masks.extend(passed.masks)
            lost.extend(passed.lost)
            findings.extend(passed.findings)
    if refusals or broken:
        raise merged(_causes_first(refusals) or broken)
    settings = {**missing_values.GATE.settings(), **options.get(missing_values.NAME, {})}
    capture, shaft = _with_shaft_angle(_without_lost(capture, lost))
    split = streams_split(capture, settings["dense_share"])
    return split.with_masks(*masks), (*findings, *shaft)


def _without_lost(capture: Capture, lost: Iterable[Lost]) -> Capture:
    """The capture with values missing that are no readings."""
    tables = list(capture.tables)
    for one in lost:
        table = tables[one.table]
        left = np.where(one.rows, np.nan, table[one.column].to_numpy())
        tables[one.table] = table.with_columns(pl.Series(one.column, left))
    return replace(capture, tables=tuple(tables))


def _with_shaft_angle(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture with the angle of the shaft in place of the electrical one, where that is all
    there is of its motion and the pole pairs are stated: beside each other they would count these.
    """
    pairs = capture.meta.pole_pairs
    other = any(capture.has(name) for name in _MOTION)
    if capture.meta.test not in _DRIVEN or other or not capture.has(_ELECTRICAL) or not pairs:
        return capture, []
    angle = (pl.col(_ELECTRICAL) / pairs).alias("theta_mech_rad")
    tables = tuple(
        t.with_columns(angle).drop(_ELECTRICAL) if _ELECTRICAL in t.columns else t
        for t in capture.tables
    )
    words = f"the shaft's angle is {_ELECTRICAL} over the {pairs} pole pairs that are stated"
    remedy = "log theta_mech_rad or omega_mech_rad_s of a sensor, which count them"
    return replace(capture, tables=tables), [warning(capture, "stated_pole_pairs", words, remedy)]


def _causes_first(refusals: Mapping[str, CaptureError]) -> list[CaptureError]:
    """The refusals by gate's name, those that another one's fault brings about last."""
    causes = {g.name: [n for n in g.follows if n in refusals] for g in gates()}
    return [refusals[name] for name in sorted(refusals, key=lambda name: len(causes[name]))]


def _filled_rows(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture without the end of a buffer that was not filled.

    These rows repeat the last one, its clock and all, so that none of them is known to be a sample.
    """
    tables, findings = [], []
    for table in capture.tables:
        changed = pl.any_horizontal(cs.numeric().ne_missing(cs.numeric().shift()))
        rows = table.select(changed).to_series().arg_true()
        first = int(rows[-1]) if rows.len() and "t_s" in table.columns else table.height - 1
        count = table.height - first
        if count > 1:
            words = f"the last {count} rows repeat one another, clock and all"
            remedy = "stop the file where the recording ends; they are left out"
            span = (first, table.height - 1)
            findings.append(warning(capture, "unfilled_rows", words, remedy, span))
        tables.append(table.head(first) if count > 1 else table)
    return (replace(capture, tables=tuple(tables)) if findings else capture), findings


def _rows_once(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture without rows that repeat the one before, clock and all.

    A bus or a logger sent such a row twice; it is no second sample.
    """
    tables, findings = [], []
    for table in capture.tables:
        changed = pl.any_horizontal(cs.numeric().ne_missing(cs.numeric().shift()))
        changed_rows = table.select(changed).to_series()
        rows = (~changed_rows).arg_true()
        if "t_s" not in table.columns or not rows.len():
            tables.append(table)
            continue
        words = f"{rows.len()} of {table.height} rows repeat the row before, clock and all"
        remedy = "write each row once; they are left out"
        span = (int(rows[0]), int(rows[-1]))
        findings.append(warning(capture, "repeated_rows", words, remedy, span))
        tables.append(table.filter(changed_rows))
    return (replace(capture, tables=tuple(tables)) if findings else capture), findings


def _without_computed_torque(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The drive without a torque that is its own current times a constant.

    Motor controllers log such a torque. It is no load of the shaft: taken for one, a shaft that it
    drives would have neither friction nor inertia.
    """
    if capture.meta.test != "drive" or not capture.has("iq_a", TORQUE):
        return capture, []
    columns = capture.arrays("iq_a", TORQUE)
    factor = same_but_for_noise(columns[TORQUE], columns["iq_a"])
    if factor is None:
        return capture, []
    tables = tuple(t.drop(TORQUE, strict=False) for t in capture.tables)
    words = f"{TORQUE} is {factor:.4g} N·m/A times iq_a and nothing else; set aside"
    remedy = (
        "leave it out of the source map: the drive computes it, and a transducer between motor and "
        "load would show friction and acceleration"
    )
    reduced = replace(capture, tables=tuple(t for t in tables if t.columns != ["t_s"]))
    return reduced, [warning(capture, "computed_torque", words, remedy)]


def _without_blanks(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture without columns that hold no value, which are as good as not there."""
    tables, blanks = [], []
    for table in capture.tables:
        filled = {n: np.isfinite(table[n].to_numpy()).any() for n in table.columns}
        filled_names = [name for name in table.columns if filled[name] or not table.height]
        blanks += [name for name in table.columns if name not in filled_names]
        if set(filled_names) - {"t_s"}:
            tables.append(table.select(filled_names))
    if not blanks:
        return capture, []
    words = f"{', '.join(sorted(blanks))}: no row holds a value, so the column counts as missing"
    remedy = "find out why the channel gave nothing, or leave it out of the file"
    blank_columns = warning(capture, "empty_column", words, remedy)
    return replace(capture, tables=tuple(tables)), [blank_columns]


def _broken(name: str, error: Exception) -> CaptureError:
    return CaptureError(
        "gate_failed",
        f"the gate {name} broke on this capture: {type(error).__name__}: {error}",
        f"report the capture with this line; gates.{name}.enabled=0 leaves the gate out",
    )
