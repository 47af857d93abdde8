"""Viscous drag that a current seems to make that is not sampled in the middle of its pulse."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipeline.estimation.policy import policy
from pipeline.records.capture import Capture
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Contribution


def in_step(captures: Iterable[Capture]) -> bool:
    """Whether some log of a current is in step with an inverter's pulses.

    Parameters
    ----------
    captures
        Those with currents, coasts among them.

    """
    metas = [capture.meta for capture in captures]
    return any(m.voltage_kind == "commanded" or m.voltage_timing == "held" for m in metas)


def sampling_drag(
    captures: Sequence[Capture], kt_nm_a: float, known: Constants
) -> tuple[Contribution, ...]:
    """Contribution to viscous friction of torque under a drive's own current.

    Parameters
    ----------
    captures
        Those with currents.
    kt_nm_a
        Torque constant K [N·m/A].
    known
        With `lq_h`.

    Returns
    -------
    tuple of Contribution
        Empty where no log is in step with an inverter, or its inductance is not known.

    Notes
    -----
    A drive samples once a period, in the middle of its pulses as they are commanded. A dead time
    moves them, and over the time τ between the current goes on by p ω ψ τ/L_q. With K = 1.5 p ψ
    that is a torque (K²/(1.5 L_q)) τ ω, whether the voltages of the log are commanded or measured:
    a log of held voltages is in step with the inverter as well. Of coasts none is needed: they
    show drag without current.

    """
    inductance = known.best("lq_h")
    if inductance is None or not in_step(captures):
        return ()
    per_second = kt_nm_a**2 / (1.5 * inductance.number)
    u = per_second * policy().drag.sampling_u_s
    return (Contribution("assumed:sampled_current", u, "B"),)
