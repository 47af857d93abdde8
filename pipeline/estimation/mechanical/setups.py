"""Whether coasts are of one set-up, by the policy of coast-downs."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.estimation.policy import policy
from pipeline.numerics.coast_setups import Limits, Setup, coast_setups
from pipeline.records.capture import Capture


def setups_of(captures: Sequence[Capture]) -> tuple[Setup, ...]:
    """The set-ups of coasts, whose decelerations have nothing in common.

    Parameters
    ----------
    captures
        Coasts of one motor.

    Returns
    -------
    tuple of Setup
        Their files; one for coasts that all go together.

    """
    limits = policy().coast_down
    return coast_setups(captures, Limits(limits.setup_share, limits.setup_top, limits.setup_least))
