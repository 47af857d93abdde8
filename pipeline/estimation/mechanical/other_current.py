"""A current that was recorded as that along q, and is not, or not all of what makes the torque."""

from __future__ import annotations

import numpy as np

from pipeline.estimation.policy import policy
from pipeline.records.capture import Array

LOG_D = (
    "torque follows the recorded current to {:.0f} % only, as of a current that is not all along "
    "q: log id_a and iq_a"
)


def reluctance_counts(id_a: Array, iq_a: Array) -> bool:
    """Whether the reluctance torque of a d current is a column of its own beside the magnet's.

    A d current that stays where it is makes as much of it as one that moves: without its column it
    would be torque of the magnet.

    Parameters
    ----------
    id_a, iq_a : array [n], A
        Rotor-frame currents.

    """
    span = 2.0 * np.max(np.abs(id_a), initial=0.0)
    return bool(span > policy().aligned.least_d_share * np.ptp(iq_a))


def unlogged_share(residuals_nm: Array, magnet_nm: Array) -> float:
    """Relative standard uncertainty of Kt where no d current was logged.

    Parameters
    ----------
    residuals_nm : array [n], N·m
        Torque that follows the recorded current by no curve.
    magnet_nm : array [n], N·m
        Kt i_q of the same rows.

    Returns
    -------
    float, 1
        The policy's, or what torque scatters by over the current's if that is more. Such torque is
        of a current along d, or of a length of the current in place of its part along q, as meters
        of rms currents give it. All rows alike may be off by as much as they scatter.

    """
    made = float(np.mean(magnet_nm**2))
    scatter = float(np.sqrt(np.mean(residuals_nm**2) / made)) if made > 0.0 else 0.0
    return max(policy().torque_map.unlogged_d_share, scatter)


def not_along_q(share: float) -> str:
    """Why a share of `unlogged_share` leaves no torque constant; empty where it does leave one.

    Parameters
    ----------
    share : float, 1
        Scatter of torque over that of the recorded current.

    """
    return LOG_D.format(100.0 * share) if share > policy().torque_map.other_current_share else ""
