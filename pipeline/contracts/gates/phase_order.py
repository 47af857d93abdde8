"""Swapped phases: back-EMF or line currents turn against the shaft."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed
from pipeline.contracts.requirements import LINE_CURRENTS
from pipeline.contracts.rotation import line_current_vector, turning
from pipeline.records.capture import Array, Capture
from pipeline.records.errors import CaptureError

CODE = "swapped_phases"
REMEDY = "swap two phases, or turn the sign of the angle and the speed, in conf/source"
CURRENTS_REMEDY = "swap two of the line currents, or look for one of the wrong sign, in conf/source"
FREE_TURNING = ("open_circuit", "hand_turn")
BLOCKS = 100
SMALL = 0.05
CONDITION = 1e3


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses where line voltages, line currents or v_q oppose the shaft's sense of rotation.

    Notes
    -----
    Turned by hand or with open terminals: electrical cycles a turn below −`sigmas` of their
    standard uncertainty, over at least `cycles` cycles. Under load: the slope of v_q on speed below
    −`sigmas` of its own (`back_emf_slope`), or line currents that turn −p times a turn within
    `off_count` [1, relative to the nameplate's p]; currents whose mean is above `common` [1] of
    them hold another fault, which `phase_sum` names.

    """
    if capture.meta.test in FREE_TURNING:
        turned = turning(capture)
        opposed = (
            turned is not None
            and turned.cycles >= options["cycles"]
            and turned.cycles_per_turn < -options["sigmas"] * turned.u
        )
        if turned is not None and opposed:
            raise CaptureError(
                CODE,
                f"the line voltages turn c-b-a where the shaft turns forward "
                f"({turned.cycles_per_turn:.2f} cycles a turn)",
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
    _refuse_opposed_currents(capture, options)
    return Passed()


def _refuse_opposed_currents(capture: Capture, options: Mapping[str, float]) -> None:
    """Refuses line currents that turn minus pole pairs times a turn.

    The nameplate's count is needed: sampled too slowly, currents seem to turn backward, but then
    at another rate. Three that do not sum to zero hold another fault, which the gate `phase_sum`
    names.
    """
    stated = capture.meta.pole_pairs
    if stated is None or _common_share(capture) > options["common"]:
        return
    turned = turning(capture, line_current_vector)
    if turned is None or turned.cycles < options["cycles"]:
        return
    if abs(turned.cycles_per_turn + stated) < options["off_count"] * stated:
        raise CaptureError(
            CODE,
            f"the line currents turn c-b-a where the shaft turns forward "
            f"({turned.cycles_per_turn:.2f} cycles a turn)",
            CURRENTS_REMEDY,
        )


def _common_share(capture: Capture) -> float:
    """Mean of the three line currents over one of them (rms); 0 where not all three are there."""
    if not capture.has(*LINE_CURRENTS):
        return 0.0
    currents = np.column_stack(list(capture.finite(*LINE_CURRENTS).values()))
    size = float(np.sqrt(np.mean(currents**2))) if currents.size else 0.0
    if size == 0.0:
        return 0.0
    return float(np.sqrt(np.mean(currents.mean(axis=1) ** 2))) / size


def back_emf_slope(capture: Capture) -> tuple[float, float]:
    """Slope of v_q on speed at no d current, and its standard error.

    Parameters
    ----------
    capture
        With v_q, speed and q current; d current where there.

    Returns
    -------
    slope, u
        [V·s/rad]; (0, inf) where a column is missing, the shaft hardly turns, or a steady d current
        may cancel the magnet.

    Notes
    -----
    v_q = R i_q + p ω (ψ + L_d i_d), regressed over `BLOCKS` block means on ω, i_q and, where i_d
    varies, ω i_d: the slope is p ψ, positive where phases and angle are right.

    """
    names = [n for n in ("vq_v", "omega_mech_rad_s", "iq_a", "id_a") if capture.has(n)]
    if names[:3] != ["vq_v", "omega_mech_rad_s", "iq_a"]:
        return 0.0, np.inf
    means = _block_means(capture, names)
    if means is None:
        return 0.0, np.inf
    y, x = means[:, 0], means[:, 1:3]
    if len(names) == 4:
        d_current = means[:, 3]
        small = SMALL * float(np.abs(means[:, 2:4]).max())
        if float(np.ptp(d_current)) > small:
            x = np.column_stack([x, x[:, 0] * d_current])
        elif float(np.abs(d_current).max()) > small:
            return 0.0, np.inf
    return _first_slope(x, y)


def _block_means(capture: Capture, names: list[str]) -> Array | None:
    rows = np.column_stack(list(capture.finite(*names).values()))
    size = rows.shape[0] // BLOCKS
    if size == 0:
        return None
    return rows[: size * BLOCKS].reshape(BLOCKS, size, len(names)).mean(axis=1)


def _first_slope(x: Array, y: Array) -> tuple[float, float]:
    """Least-squares coefficient of the first column [n, m] and its standard error."""
    scale = np.sqrt(np.mean(x**2, axis=0))
    if not scale.all() or np.linalg.cond(x / scale) > CONDITION:
        return 0.0, np.inf
    normal = (x / scale).T @ (x / scale)
    beta = np.linalg.solve(normal, (x / scale).T @ y)
    residuals = y - (x / scale) @ beta
    variance = residuals @ residuals / (y.size - x.shape[1]) * np.linalg.inv(normal)[0, 0]
    return float(beta[0] / scale[0]), float(np.sqrt(variance) / scale[0])


GATE = Gate(
    "phase_order",
    (*FREE_TURNING, "torque_map", "drive"),
    check,
    {
        # Less than an electrical cycle shows no sense of rotation.
        "cycles": 1.0,
        # Over the blocks' own scatter, which neighbours share: never by chance.
        "sigmas": 5.0,
        # A sensor of the wrong sign makes two thirds; gains and offsets make a few per cent.
        "common": 0.2,
        # A load that pulses turns the currents' vector a little; aliasing hits this by chance only.
        "off_count": 0.1,
    },
    follows=("stuck_channel", "wrapped_angle"),
)
