"""The cogging torque of a side's motors over one turn, and its orders beside each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pipeline.lots.sample import Member
from pipeline.lots.traits import NO_COGGING, SPECTRUM
from pipeline.records.capture import Array
from pipeline.records.estimate import Order
from pipeline.records.lot_constant import Side
from pipeline.records.lot_regression import CoggingBand, OrderLevel

POINTS_A_PERIOD = 24
MOST_POINTS = 2049
MOST_ORDERS = 12


def spectra_of(members: Iterable[Member], side: Side) -> list[tuple[Order, ...]]:
    """The cogging orders of each motor of a side.

    Parameters
    ----------
    members
        Datasheets.
    side
        `baseline` or `candidate`.

    Returns
    -------
    list of tuple of Order
        One a motor that was tested for cogging; an empty tuple where none was found.

    """
    spectra = []
    for member in members:
        estimate = member.sheet.constants.get(SPECTRUM)
        if member.side != side or estimate is None:
            continue
        if estimate.orders or estimate.note.startswith(NO_COGGING):
            spectra.append(estimate.orders)
    return spectra


def order_levels(members: Sequence[Member]) -> tuple[OrderLevel, ...]:
    """Amplitude of each of the largest orders, by side.

    Parameters
    ----------
    members
        Datasheets of both sides.

    Returns
    -------
    tuple of OrderLevel
        Mean and standard deviation over the motors tested [N·m], those that lack the order counted
        as 0; at most `MOST_ORDERS` orders.

    """
    levels = []
    sides: tuple[Side, ...] = ("baseline", "candidate")
    spectra = {side: spectra_of(members, side) for side in sides}
    for order in _largest([*spectra["baseline"], *spectra["candidate"]]):
        for side, of_side in spectra.items():
            if not of_side:
                continue
            sizes = [sum(o.amplitude for o in orders if o.order == order) for orders in of_side]
            levels.append(
                OrderLevel(
                    side,
                    order,
                    float(np.mean(sizes)),
                    float(np.std(sizes, ddof=1)) if len(sizes) > 1 else None,
                    sum(size > 0.0 for size in sizes),
                    len(sizes),
                )
            )
    return tuple(levels)


def _largest(spectra: Sequence[tuple[Order, ...]]) -> list[int]:
    """The orders that are largest anywhere, rising."""
    size: dict[int, float] = {}
    for orders in spectra:
        for one in orders:
            size[one.order] = max(size.get(one.order, 0.0), one.amplitude)
    return sorted(sorted(size, key=lambda order: (-size[order], order))[:MOST_ORDERS])


def cogging_bands(members: Sequence[Member]) -> tuple[CoggingBand, ...]:
    """Mean cogging wave of each side over one turn, and its spread between motors.

    Parameters
    ----------
    members
        Datasheets of both sides.

    Returns
    -------
    tuple of CoggingBand
        Mean ± one standard deviation [N·m] over [rad]; empty where no motor has an order.

    Notes
    -----
    The encoder's zero is arbitrary: every motor is turned to where a crest of its leading order
    lies at zero, and among the crests to the one that puts its next largest order nearest to its
    own crest.

    """
    bands = []
    sides: tuple[Side, ...] = ("baseline", "candidate")
    spectra = {side: [s for s in spectra_of(members, side) if s] for side in sides}
    highest = max(_largest([s for of_side in spectra.values() for s in of_side]), default=0)
    if highest == 0:
        return ()
    points = min(POINTS_A_PERIOD * highest + 1, MOST_POINTS)
    theta = np.linspace(0.0, 2.0 * math.pi, points)
    for side, of_side in spectra.items():
        if not of_side:
            continue
        waves = np.array([_wave(orders, theta) for orders in of_side])
        mean = waves.mean(axis=0)
        spread = waves.std(axis=0, ddof=1) if len(of_side) > 1 else np.zeros(points)
        bands.append(
            CoggingBand(
                side,
                len(of_side),
                tuple(theta.tolist()),
                tuple(mean.tolist()),
                tuple((mean - spread).tolist()),
                tuple((mean + spread).tolist()),
            )
        )
    return tuple(bands)


def _wave(orders: Sequence[Order], theta: Array) -> Array:
    by_size = sorted(orders, key=lambda one: (-one.amplitude, one.order))
    lead = by_size[0]
    crests = (2.0 * math.pi * np.arange(lead.order) - lead.phase_rad) / lead.order
    zero = float(crests[0])
    if len(by_size) > 1:
        second = by_size[1]
        zero = float(
            crests[np.argmax(np.round(np.cos(second.order * crests + second.phase_rad), 9))]
        )
    wave: Array = np.zeros(theta.size)
    for one in orders:
        wave += one.amplitude * np.cos(one.order * (theta + zero) + one.phase_rad)
    return wave
