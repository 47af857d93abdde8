"""Whether coasts are of one set-up, and of that of the drives, by the policy of coast-downs."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.estimation.policy import policy
from pipeline.numerics.coast_setups import Limits, Setup, coast_setups
from pipeline.records.capture import Capture
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import propagate, standard_uncertainty

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
        Empty where both may be one: the dry drag or that at half speed differs by no more than
        `setup_share`, or both by no more than `setup_u`.

    Notes
    -----
    An inertia that one of them lacks scales all of the drag. A drive that hardly parts dry from
    viscous friction still knows their sum; one whose current is of samples, or whose drag at speed
    is unsure for another reason, the dry part.

    A transducer between motor and dynamometer leaves the inertia of the rotor to the drives, while
    a shaft that coasts may carry the dynamometer as well.

    """
    if not all(e.known for e in (*with_coasts, *alone)):
        return ""
    speeds = (0.5 * float(with_coasts[0].at["omega_mech_rad_s"]), 0.0)
    ratios, sizes, sigmas = zip(*(_apart(with_coasts, alone, one) for one in speeds), strict=True)
    limits = policy().coast_down
    apart = min(sizes) > limits.setup_share and max(sigmas) > limits.setup_u
    return _OTHER.format(ratios[0]) if apart else ""


def _apart(
    with_coasts: Sequence[Estimate], alone: Sequence[Estimate], speed_rad_s: float
) -> tuple[float, float, float]:
    """Ratio of the drags at a speed, their difference over their mean, and over its u."""
    terms = [((1.0, c), (speed_rad_s, b)) for _, c, b in (with_coasts, alone)]
    one, other = (sum(factor * e.number for factor, e in pair) for pair in terms)
    u = sum(standard_uncertainty(propagate([(f, e.budget) for f, e in pair])) for pair in terms)
    difference = abs(one - other)
    return one / other, 2.0 * difference / abs(one + other), difference / u
