"""pandera contracts built from the glossary: one for each set of columns, checked eagerly.

NaN stands for missing and passes everywhere but in time; infinity passes nowhere; nothing is
coerced. pandera takes most of a second to import, so it is imported on first use.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pipeline.contracts.protocol import with_time
from pipeline.contracts.requirements import requirements
from pipeline.contracts.rotor_frame import rotor_frame
from pipeline.physics.glossary import COLUMNS, METADATA, TESTS, Term, has_clock
from pipeline.records.capture import Capture, CaptureMeta
from pipeline.records.errors import CaptureError, merged

if TYPE_CHECKING:
    import pandera.polars as pa

EXAMPLES = 3

Rule = Callable[[str], pl.Expr]
_MOTION = ("theta_mech_rad", "theta_elec_rad", "omega_mech_rad_s")
REMEDIES = {
    "time_not_finite": "give every row its sampling instant, or leave the row out",
    "time_not_increasing": "sort the rows by t_s, drop repeats, or fix the logger's clock",
    "infinite_value": "write NaN where a value is missing",
    "implausible_value": "map the column's unit in conf/source, or write NaN where it is missing",
}


def _is_time(column: str) -> pl.Expr:
    return pl.col(column).is_finite()


def _increases(column: str) -> pl.Expr:
    """True on rows whose time is later than the row before; NaN is reported by `_is_time`."""
    step = pl.col(column).diff()
    return (step > 0.0) | step.is_null() | step.is_nan()


def _is_no_infinity(column: str) -> pl.Expr:
    return ~pl.col(column).is_infinite()


def _in_range(column: str) -> pl.Expr:
    """True inside the glossary's range, both ends in, and where there is nothing to judge."""
    term, value = COLUMNS[column], pl.col(column)
    inside = pl.lit(value=True)
    if term.low is not None:
        inside &= value >= term.low
    if term.high is not None:
        inside &= value <= term.high
    return inside | value.is_nan() | value.is_infinite() | value.is_null()


RULES: dict[str, Rule] = {
    "time_not_finite": _is_time,
    "time_not_increasing": _increases,
    "infinite_value": _is_no_infinity,
    "implausible_value": _in_range,
}


def _rules_of(column: str) -> tuple[str, ...]:
    if column == "t_s":
        return ("time_not_finite", "time_not_increasing", "implausible_value")
    return ("infinite_value", "implausible_value")


@cache
def table_schema(columns: tuple[str, ...]) -> pa.DataFrameSchema:
    """The contract of a table with some glossary columns; other columns are let pass.

    Parameters
    ----------
    columns
        Names of the glossary, each in its unit and range there.

    Returns
    -------
    DataFrameSchema
        All rules as one check, evaluated together: one for each would take eight times as long.

    Notes
    -----
    NaN stands for missing and passes everywhere but in time, which is finite and rises strictly;
    infinity passes nowhere; nothing is coerced.

    """
    import pandera.polars as pa

    def hold(data: pa.PolarsData) -> bool:
        return not broken(data.lazyframe, columns)

    return pa.DataFrameSchema(
        {
            name: pa.Column(pl.Float64, nullable=True, description=COLUMNS[name].words)
            for name in columns
        },
        checks=pa.Check(hold, name="rules"),
        strict=False,
        coerce=False,
    )


def broken(table: pl.LazyFrame, columns: tuple[str, ...]) -> list[tuple[str, str]]:
    """The rules that some row of a table does not keep.

    Parameters
    ----------
    table
        Any table.
    columns
        Columns of the glossary that it holds.

    Returns
    -------
    list of (column, code)
        In the order of the columns and of their rules.

    """
    rules = [(column, code) for column in columns for code in _rules_of(column)]
    unchanged = table.select(
        RULES[code](column).all().alias(str(place)) for place, (column, code) in enumerate(rules)
    )
    answers = unchanged.collect().row(0) if rules else ()
    return [one for one, holds in zip(rules, answers, strict=True) if not holds]


def check_tables(capture: Capture) -> None:
    """Holds every table of a capture against its contract.

    Parameters
    ----------
    capture
        As recorded.

    Raises
    ------
    CaptureError
        With all faults; its code, rows and remedy are those of the first one.

    """
    faults: list[CaptureError] = []
    for table in capture.tables:
        faults.extend(_table_faults(table))
    if faults:
        raise merged([with_time(capture, fault) for fault in faults])


def _table_faults(table: pl.DataFrame) -> list[CaptureError]:
    import pandera.errors

    known = tuple(name for name in table.columns if name in COLUMNS)
    try:
        table_schema(known).validate(table, lazy=True)
    except pandera.errors.SchemaErrors:
        typed = [c for c in known if table.schema[c] != pl.Float64]
        if typed:
            return [_not_numbers(table, c) for c in typed]
        return [_fault(table, *one) for one in broken(table.lazy(), known)]
    return []


def _not_numbers(table: pl.DataFrame, column: str) -> CaptureError:
    return CaptureError(
        "not_numeric",
        f"{column} holds {table.schema[column]} instead of numbers",
        "write plain numbers, and NaN or nothing where a value is missing",
    )


def _fault(table: pl.DataFrame, column: str, code: str) -> CaptureError:
    holds = table.select(RULES[code](column)).to_series().to_numpy()
    rows = np.flatnonzero(~holds)
    term, values = COLUMNS[column], table[column].to_numpy()
    examples = ", ".join(f"{values[row]:g}" for row in rows[:EXAMPLES])
    fault = {
        "time_not_finite": f"{column} has no finite value",
        "time_not_increasing": f"{column} does not increase",
        "infinite_value": f"{column} is infinite",
        "implausible_value": f"{column} is outside {term.low:g} to {term.high:g} {term.unit}",
    }[code]
    message = f"{fault} in {rows.size} of {table.height} rows ({examples})"
    return CaptureError(code, message, REMEDIES[code], (int(rows[0]), int(rows[-1])))


def check_columns(capture: Capture) -> None:
    """Whether a capture holds at least what its test asks for; an all-NaN column is not there.

    Parameters
    ----------
    capture
        As recorded.

    Raises
    ------
    CaptureError
        There is no row (`no_rows`), or a column is missing (`missing_column`): the message names
        what is needed and what there is.

    """
    test, tables = capture.meta.test, capture.tables
    if not any(table.height for table in tables):
        raise CaptureError("no_rows", f"the {test} holds no sample", "record it again")
    filled = frozenset(name for table in tables for name in _filled(table))
    wanted = requirements(test, capture.meta.pair)
    missing = [requirement for requirement in wanted if not requirement.met_by(filled)]
    if missing:
        needs = "; ".join(requirement.text() for requirement in missing)
        empty = sorted(capture.columns - filled)
        blank = f" (without a value: {', '.join(empty)})" if empty else ""
        raise CaptureError(
            "missing_column",
            f"{test} needs {needs}; the file has {', '.join(sorted(filled)) or 'none'}{blank}",
            _remedy(capture, filled),
        )
    if has_clock(test, capture.columns):
        _every_table_has_a_clock(capture)


def _remedy(capture: Capture, filled: frozenset[str]) -> str:
    """How a capture that lacks a column may come to one."""
    test = capture.meta.test
    if test == "drive" and "torque_shaft_nm" in filled and filled.intersection(_MOTION):
        return (
            "where the drive computes that torque from its current, map it to iq_a "
            "(`inspect ... column.NAME=iq_a`) and run with `constants={kt_peak_nm_a: 1}`; "
            "else record the current too"
        )
    if test == "drive" and {"vdc_v", "idc_a"} <= filled:
        return (
            "of the supply's power and a speed, what the road or the load takes is not known, and "
            "nothing of the motor follows: add torque_shaft_nm, which gives the motor constant and "
            "drag by the balance of power, or the phase current that the controller knows (iq_a)"
        )
    if test in ("drive", "torque_map") and len(filled & {"ia_a", "ib_a", "ic_a"}) >= 2:
        frames = (rotor_frame(table, capture.meta.pole_pairs) for table in capture.tables)
        reasons = "; ".join(dict.fromkeys(frame.words for frame in frames))
        return (
            "of line currents without an electrical angle follow their size and the electrical "
            f"speed, and nothing of the motor ({reasons}): log theta_elec_rad, 0 with the magnet "
            "on phase a, on the same clock, or id_a and iq_a, which the drive knows, with "
            "theta_mech_rad or omega_mech_rad_s; turned without current, line voltages alone give "
            "psi_pm_wb"
        )
    return "record what is missing, or map it in conf/source"


def _filled(table: pl.DataFrame) -> list[str]:
    numbers = [name for name in table.columns if table.schema[name].is_numeric()]
    if not numbers or not table.height:
        return []
    any_value = table.select(pl.col(numbers).cast(pl.Float64).is_not_nan().any())
    return [name for name, filled in any_value.row(0, named=True).items() if filled]


def _every_table_has_a_clock(capture: Capture) -> None:
    for table in capture.tables:
        if table.height and "t_s" not in table.columns:
            names = ", ".join(table.columns)
            raise CaptureError(
                "missing_column", f"the table of {names} has no t_s", "give it a clock"
            )


def check_metadata(meta: CaptureMeta) -> None:
    """Holds metadata against the glossary.

    Parameters
    ----------
    meta
        Of one capture.

    Raises
    ------
    CaptureError
        A test, pair or winding is unknown, or a number out of the glossary's range.

    """
    if meta.test not in TESTS:
        raise CaptureError(
            "unknown_test",
            f"test is {meta.test!r}, which is none of {', '.join(TESTS)}",
            "correct `test`, or map it in conf/source",
        )
    for key, allowed in (("pair", ("ab", "bc", "ca")), ("winding", ("wye", "delta"))):
        value = getattr(meta, key)
        if value is not None and value not in allowed:
            raise CaptureError(
                "unknown_metadata",
                f"{key} is {value!r}, which is none of {', '.join(allowed)}",
                f"correct `{key}`",
            )
    for term in METADATA.values():
        _metadata_in_range(term, getattr(meta, term.name, None))


def _metadata_in_range(term: Term, value: object) -> None:
    if not isinstance(value, (int, float)) or term.low is None or term.high is None:
        return
    if not term.low <= value <= term.high:
        raise CaptureError(
            "implausible_metadata",
            f"{term.name} is {value:g}, outside {term.low:g} to {term.high:g} {term.unit}",
            f"correct `{term.name}`, or leave it out",
        )
