"""Three line currents, or three line voltages, that do not sum to zero."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES
from pipeline.contracts.waveform import noise_of
from pipeline.physics.glossary import TESTS
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

SIGMAS = 6.0
CODES = {LINE_CURRENTS: "current_sum", LINE_VOLTAGES: "voltage_sum"}
REMEDIES = {
    LINE_CURRENTS: "check the gain, sign and wiring of each current sensor (no neutral is led out)",
    LINE_VOLTAGES: "check the gain, sign and wiring of each voltage probe",
}


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns of currents or voltages whose sum is beyond what gains explain, refuses a gross one.

    Notes
    -----
    The statistic is `sum_share` [1]. It warns above `warn_share`, or `coverage` times the stated
    relative uncertainty of the gain where that is more, for three independent gains of u leave a
    sum of about u; it refuses above `refuse_share`. Gains of unstated uncertainty explain nothing
    here, though budgets take them as 1 %: five times that would pass one sensor that is 8 % off
    without a word.

    """
    stated = {
        LINE_CURRENTS: capture.meta.u_rel_current,
        LINE_VOLTAGES: capture.meta.u_rel_voltage,
    }
    findings: list[Finding] = []
    for names, code in CODES.items():
        u_rel = stated[names]
        allowed = max(options["warn_share"], options["coverage"] * (u_rel or 0.0))
        for table in capture.tables:
            if not set(names) <= set(table.columns):
                continue
            share = sum_share(table, names, options["additive"])
            words = (
                f"{' + '.join(names)} is {100.0 * share:.3g} % of them (rms), where "
                f"{100.0 * allowed:.3g} % could be the instruments' gains"
            )
            if share > options["refuse_share"]:
                raise CaptureError(code, words, REMEDIES[names])
            if share > allowed:
                findings.append(warning(capture, code, words, REMEDIES[names]))
    return Passed(findings=tuple(findings))


def sum_share(table: pl.DataFrame, names: tuple[str, ...], additive: float) -> float:
    """Root mean square of the sum of three signals over that of the three together, noise left out.

    Parameters
    ----------
    table
        Columns of the signals.
    names
        Which three.
    additive
        Multiple of the noise [1] below which a sum is any channel's offset, hum and drift.

    Returns
    -------
    float
        [1]; 0 where the sum is not clear of its own scatter, or below `additive` times the noise.

    Notes
    -----
    share² = mean(s_k s_(k+1))/mean(a² + b² + c²): the product of neighbours holds none of the white
    noise. Its scatter is mean(s²)/√n.

    """
    three = [table[name].to_numpy() for name in names]
    total = three[0] + three[1] + three[2]
    finite = np.isfinite(total)
    power = float(sum(np.mean(column[finite] ** 2) for column in three)) if finite.any() else 0.0
    total = total[finite]
    if power == 0.0 or total.size < 2:
        return 0.0
    shared = float(np.mean(total[1:] * total[:-1]))
    scatter = float(np.mean(total**2)) / np.sqrt(total.size)
    if shared < max(SIGMAS * scatter, (additive * noise_of(total)) ** 2):
        return 0.0
    return float(np.sqrt(shared / power))


GATE = Gate(
    "phase_sum",
    tuple(TESTS),
    check,
    {
        # A percent is an offset of half a percent of range with the usual margin of two.
        "warn_share": 0.01,
        # Offset, hum and drift of a good channel stay within a few times its noise.
        "additive": 3.0,
        # Three independent gains of relative uncertainty u leave a sum of about u; k = 5.
        "coverage": 5.0,
        # No sensor is a tenth off: a channel is swapped, dead, reversed or another motor's.
        "refuse_share": 0.1,
    },
)
