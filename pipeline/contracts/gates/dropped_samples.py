"""Samples that the logger lost: gaps in an otherwise even clock."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import LINE_CURRENTS
from pipeline.contracts.waveform import gaps_of, missing_samples
from pipeline.records.capture import Capture, Indices
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

NAME = "dropped_samples"
TESTS = (
    "current_step",
    "open_circuit",
    "hand_turn",
    "cogging",
    "torque_map",
    "spin_down",
    "heat_run",
    "drive",
)
STEADY = "torque_map"
REMEDY = (
    "record again with a logger that keeps up, or at a lower rate; state `pause_s` where the "
    "recorder paused"
)


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns of lost samples; refuses where too many are lost, or those of the step itself.

    Notes
    -----
    Lost are Σ (gap/interval − 1) samples over the gaps that are longer than `gap_intervals` [1]
    median intervals and no pauses (`pause_s`), less what a hurried clock made up for. A share
    above `refuse_share` [1] refuses, but of a torque map, whose levels are steady: a rig may log
    them alone. So does a gap of a current step in which the current changes by more than
    `edge_share` [1] of its range.

    """
    findings: list[Finding] = []
    for table in capture.tables:
        if table.height < 3 or "t_s" not in table.columns:
            continue
        t_s = table["t_s"].to_numpy()
        gaps, usual_s = gaps_of(t_s, options["gap_intervals"], capture.meta.pause_s)
        missing = missing_samples(t_s, gaps, usual_s)
        if missing < 0.5:
            continue
        share = missing / (missing + t_s.size)
        words = (
            f"about {missing:.0f} samples are missing in {gaps.size} gaps, {100 * share:.2g} % of "
            f"the record; the widest is {np.diff(t_s)[gaps].max():.3g} s where {usual_s:.3g} s "
            "is usual"
        )
        rows = (int(gaps[0]), int(gaps[-1]) + 1)
        if share > options["refuse_share"] and capture.meta.test != STEADY:
            raise CaptureError(NAME, words, REMEDY, rows)
        if capture.meta.test == "current_step":
            _refuse_lost_edge(table, gaps, options["edge_share"], words)
        findings.append(warning(capture, NAME, words, REMEDY, rows))
    return Passed(findings=tuple(findings))


def _refuse_lost_edge(table: pl.DataFrame, gaps: Indices, edge_share: float, words: str) -> None:
    for name in LINE_CURRENTS:
        if name not in table.columns:
            continue
        current = table[name].to_numpy()
        change = np.abs(current[gaps + 1] - current[gaps])
        edge_gaps = gaps[change > edge_share * (np.nanmax(current) - np.nanmin(current))]
        if edge_gaps.size:
            after = int(edge_gaps[0])
            words = f"{words}; {name} changes by {change.max():.3g} A inside one gap"
            raise CaptureError(NAME, words, REMEDY, (after, after + 1))


GATE = Gate(
    NAME,
    TESTS,
    check,
    {
        # Half way between one interval and two: what lies beyond is nearer to a lost sample.
        "gap_intervals": 1.5,
        # Beyond a fifth the record is no longer that of the test it claims to be.
        "refuse_share": 0.2,
        # The step is fitted through the integrals of v and i; across a gap these are trapezoids,
        # off by up to half the gap's area: a tenth of the step lost is a percent of L and more.
        "edge_share": 0.1,
    },
)
