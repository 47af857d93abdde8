"""A torque that opposes its current: the transducer's or the current's sign is turned."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed
from pipeline.contracts.waveform import Array
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

BLOCKS = 100
LEAST_ROWS, MOST = 4, 0.95
_PROMISING = ("vq_v", "omega_mech_rad_s")


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses a torque map, a torque table or a drive log whose shaft torque falls as i_q grows.

    Notes
    -----
    The correlation of `BLOCKS` block means below −`correlation` [1] refuses; of n < `BLOCKS` rows
    one as many standard deviations 1/√n below zero, and −0.95 of a few. In a map the
    dynamometer holds the speed, and the torque is the current's alone. In a drive log inertia and
    friction take their share, and a shaft that carries nothing shows the transducer's drift: there
    a curve of second order in time is taken off, and the torque must also fall by `least_share` [1]
    of the torque per ampere that follows from the voltage at speed, Kt = 1.5 v_q/ω. Without a
    voltage nothing but a correlation below −0.95 refuses a drive log.

    """
    drive = capture.meta.test == "drive"
    promised = drive and capture.has(*_PROMISING)
    names = ("iq_a", "torque_shaft_nm", *(_PROMISING if promised else ()))
    if not capture.has(*names):
        return Passed()
    rows = np.column_stack(list(capture.finite(*names).values()))
    blocks = min(BLOCKS, rows.shape[0])
    if blocks < LEAST_ROWS:
        return Passed()
    size = rows.shape[0] // blocks
    means = rows[: size * blocks, :2].reshape(blocks, size, 2).mean(axis=1)
    least = 0.0
    if drive:
        means = _without_drift(means)
    if promised:
        least = options["least_share"] * _promised_nm_a(rows[:, 2], rows[:, 3])
    if not means.std(axis=0).all():
        return Passed()
    correlation = float(np.corrcoef(means.T)[0, 1])
    slope = correlation * float(means[:, 1].std() / means[:, 0].std())
    limit = min(options["correlation"] * math.sqrt(BLOCKS / blocks), MOST)
    limit = MOST if drive and not promised else limit
    if correlation < -limit and slope < -least:
        raise CaptureError(
            "torque_sign",
            f"torque_shaft_nm falls as iq_a grows (correlation {correlation:.2f})",
            "turn the sign of the torque or of the currents in conf/source: positive torque drives "
            "positive rotation, currents are positive into the motor",
        )
    return Passed()


def _without_drift(means: Array) -> Array:
    """Columns [n, k] less their least-squares parabola in time."""
    time = np.vander(np.linspace(-1.0, 1.0, means.shape[0]), 3)
    return means - time @ np.linalg.lstsq(time, means, rcond=None)[0]


def _promised_nm_a(vq_v: Array, omega_rad_s: Array) -> float:
    """Torque per ampere [N·m/A] by the voltage in the faster half of the speeds; inf at rest."""
    speed = np.abs(omega_rad_s)
    fast = speed > 0.5 * speed.max()
    return float(np.abs(np.median(1.5 * vq_v[fast] / omega_rad_s[fast]))) if fast.any() else np.inf


GATE = Gate(
    "torque_sign",
    ("torque_map", "torque_table", "drive"),
    check,
    {
        # A healthy map correlates near +1; -0.5 over 100 blocks is five standard deviations from 0.
        "correlation": 0.5,
        # In sound logs under load it rises by a third and more of what follows from the voltage.
        "least_share": 0.2,
    },
)
