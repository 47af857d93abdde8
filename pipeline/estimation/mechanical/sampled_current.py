"""What a current that flows at another instant than its row's makes of inertia and drag."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

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


def lagging_inertia(captures: Sequence[Capture], viscous_nm_s_rad: float) -> Contribution:
    """Contribution to the inertia of currents whose instant within a row is not stated.

    Parameters
    ----------
    captures
        Drives; coasts among them have no current.
    viscous_nm_s_rad
        Viscous friction B [N·m·s/rad].

    Returns
    -------
    Contribution
        Standard uncertainty [kg·m²], the same for all rows.

    Notes
    -----
    A current of the time t - τ shows T - τ dT/dt. With T = J a + T_c sign(ω) + B ω the torque of
    friction changes by B a, so that J - τ B stands for J. A row may be a sample or the mean up to
    its time, and wait for half a row more or less: τ is rectangular within half a row (GUM 4.3.7).

    """
    clocks = [c.arrays("t_s")["t_s"] for c in captures if c.meta.test != "spin_down"]
    row_s = max((float(np.median(np.diff(t_s))) for t_s in clocks if t_s.size > 1), default=0.0)
    u = abs(viscous_nm_s_rad) * row_s / (2.0 * math.sqrt(3.0))
    return Contribution("assumed:current_instant", u, "B")
