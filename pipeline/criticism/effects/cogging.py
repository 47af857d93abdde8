"""Torque of the magnets on the slots."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Effect, Machine, Operating, Parameter, Values

_PHASES = 3


def _torque(x: Operating, q: Values) -> Array:
    drag = np.zeros(x.omega_rad_s.shape)
    for name, value in q.items():
        if value == 0.0:
            continue
        wave, order = name.split("_")[:2]
        cosine, sine = x.shaft_waves(int(order))
        drag += value * (sine if wave == "sin" else cosine)
    return drag


def orders(machine: Machine) -> tuple[int, ...]:
    """Orders a turn that magnets and slots can make, of those that stand out of a slow turn.

    Multiples of p, 2p or the number of slots; LCM(slots, 2p) is always among them, but where it is
    out of all reason (`Machine.cogging_order`), and what no slow turn shows beside it.
    """
    multiples = {k for k in machine.torque_orders if _is_multiple(k, machine)}
    if machine.cogging_order is not None:
        multiples.add(machine.cogging_order)
    every = tuple(sorted(multiples | _unverified_orders(machine))) or (6 * machine.pole_pairs,)
    # of a wave that is not gone through once, a piece looks like any other curve
    return tuple(k for k in every if k * machine.travel_turns >= 1.0) or every[-1:]


def _unverified_orders(machine: Machine) -> set[int]:
    """Orders of which no torque spectrum says whether they are there.

    p and 2p, which magnets or teeth that differ make; the slots, and LCM(slots, 2p) with its
    second harmonic, or where the slots are not known 6p and 12p; and their multiples that logs
    under load show.
    """
    if machine.torque_orders:
        return set()
    p, slots, both = machine.pole_pairs, machine.slots, machine.cogging_order
    usual = {6 * p, 12 * p} if slots is None else {slots}
    usual |= {p, 2 * p} if both is None else {p, 2 * p, both, 2 * both}
    return {int(k) for k in {*usual, *machine.load_orders} if _is_multiple(k, machine)}


def _is_multiple(order: float, machine: Machine) -> bool:
    """Whether an order [1/turn] is a multiple of the pole pairs or the slots; once is unbalance.
    Slots that are not stated are some multiple of the three phases.
    """
    bases = machine.pole_pairs, machine.slots or _PHASES
    return order > 1 and any(order % base == 0 for base in bases)


def _expand(machine: Machine) -> tuple[Parameter, ...]:
    terms = {order: n for n, order in enumerate(sorted(_unverified_orders(machine)), 1)}
    return tuple(
        Parameter(
            f"{wave}_{order}_nm",
            "N·m",
            0.01,
            0.0002,
            "torque_nm",
            -1.0,
            1.0,
            optional=terms.get(order, 0),
            order=order,
        )
        for order in orders(machine)
        for wave in ("sin", "cos")
    )


EFFECT = Effect(
    name="cogging",
    words="Σ over orders k of a_k sin kθ + b_k cos kθ, k multiples of p or of the slots",
    signature="zero-current torque against angle, orders LCM(slots, 2p) and multiples of p, slots",
    tests=("cogging", "holding_current"),
    experiment="a slow turn without current, in both senses",
    headline="cogging torque of {largest}",
    reference="Zhu & Howe, IEEE Trans. Energy Convers. 15 (2000), cogging torque",
    expand=_expand,
    signals=("theta_mech_rad",),
    alternatives={
        "bemf_harmonics": "a slow turn without current",
        "unbalance": "order 1 is no cogging",
    },
    torque=_torque,
)
