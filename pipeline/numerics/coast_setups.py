"""Whether coasts of several files are of one set-up: the same things turn with the shaft.

A chain, a belt or a flywheel that is on in one file and off in the next is another inertia and
another drag. A mean of the two is the drag of neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.numerics.coasting import coasting_rows
from pipeline.numerics.shaft_log import shaft_log
from pipeline.numerics.weak_rows import LEAST_SAMPLES, smooth_speed
from pipeline.records.capture import Array, Capture

REMEDY = (
    "give each set-up a motor_id of its own (`per_file` in a source map, or manifest.csv), or "
    "leave the files of the others out"
)


@dataclass(frozen=True, slots=True)
class Limits:
    """When two coasts are compared, and how much their decelerations may differ [1].

    Attributes
    ----------
    share
        Difference over the mean.
    top
        Of the lower top speed, from which on they are compared.
    least
        Of the speed that they have to have in common.

    """

    share: float
    top: float
    least: float


@dataclass(frozen=True, slots=True)
class Fall:
    """One coast.

    Attributes
    ----------
    sense
        Sense of rotation, +1 or −1.
    t_s
        Instants [n, s].
    speed_rad_s
        Speed in that sense [n, rad/s].

    """

    sense: int
    t_s: Array
    speed_rad_s: Array

    def deceleration(self, high_rad_s: float, low_rad_s: float) -> float:
        """Mean deceleration from one speed to a lower one.

        Parameters
        ----------
        high_rad_s
            Speed at the beginning, in the sense of the coast.
        low_rad_s
            Speed at the end.

        Returns
        -------
        float
            Speed difference over time difference [rad/s²].

        """
        ends = [float(self.t_s[np.argmax(self.speed_rad_s <= s)]) for s in (high_rad_s, low_rad_s)]
        return (high_rad_s - low_rad_s) / max(ends[1] - ends[0], 1e-300)


@dataclass(frozen=True, slots=True)
class Setup:
    """Files of one set-up, and by how much faster they slow down than those of the first [1]."""

    captures: tuple[Capture, ...]
    ratio: float = 1.0


def coast_setups(captures: Sequence[Capture], limits: Limits) -> tuple[Setup, ...]:
    """The files of coasts, grouped where they slow down too differently to be of one set-up.

    Parameters
    ----------
    captures
        Coasts, with an angle or a speed.
    limits
        A policy's.

    Returns
    -------
    tuple of Setup
        In the order of the files; one where all go together. A file without a coast is in none.

    Notes
    -----
    Two coasts of one sense are held against each other over the upper and the lower half of the
    speeds that both go through. Their mean decelerations may differ by `share` of their mean.
    A file joins the first set-up that none of its coasts contradicts.

    """
    groups: list[list[tuple[Capture, list[Fall]]]] = []
    ratios: list[float] = []
    for capture in captures:
        falls = _falls(capture)
        if not falls:
            continue
        fitting = (g for g in groups if not any(_differ(falls, others, limits) for _, others in g))
        group = next(fitting, None)
        if group is not None:
            group.append((capture, falls))
            continue
        ratios.append(float(np.median(_ratios(falls, groups[0][0][1], limits))) if groups else 1.0)
        groups.append([(capture, falls)])
    return tuple(
        Setup(tuple(capture for capture, _ in group), ratio)
        for group, ratio in zip(groups, ratios, strict=True)
    )


def setup_words(setups: Sequence[Setup]) -> str:
    """Which files belong to one set-up, in words.

    Parameters
    ----------
    setups
        At least two.

    """
    named = []
    for setup in setups:
        files = ", ".join(capture.path for capture in setup.captures)
        named.append(files if setup is setups[0] else f"{files} (slow down {setup.ratio:.2g} times "
                     "as fast)")  # fmt: skip
    return f"the coasts are of {len(setups)} set-ups: {' | '.join(named)}"


def _falls(capture: Capture) -> list[Fall]:
    log = shaft_log(capture)
    if log is None or log.t_s.size < 3 * LEAST_SAMPLES or not (np.diff(log.t_s) > 0.0).all():
        return []
    try:
        speed = smooth_speed(log.t_s, log.theta_rad, max(0.01, 20.0 * log.period_s))
    except ValueError:
        return []
    return [Fall(sense, log.t_s[rows], sense * speed[rows]) for rows, sense in coasting_rows(speed)]


def _both(one: Fall, other: Fall, limits: Limits) -> Array | None:
    """Speeds [3, rad/s] that part what both coasts go through in halves; None for too little."""
    if one.sense != other.sense:
        return None
    high = limits.top * min(float(f.speed_rad_s.max()) for f in (one, other))
    low = max(*(float(f.speed_rad_s.min()) for f in (one, other)), (1.0 - limits.top) * high)
    if low > (1.0 - limits.least) * high:
        return None
    return np.linspace(high, low, 3)


def _ratios(falls: Sequence[Fall], others: Sequence[Fall], limits: Limits) -> list[float]:
    """Decelerations of coasts over those of others, of all halves that can be compared."""
    ratios = []
    for one in falls:
        for other in others:
            speeds = _both(one, other, limits)
            for high, low in pairwise([] if speeds is None else speeds):
                ratios.append(one.deceleration(high, low) / other.deceleration(high, low))
    return ratios


def _differ(falls: Sequence[Fall], others: Sequence[Fall], limits: Limits) -> bool:
    share = limits.share
    return any(abs(r - 1.0) > share * 0.5 * (r + 1.0) for r in _ratios(falls, others, limits))
