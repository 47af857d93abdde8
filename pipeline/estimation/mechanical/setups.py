"""Whether coasts are of one set-up, and of that of the drives, by the policy of coast-downs."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.estimation.policy import policy
from pipeline.numerics.coast_setups import Limits, Setup, coast_setups
from pipeline.records.capture import Capture
from pipeline.records.estimate import Estimate

_OTHER = (
    "by the coasts the drag would be {:.3g} times that of the drives: they turn something else "
    "beside the rotor, such as a dynamometer left coupled, and are not used; record a spin_down of "
    "the motor alone"
)


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


def another_setup(with_coasts: Sequence[Estimate], alone: Sequence[Estimate]) -> str:
    """Why coasts are not of the set-up of drives with a transducer.

    Parameters
    ----------
    with_coasts
        J, T_c and B by the coasts' drag over inertia and the drives' inertia.
    alone
        The same by the drives alone.

    Returns
    -------
    str
        Empty where both may be one: the drag at half speed differs by no more than `setup_share`
        or `setup_u`.

    Notes
    -----
    A transducer between motor and dynamometer leaves the inertia of the rotor to the drives, while
    a shaft that coasts may carry the dynamometer as well.

    """
    if not all(e.known for e in (*with_coasts, *alone)):
        return ""
    half = 0.5 * float(with_coasts[0].at["omega_mech_rad_s"])
    drags = [c.number + half * b.number for _, c, b in (with_coasts, alone)]
    u = sum(c.u + half * b.u for _, c, b in (with_coasts, alone))
    limits, difference = policy().coast_down, abs(drags[0] - drags[1])
    apart = difference > limits.setup_share * 0.5 * abs(drags[0] + drags[1])
    return _OTHER.format(drags[0] / drags[1]) if apart and difference > limits.setup_u * u else ""
