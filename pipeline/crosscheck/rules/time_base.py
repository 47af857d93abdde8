"""The time base of a recording against the clock that the bench's own speed goes by."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline.crosscheck.judge import Ratio, judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.numerics.integrals import longest_step_s
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "time_base"
TESTS = ("spin_down", "drive", "open_circuit", "torque_map", "cogging", "hand_turn")
COLUMNS = ("t_s", "theta_mech_rad", "omega_mech_rad_s")
# Blocks that a capture is cut into, and rows that each needs. By judgement: their scatter gives u.
BLOCKS, LEAST_ROWS = 40, 4
NAMED = 3
MISSING = "needs a turning capture with t_s, theta_mech_rad and omega_mech_rad_s"


class Pace(NamedTuple):
    """Recorded time over the time of the speed's own clock, of one capture, with its u."""

    path: str
    ratio: float
    u: float

    def beyond(self, allowance: float) -> float:
        """Deviation from 1 over the largest one that passes.

        Parameters
        ----------
        allowance
            Share that the scale of a speed may be off by [1].

        """
        return abs(self.ratio - 1.0) / (allowance + 2.0 * self.u)


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The integral of the recorded speed over the recorded angle, of every turning capture.

    Notes
    -----
    An angle knows no clock. A drive or dynamometer divides it by its own one to get a speed; over
    the recorder's time that speed gives the angle back if both clocks agree. The worst capture
    counts, for inertia goes with the square of the time. Options: `allowance` [1], a share that a
    speed's own scale may be off by; `turns` [1], the least travel.

    """
    paces = [p for c in campaign.of(*TESTS) if (p := pace(c, options["turns"])) is not None]
    if not paces:
        return not_evaluated(NAME, MISSING)
    allowance = options["allowance"]
    worst = max(paces, key=lambda p: (p.beyond(allowance), p.path))
    off = [p.path for p in paces if p.beyond(allowance) > 1.0]
    more = f" and {len(off) - NAMED} more" if len(off) > NAMED else ""
    files = ", ".join(off[:NAMED]) + more
    return judge_ratio(
        NAME,
        Ratio(worst.ratio, worst.u, BLOCKS - 3.0),
        allowance,
        f"speed integrated over the recorded time, over the angle, in {worst.path}",
        "count",
        None,
        f"the clock t_s of {files}, or the scale of its omega_mech_rad_s: record a speed that a "
        "second clock knows",
    )


def pace(capture: Capture, turns: float) -> Pace | None:
    """How fast a capture's clock runs beside that of its speed.

    Parameters
    ----------
    capture
        With the angle, a speed of its own, and time.
    turns
        Least travel, forth and back added up [turns].

    Returns
    -------
    Pace or None
        None where a column is missing, or the capture is too short or turns too little.

    Notes
    -----
    A tracking observer of second order, ω'' + 2ζn ω' + n² ω = n² r θ', integrates to ∫ω dt = r Δθ −
    (2ζ/n) Δω − (1/n²) Δω'; a low-pass of first order to the same without its last term. Increments
    over blocks give r by least squares. Both clocks' own uncertainty is in u.

    References
    ----------
    JCGM 100:2008 (GUM), H.3 (uncertainty of a straight line).
    Harnefors and Nee, IEEE Trans. Ind. Electron. 47, 2000, 77, doi:10.1109/41.824128 (observer).

    """
    if not capture.has(*COLUMNS):
        return None
    rows = np.column_stack(list(capture.finite(*COLUMNS).values()))
    if rows.shape[0] < BLOCKS * LEAST_ROWS:
        return None
    blocks = _increments(rows, capture.meta.pause_s)
    if np.abs(blocks[:, 1]).sum() < turns * TURN_RAD:
        return None
    line, u = _line(blocks)
    clocks = math.sqrt(2.0) * capture.meta.instrument_u("u_rel_clock")
    return Pace(capture.path, line, math.hypot(u, clocks))


def _increments(rows: Array, pause_s: float | None = None) -> Array:
    """Increments [K, 4] of the integrated speed [rad], the angle [rad], the speed [rad/s] and the
    acceleration [rad/s²], over blocks of rows [n, 3]: time, angle, speed. What happened while rows
    are missing is in none.
    """
    t_s, theta, omega = rows.T
    turned = 0.5 * (omega[1:] + omega[:-1]) * np.diff(t_s)
    rates = np.gradient(omega, t_s)
    steps = np.column_stack([turned, np.diff(theta), np.diff(omega), np.diff(rates)])
    steps[np.diff(t_s) > longest_step_s(t_s, pause_s)] = 0.0
    along = np.vstack([np.zeros(4), np.cumsum(steps, axis=0)])
    edges = np.linspace(0, t_s.size - 1, BLOCKS + 1).round().astype(np.int64)
    return np.diff(along[edges], axis=0)


def _line(blocks: Array) -> tuple[float, float]:
    """Ratio r of integrated speed to angle, and its standard uncertainty by the blocks' scatter."""
    scale = np.maximum(np.abs(blocks).max(axis=0), 1e-300)
    y, x = blocks[:, 0] / scale[0], blocks[:, 1:] / scale[1:]
    inverse = np.linalg.pinv(x.T @ x, rcond=1e-10)
    coefficients = inverse @ (x.T @ y)
    scatter = y - x @ coefficients
    variance = float(scatter @ scatter) / (y.size - x.shape[1]) * inverse[0, 0]
    unit = float(scale[0] / scale[1])
    return float(coefficients[0]) * unit, math.sqrt(max(variance, 0.0)) * unit


RULE = Rule(
    NAME,
    check,
    {
        # A share that a speed's own scale may be off by: of an encoder counted by a clock nothing,
        # of a tachometer's calibration some tenths of a percent. J is then off by twice that.
        "allowance": 0.002,
        # Below some turns an encoder off its centre is a large part of the angle.
        "turns": 3.0,
    },
    tests=TESTS,
)
