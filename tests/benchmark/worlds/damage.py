"""What a log loses between the sensor and the person who has it: columns, rows, digits.

Each kind of damage is a function from a log's columns to what is left of them, drawn from a
generator. Tests that are no log (a table, two terminals) keep their voltages and currents, as they
are nothing without them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.records.capture import Capture
from tests.benchmark.worlds.lanes import Array

Columns = dict[str, Array]
Damage = Callable[[Columns, np.random.Generator], Columns]

LOGS = ("drive", "torque_map", "spin_down", "heat_run", "hand_turn", "holding_current")
FEWEST_ROWS = 8
VOLTAGES = ("vd_v", "vq_v", "va_v", "vb_v", "vc_v")
CURRENTS = ("id_a", "iq_a", "ia_a", "ib_a", "ic_a")
TEMPERATURES = ("temp_winding_degc", "temp_magnet_degc")
EXACT_COLUMNS = ("t_s", "theta_mech_rad")
"""Columns that come from a counter and keep all their digits."""


def without(*names: str) -> Damage:
    """A log that was never told to write these columns."""
    return lambda columns, _: {n: v for n, v in columns.items() if n not in names}


def every(rate_hz: float) -> Damage:
    """Telemetry: single rows at about `rate_hz`."""

    def thinned(columns: Columns, _: np.random.Generator) -> Columns:
        step = _rows_a_period(columns, rate_hz)
        return {n: v[::step] for n, v in columns.items()}

    return thinned


def means(rate_hz: float) -> Damage:
    """Telemetry at about `rate_hz`: means of each period, at the time and angle of its middle."""

    def averaged(columns: Columns, _: np.random.Generator) -> Columns:
        step = _rows_a_period(columns, rate_hz)
        whole = columns["t_s"].size // step * step
        periods = {n: v[:whole].reshape(-1, step) for n, v in columns.items()}
        return {
            n: v[:, step // 2] if n in EXACT_COLUMNS else v.mean(axis=1) for n, v in periods.items()
        }

    return averaged


def jittered(columns: Columns, rng: np.random.Generator) -> Columns:
    """Time stamps that scatter by a fifth of a row."""
    t_s = columns["t_s"]
    scatter = 0.2 * float(np.median(np.diff(t_s))) * rng.standard_normal(t_s.size).clip(-2.0, 2.0)
    return {**columns, "t_s": t_s + scatter}


def milliseconds(columns: Columns, _: np.random.Generator) -> Columns:
    """Time stamps of whole milliseconds that have passed, the first row of each."""
    t_s = np.floor(1e3 * columns["t_s"] + 1e-6) / 1e3
    first = np.diff(t_s, prepend=-np.inf) > 0.0
    return {n: v[first] for n, v in {**columns, "t_s": t_s}.items()}


def lost_rows(columns: Columns, rng: np.random.Generator) -> Columns:
    """A tenth of the rows lost one by one, and three stretches of a thirtieth."""
    n = columns["t_s"].size
    kept = rng.uniform(size=n) > 0.1
    for begin in rng.integers(0, n, 3):
        kept[begin : begin + n // 30] = False
    return {name: v[kept] for name, v in columns.items()}


def lost_values(columns: Columns, rng: np.random.Generator) -> Columns:
    """A twentieth of the values of each column missing."""
    n = len(next(iter(columns.values())))
    return {
        name: v if name == "t_s" else np.where(rng.uniform(size=n) < 0.05, np.nan, v)
        for name, v in columns.items()
    }


def digits(columns: Columns, _: np.random.Generator) -> Columns:
    """Three digits of each value."""
    return {n: v if n in EXACT_COLUMNS else _rounded(v, np.abs(v)) for n, v in columns.items()}


def decimals(columns: Columns, _: np.random.Generator) -> Columns:
    """As many decimals as give the largest value of the column three digits."""
    return {
        n: v if n in EXACT_COLUMNS else _rounded(v, np.full(v.size, np.nanmax(np.abs(v))))
        for n, v in columns.items()
    }


def held(every_nth: int, *names: str) -> Damage:
    """A bus that is slower than the rows: new values in every n-th, the last one between."""

    def repeated(columns: Columns, rng: np.random.Generator) -> Columns:
        rows = np.arange(columns["t_s"].size)
        first = int(rng.integers(every_nth))
        source = np.maximum((rows - first) // every_nth * every_nth + first, 0)
        return {n: v[source] if n in names else v for n, v in columns.items()}

    return repeated


def apart(every_nth: int, *names: str) -> Damage:
    """Topics of two rates in one table: a slow one's values where it has some."""

    def blank(columns: Columns, rng: np.random.Generator) -> Columns:
        rows = np.arange(columns["t_s"].size)
        there = rows % every_nth == rng.integers(every_nth)
        return {n: np.where(there, v, np.nan) if n in names else v for n, v in columns.items()}

    return blank


def readings_of_zero(columns: Columns, rng: np.random.Generator) -> Columns:
    """A link that loses one reading in a thousand and writes 0."""
    names = ("id_a", "iq_a", "torque_shaft_nm", "omega_mech_rad_s", "theta_mech_rad")
    return {
        n: np.where(rng.uniform(size=v.size) < 1e-3, 0.0, v) if n in names else v
        for n, v in columns.items()
    }


def six_digits(columns: Columns, _: np.random.Generator) -> Columns:
    """Six digits of each value, of the angle too, as C and C++ write one."""
    return {n: v if n == "t_s" else _rounded(v, np.abs(v), 6) for n, v in columns.items()}


def begun_late(columns: Columns, rng: np.random.Generator) -> Columns:
    """The last 20 to 70 % of the rows."""
    left = int(columns["t_s"].size * rng.uniform(0.2, 0.7))
    return {name: v[-left:] for name, v in columns.items()}


def ended_early(columns: Columns, rng: np.random.Generator) -> Columns:
    """The first 20 to 70 % of the rows."""
    left = int(columns["t_s"].size * rng.uniform(0.2, 0.7))
    return {name: v[:left] for name, v in columns.items()}


KINDS: Mapping[str, Mapping[str, tuple[Damage, ...]]] = {
    "whole": {"whole": ()},
    "columns": {
        "no voltage": (without(*VOLTAGES),),
        "no current": (without(*CURRENTS),),
        "no q axis": (without("iq_a", "vq_v"),),
        "no d axis": (without("id_a", "vd_v"),),
        "no d current": (without("id_a"),),
        "no d voltage": (without("vd_v"),),
        "no q voltage": (without("vq_v"),),
        "no torque": (without("torque_shaft_nm"),),
        "no angle": (without("theta_mech_rad"),),
        "no speed": (without("omega_mech_rad_s"),),
        "no temperature": (without(*TEMPERATURES),),
        "no angle, no speed": (without("theta_mech_rad", "omega_mech_rad_s"),),
        "no torque, no temperature": (without("torque_shaft_nm", *TEMPERATURES),),
        "no voltage, no torque": (without(*VOLTAGES, "torque_shaft_nm"),),
        "no speed, no torque": (without("omega_mech_rad_s", "torque_shaft_nm"),),
        "no angle, no torque": (without("theta_mech_rad", "torque_shaft_nm"),),
    },
    "rows": {
        "100 Hz": (every(100.0),),
        "500 Hz": (every(500.0),),
        "1 kHz": (every(1000.0),),
        "means at 50 Hz": (means(50.0),),
        "means at 200 Hz": (means(200.0),),
        "500 Hz, no current": (without(*CURRENTS), every(500.0)),
        "jitter": (jittered,),
        "milliseconds": (milliseconds,),
        "rows lost": (lost_rows,),
        "values lost": (lost_values,),
        "begun late": (begun_late,),
        "ended early": (ended_early,),
    },
    "digits": {"three digits": (digits,), "few decimals": (decimals,)},
    "links": {
        "torque held": (held(10, "torque_shaft_nm"),),
        "angle held": (held(4, "theta_mech_rad"),),
        "voltage held": (held(5, "vd_v", "vq_v"),),
        "currents and voltages held": (held(5, "id_a", "iq_a", "vd_v", "vq_v"),),
        "slow torque": (apart(7, "torque_shaft_nm"),),
        "slow temperatures": (apart(50, *TEMPERATURES),),
        "readings of zero": (readings_of_zero,),
        "six digits": (six_digits,),
    },
}
"""Groups of damages, and the damages of each, that are done one after the other."""
JUDGED = ("links",)
"""Groups whose logs are held against the contract first, which says what is no sample."""


def damaged(
    capture: Capture, damage: tuple[Damage, ...], rng: np.random.Generator
) -> Capture | None:
    """What is left of a capture, None where nothing is that a reader would take.

    Digits and values are lost in every capture, columns and rows in logs alone.
    """
    anywhere = (digits, decimals, lost_values)
    tables = []
    for table in capture.tables:
        columns = {n: table[n].to_numpy().astype(np.float64) for n in table.columns}
        for one in damage:
            if one in anywhere or (capture.meta.test in LOGS and "t_s" in columns):
                columns = one(columns, rng)
        measured = [n for n in columns if n not in ("t_s", "vdc_v", *TEMPERATURES)]
        if not measured or len(columns[measured[0]]) < FEWEST_ROWS <= table.height:
            return None
        tables.append(pl.DataFrame(columns))
    return replace(capture, tables=tuple(tables))


def _rows_a_period(columns: Columns, rate_hz: float) -> int:
    return max(1, round(1.0 / (rate_hz * float(np.median(np.diff(columns["t_s"]))))))


def _rounded(values: Array, size: Array, kept: int = 3) -> Array:
    """Values to so many digits of `size`."""
    step = 10.0 ** (np.floor(np.log10(np.where(size > 0.0, size, 1.0))) - kept + 1.0)
    rounded: Array = np.round(values / step) * step
    return rounded
