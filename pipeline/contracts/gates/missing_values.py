"""Missing values in a column that the test rests on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of, warning
from pipeline.contracts.requirements import columns_required
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding
from pipeline.records.naming import counted

NAME = "missing_values"
TWO_CLOCKS = "put columns of different clocks on one clock, or in MCAP topics of their own"
REMEDY = "find out why the channel dropped out, and record again if those rows matter"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Sets rows without a needed value aside and counts them; refuses if few are left.

    Notes
    -----
    Fewer than `fewest` values of a column that the test rests on refuse, and so do fewer rows that
    hold all of them, in a table with a clock; without one each row is a reading by itself, and one
    is enough. A single row without a value, of a log of continuous signals, is read between those
    beside it: of eight columns that lack one value in twenty each, a third of the rows would go,
    and a gap would be in every window. A column with values in
    fewer than `dense_share` [1] of the rows is a slow stream written into a fast table, not a
    fault: its blanks are left as they are. A stream that the test does not rest on may hold a
    single row.

    """
    masks: list[Mask] = []
    findings: list[Finding] = []
    meta = capture.meta
    needed = columns_required(meta.test, meta.pair, capture.columns)
    for index, table in enumerate(capture.tables):
        names = [n for n in needed if n in table.columns]
        if set(names) <= {"t_s"}:
            continue
        finite = {name: np.isfinite(table[name].to_numpy()) for name in names}
        dense = {n: g for n, g in finite.items() if g.mean() >= options["dense_share"]}
        known = [np.isfinite(capture.bridged_column(index, name)) for name in dense]
        keep = np.all(known, axis=0) if known else np.ones(table.height, dtype=bool)
        fewest = options["fewest"] if "t_s" in table.columns else 1.0
        for name in names:
            if np.count_nonzero(finite[name]) < fewest:
                raise CaptureError(
                    NAME,
                    f"{name} has {counted(int(np.count_nonzero(finite[name])), 'value')}; "
                    f"{meta.test} needs {fewest:.0f} at least",
                    "record for longer, or faster",
                )
        whole = np.all(list(dense.values()), axis=0) if dense else keep
        if whole.all():
            continue
        holes = ", ".join(f"{n} {np.count_nonzero(~g)}" for n, g in dense.items() if not g.all())
        words = f"{np.count_nonzero(~whole)} of {keep.size} rows miss a value ({holes})"
        if np.count_nonzero(keep) < fewest:
            raise CaptureError(NAME, words, TWO_CLOCKS)
        aside = np.count_nonzero(~keep)
        single = np.count_nonzero(~whole) - aside
        words += "" if not single else f"; {single} are read between the rows beside them"
        words += "" if not aside else f"; {aside} set aside" if single else "; set aside"
        masks += [Mask(NAME, index, keep)] if aside else []
        findings.append(warning(capture, NAME, words, REMEDY, span_of(~whole)))
    return Passed(tuple(masks), tuple(findings))


GATE = Gate(
    NAME,
    tuple(TESTS),
    check,
    {
        # Below half, blanks are the rule: two rates in one table.
        "dense_share": 0.5,
        # One value of a trace makes no fit; what more a test needs its other gates ask for.
        "fewest": 2.0,
    },
)
