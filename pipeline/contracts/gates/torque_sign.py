"""A torque that opposes its current: the transducer's or the current's sign is turned."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

BLOCKS = 100


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a torque map whose shaft torque falls as i_q grows."""
    data = capture.arrays("torque_shaft_nm", "iq_a")
    rows = np.column_stack([data["iq_a"], data["torque_shaft_nm"]])
    rows = rows[np.isfinite(rows).all(axis=1)]
    size = rows.shape[0] // BLOCKS
    if size == 0:
        return Passed()
    means = rows[: size * BLOCKS].reshape(BLOCKS, size, 2).mean(axis=1)
    if not means.std(axis=0).all():
        return Passed()
    correlation = float(np.corrcoef(means.T)[0, 1])
    if correlation < -options["correlation"]:
        raise CaptureError(
            "torque_sign",
            f"torque_shaft_nm falls as iq_a grows (correlation {correlation:.2f})",
            "turn the sign of the torque or of the currents in conf/source: positive torque drives "
            "positive rotation, currents are positive into the motor",
        )
    return Passed()


GATE = Gate(
    "torque_sign",
    ("torque_map",),
    check,
    # A healthy map correlates near +1; -0.5 over 100 blocks is five standard deviations from 0.
    {"correlation": 0.5},
)
