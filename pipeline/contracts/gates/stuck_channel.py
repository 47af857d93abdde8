"""A channel that stands still while the test must move it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from pipeline.contracts.protocol import Gate, Passed, span_of, warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES
from pipeline.contracts.waveform import (
    Array,
    Rows,
    longest_likely_run,
    rows_of_runs,
    runs_of_equal,
    share_of_repeats,
)
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

NAME = "stuck_channel"
TERMINALS = (*LINE_VOLTAGES, *LINE_CURRENTS)
MUST_MOVE: dict[str, tuple[str, ...]] = {
    "resistance": (),
    "current_step": TERMINALS,
    "open_circuit": (*LINE_VOLTAGES, "theta_mech_rad"),
    "hand_turn": (*LINE_VOLTAGES, "theta_mech_rad"),
    "cogging": ("theta_mech_rad", "torque_shaft_nm"),
    "torque_map": ("iq_a", "vd_v", "vq_v", "torque_shaft_nm", "theta_mech_rad"),
    "spin_down": ("omega_mech_rad_s", "theta_mech_rad"),
    "heat_run": (),
    "holding_current": ("theta_mech_rad", "iq_a"),
    "flux_map": ("psi_d_wb", "psi_q_wb"),
    "drive": ("iq_a", "vq_v"),
}
NOISY = (*TERMINALS, "va_v", "vb_v", "vc_v", "id_a", "iq_a", "torque_shaft_nm")
DQ_VOLTAGES = ("vd_v", "vq_v")
BESIDE = 50
REMEDY = "check the sensor and its lead, and record again"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a dead channel; sets aside the rows in which a noisy one froze.

    Notes
    -----
    Dead is a column that the test must move and that has one value in every row. Frozen rows are
    those of `frozen_rows`; more than `refuse_share` [1] of them refuse.

    """
    masks: list[Mask] = []
    findings: list[Finding] = []
    for index, table in enumerate(capture.tables):
        for name in table.columns:
            signal = table[name].to_numpy()
            if name in MUST_MOVE[capture.meta.test] and not (
                _is_command(capture, name)
                or (name in DQ_VOLTAGES and is_short_circuit(table, options["motoring_share"]))
            ):
                _refuse_dead(name, signal)
            if name not in NOISY:
                continue
            frozen = frozen_rows(signal, options)
            count = int(np.count_nonzero(frozen))
            if count == 0:
                continue
            words = f"{name} stands still in {count} of {signal.size} rows"
            if count > options["refuse_share"] * signal.size:
                raise CaptureError(NAME, words, REMEDY, span_of(frozen))
            masks.append(Mask(NAME, index, ~frozen))
            findings.append(warning(capture, NAME, f"{words}; set aside", REMEDY, span_of(frozen)))
    return Passed(tuple(masks), tuple(findings))


def _is_command(capture: Capture, name: str) -> bool:
    """Whether a column is the voltage that a drive commands: a step is one value in every row."""
    return name in DQ_VOLTAGES and capture.meta.voltage_kind == "commanded"


def is_short_circuit(table: pl.DataFrame, motoring_share: float) -> bool:
    """Whether zero voltages in every row are those of shorted terminals.

    Parameters
    ----------
    table
        Columns of a drive log.
    motoring_share
        Largest share [1] of a power that such a winding does not take.

    Returns
    -------
    bool
        False where a column is missing.

    Notes
    -----
    A winding whose terminals are shorted takes no power: the magnet drives the current, which
    brakes the shaft (i_q against the speed) and weakens the magnet (i_d below zero). At steady
    speed, R i_d = ω_e L_q i_q and R i_q = −ω_e (ψ + L_d i_d). A current that does so in all but
    `motoring_share` of Σ abs(ω i_q) and of Σ abs(i_d) is of a short circuit, and a voltage column
    that is dead would see a drive's currents: they motor as well.

    References
    ----------
    IEEE Std 1812-2014, short-circuit tests of machines with permanent magnets.

    """
    needed = (*DQ_VOLTAGES, "id_a", "iq_a", "omega_mech_rad_s")
    if any(name not in table.columns for name in needed):
        return False
    columns = {name: table[name].to_numpy() for name in needed}
    if any(np.any(np.nan_to_num(columns[name]) != 0.0) for name in DQ_VOLTAGES):
        return False
    for power in (columns["omega_mech_rad_s"] * columns["iq_a"], columns["id_a"]):
        known = power[np.isfinite(power)]
        if not known.any() or known[known > 0.0].sum() > motoring_share * np.abs(known).sum():
            return False
    return True


def _refuse_dead(name: str, values: Array) -> None:
    finite = values[np.isfinite(values)]
    if finite.size > 1 and np.all(finite == finite[0]):
        raise CaptureError(
            NAME, f"{name} is {finite[0]:g} in every row", REMEDY, (0, values.size - 1)
        )


def frozen_rows(values: Array, options: Mapping[str, float]) -> Rows:
    """Rows of runs of one value that a noisy signal does not make by chance.

    Parameters
    ----------
    values
        Signal [n, any unit].
    options
        `chance` [1], `shortest_run` [samples], `drop_share` [1].

    Returns
    -------
    array [n] of bool

    Notes
    -----
    Runs longer than `longest_likely_run`. Those at the extremes are the gate `saturation`'s. A run
    of exact zeros counts only where the signal drops to it by more than `drop_share` of its range:
    a drive that is switched off logs zero current rightly. A signal that settles on one code
    repeats more and more before it does; a frozen one does not.

    """
    none = np.zeros(values.size, dtype=bool)
    likely = max(longest_likely_run(values, options["chance"]), options["shortest_run"])
    if not np.isfinite(likely):
        return none
    starts, lengths = runs_of_equal(values)
    runs = np.flatnonzero(lengths > likely)
    if runs.size == 0:
        return none
    low, high = np.nanmin(values), np.nanmax(values)
    frozen = [r for r in runs if low < values[starts[r]] < high]
    afar = options["drop_share"] * (high - low)
    frozen = [r for r in frozen if values[starts[r]] != 0.0 or _falls_from(values, starts[r], afar)]
    frozen = [r for r in frozen if not _settles(values, starts[r], lengths[r])]
    return rows_of_runs(values.size, starts[frozen], lengths[frozen]) if frozen else none


def _falls_from(values: Array, start: int, afar: float) -> bool:
    return bool(start > 0 and abs(values[start - 1] - values[start]) > afar)


def _settles(values: Array, start: int, length: int) -> bool:
    before = values[max(0, start - BESIDE) : start]
    after = values[start + length : start + length + BESIDE]
    return any(side.size > 1 and share_of_repeats(side) > 0.5 for side in (before, after))


GATE = Gate(
    NAME,
    tuple(MUST_MOVE),
    check,
    {
        # Expected number of such runs in a healthy capture of any length.
        "chance": 1e-6,
        # Shorter stretches cost a fit nothing.
        "shortest_run": 20.0,
        # A fifth of the range within one sample is no motor's doing.
        "drop_share": 0.2,
        # Beyond a fifth the record is no longer that of the test it claims to be.
        "refuse_share": 0.2,
        # Noise, and what the current swings after the switch closes.
        "motoring_share": 0.1,
    },
)
