"""One recording under two names, in whatever form and with whatever metadata, counts once.

Two recordings of one test differ in every noisy sample, so that rows which are equal to the last
digit that a form keeps are the same rows. Counted twice they would halve a variance that they do
nothing to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records.capture import Array, Capture
from pipeline.records.finding import Finding

CODE = "duplicate_rows"


@dataclass(frozen=True, slots=True)
class DuplicatePolicy:
    """Choices of judgement.

    `rounding` [1]: of a column's largest size, what a form with seven digits loses. `share` [1]: of
    the shorter capture's rows that must stand in the longer one. `values`: least different values
    of a column by which rows are known again, for a constant or a switched one is no fingerprint;
    they are looked for in `sample` rows. `begins`: places where the first value of the shorter run
    stands in the longer one, at most.
    """

    rounding: float = 1e-6
    share: float = 0.9
    values: int = 6
    sample: int = 4096
    begins: int = 64


POLICY = DuplicatePolicy()


def once(captures: Sequence[Capture]) -> tuple[tuple[Capture, ...], tuple[Finding, ...]]:
    """The captures without those whose rows another one holds.

    Parameters
    ----------
    captures
        Of one motor.

    Returns
    -------
    kept
        By path. Of two the longer, of two equally long the one whose bytes are verified, then the
        first by path.
    findings
        A warning for each of the others.

    """
    ranked = sorted(captures, key=lambda c: (-_rows(c), c.integrity != "verified", c.path))
    prints = {c.path: _fingerprint(c) for c in ranked}
    unique: list[Capture] = []
    findings = []
    for capture in ranked:
        other = next((k for k in unique if _same_rows(prints[k.path], prints[capture.path])), None)
        if other is None:
            unique.append(capture)
        else:
            findings.append(_finding(capture, other))
    unique.sort(key=lambda c: c.path)
    return tuple(unique), tuple(sorted(findings))


def _rows(capture: Capture) -> int:
    return max((table.height for table in capture.tables), default=0)


def _fingerprint(capture: Capture) -> dict[str, Array]:
    """The columns [rows each] by which rows are known again, without time and blanks."""
    columns = {}
    for table in capture.tables:
        for name in table.columns:
            signal = table[name].to_numpy()
            finite = np.isfinite(signal)
            signal = signal if finite.all() else signal[finite]
            sample = signal[:: max(1, signal.size // POLICY.sample)]
            if name != "t_s" and np.unique(sample).size >= POLICY.values:
                columns[name] = signal
    return columns


def _same_rows(long: dict[str, Array], short: dict[str, Array]) -> bool:
    """Whether the columns of one are columns of the other, rows and all.

    One that both hold is not enough: two pairs of one winding have a thermometer in common.
    """
    fewer, more = sorted((set(short), set(long)), key=len)
    shared = fewer & more
    return bool(fewer) and shared == fewer and all(_holds(long[n], short[n]) for n in sorted(fewer))


def _holds(long: Array, short: Array) -> bool:
    """Whether one run of values holds the other, or all but its end of it, to the last digit."""
    if short.size > long.size:
        long, short = short, long
    tolerance = POLICY.rounding * float(np.abs(long).max())
    begins = np.flatnonzero(np.abs(long - short[0]) <= tolerance)
    for begin in begins[: POLICY.begins].tolist():
        size = min(short.size, long.size - begin)
        if size < POLICY.share * short.size:
            continue
        if np.all(np.abs(long[begin : begin + size] - short[:size]) <= tolerance):
            return True
    return False


def _finding(capture: Capture, other: Capture) -> Finding:
    where = "all its rows stand in" if _rows(capture) < _rows(other) else "it holds the rows of"
    words = f"{where} {other.path}, and one recording counts once: {other.path} is used"
    differs = [
        key
        for key in ("test", "station", "lot", "started_at", "pair", "theta_elec_deg")
        if getattr(capture.meta, key) != getattr(other.meta, key)
    ]
    if differs:
        words += f", whose {', '.join(differs)} differ"
    return Finding(capture.path, "warning", CODE, words, "remove one of the two")
