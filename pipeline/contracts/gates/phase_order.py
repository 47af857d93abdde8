"""Swapped phases: the back-EMF turns against the shaft."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed
from pipeline.contracts.rotation import turning
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "swapped_phases"
REMEDY = "swap two phases, or turn the sign of the angle and the speed, in conf/source"
FREE_TURNING = ("open_circuit", "hand_turn")
BLOCKS = 100


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses where line voltages, or v_q under current, oppose the shaft's sense of rotation."""
    if capture.meta.test in FREE_TURNING:
        seen = turning(capture)
        opposed = (
            seen is not None
            and seen.cycles >= options["cycles"]
            and seen.cycles_per_turn < -options["sigmas"] * seen.u
        )
        if seen is not None and opposed:
            raise CaptureError(
                CODE,
                f"the line voltages turn c-b-a where the shaft turns forward "
                f"({seen.cycles_per_turn:.2f} cycles a turn)",
                REMEDY,
            )
        return Passed()
    slope, u = back_emf_slope(capture)
    if slope < -options["sigmas"] * u:
        raise CaptureError(
            CODE,
            f"v_q falls with speed ({slope:.3g} ± {u:.2g} V·s/rad at equal i_q), "
            "where the magnet's voltage must rise with it",
            REMEDY,
        )
    return Passed()


def back_emf_slope(capture: Capture) -> tuple[float, float]:
    """Slope of v_q on speed [V s/rad] at equal i_q and its standard error, from block means.

    v_q = R i_q + omega_e (L_d i_d + psi): the slope is p (psi + L_d i_d), positive in a motor
    whose phases and angle are right, as long as the magnet is not cancelled. (0, inf) where
    the shaft hardly turns.
    """
    names = ("vq_v", "iq_a", "omega_mech_rad_s")
    if not capture.has(*names):
        return 0.0, np.inf
    data = capture.arrays(*names)
    rows = np.column_stack([data[name] for name in names])
    rows = rows[np.isfinite(rows).all(axis=1)]
    size = rows.shape[0] // BLOCKS
    if size == 0:
        return 0.0, np.inf
    means = rows[: size * BLOCKS].reshape(BLOCKS, size, 3).mean(axis=1)
    x, y = means[:, [2, 1]], means[:, 0]
    normal = x.T @ x
    if (
        np.linalg.cond(normal / np.maximum(np.outer(*(2 * [np.sqrt(np.diag(normal))])), 1e-300))
        > 1e6
    ):
        return 0.0, np.inf
    beta = np.linalg.solve(normal, x.T @ y)
    left = y - x @ beta
    spread = left @ left / (BLOCKS - 2) * np.linalg.inv(normal)
    return float(beta[0]), float(np.sqrt(spread[0, 0]))


GATE = Gate(
    "phase_order",
    (*FREE_TURNING, "torque_map", "drive"),
    check,
    {
        # Less than an electrical cycle shows no sense of rotation.
        "cycles": 1.0,
        # Over the blocks' own scatter, which neighbours share: never by chance.
        "sigmas": 5.0,
    },
)
