"""A passive winding that delivers power: the current or the voltage is turned."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

FRAME = ("vd_v", "vq_v", "id_a", "iq_a")


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a two-terminal test or heat run whose terminals deliver energy over the recording.

    Notes
    -----
    Σ v i/Σ |v i| is near 1 in a winding that only dissipates and stores; below −`share` [1]
    refuses.

    """
    pair = capture.meta.pair or "ab"
    line = next((phase for phase in pair if capture.has(f"i{phase}_a")), pair[0])
    terminals = (f"v{pair}_v", f"i{line}_a")
    if capture.has(*terminals):
        columns = capture.arrays(*terminals)
        sense = 1.0 if line == pair[0] else -1.0
        power = sense * columns[terminals[0]] * columns[terminals[1]]
    elif capture.has(*FRAME):
        columns = capture.arrays(*FRAME)
        power = columns["vd_v"] * columns["id_a"] + columns["vq_v"] * columns["iq_a"]
    else:
        return Passed()
    power = power[np.isfinite(power)]
    total = float(np.abs(power).sum())
    if total == 0.0 or float(power.sum()) > -options["share"] * total:
        return Passed()
    raise CaptureError(
        "power_sign",
        "voltage and current have opposite signs: the winding would deliver power",
        "turn the sign of the current or of the voltage in conf/source: currents are positive "
        "into the motor",
    )


GATE = Gate(
    "power_sign",
    ("resistance", "current_step", "heat_run"),
    check,
    # Noise alone gives a share near 0, a turned sign near 1; half way is neither by chance.
    {"share": 0.5},
)
