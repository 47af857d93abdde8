"""The equation of motion as weak-form rows: what drives, coast-downs and their sensors say of J.

One row a window: A = g (K i_q + K_rel i_d i_q - T_load) - a_0 sign(w) - a_1 w - ..., with A the
angular acceleration, g = 1/J, a_0 = T_c/J, a_1 = B/J. No derivative is taken: A and w are integrals
of the angle against derivatives of the window.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import assumed_temperature
from pipeline.estimation.electrical.ripple_torque import Winding, ripple_by_speed
from pipeline.estimation.mechanical.shaft_nuisances import (
    BY_SENSE,
    COAST_LOAD,
    CURRENT_LAG,
    CURVATURE,
    JUMPS,
    LATE_CURRENT,
    LATE_LOAD,
    LOAD_BETWEEN,
    OFFSET,
    RELUCTANCE,
    SAMPLED,
)
from pipeline.estimation.policy import policy
from pipeline.numerics.coasting import coasting_rows
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.jumps import jumps, speed_jumps
from pipeline.numerics.plateaus import noise_about_cubics
from pipeline.numerics.shaft_log import SPEED, motion_column
from pipeline.numerics.weak_rows import LEAST_SAMPLES, WeakRows, smooth_speed, weak_rows
from pipeline.records.capture import Array, Capture, Flags, Indices
from pipeline.records.row_means import slower_rows

DRIVE, COAST = 0, 1
ACCELERATION_NOISE, CURRENT_NOISE = "acceleration noise", "current noise"
"""Columns of a window's noise [rad/s², A], for fits that have these signals among their columns."""
SpeedFunction = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class ShaftRows:
    """Rows of the equation of motion of several captures; every array is [w].

    Attributes
    ----------
    captures, capture
        The captures, and the index of each row's capture.
    kind
        `DRIVE` or `COAST`.
    cluster
        Rows of one number are near in time, and may be correlated.
    time_s
        Mid time of the window.
    acceleration_rad_s2, speed_rad_s
        Window means of angular acceleration and of signed speed.
    q_current_a, warm_current_k_a, product_a2
        Window means of i_q, of i_q (T_m − 25 degC), and of i_d i_q.
    load_nm
        Window mean of the shaft torque.
    ripple_nm, u_ripple_nm
        Torque that harmonics of the currents make beside their means (`ripple_torque`), and its
        standard uncertainty; 0 where it is not known.
    sense
        Window mean of the sign of the speed.
    columns
        What a nuisance adds to the acceleration, per unit of its coefficient.
    fastest_rad_s
        Highest speed of any capture.
    dropped
        Windows that were left out.

    """

    captures: tuple[Capture, ...]
    capture: Indices
    kind: Indices
    cluster: Indices
    time_s: Array
    acceleration_rad_s2: Array
    q_current_a: Array
    warm_current_k_a: Array
    product_a2: Array
    load_nm: Array
    ripple_nm: Array
    u_ripple_nm: Array
    speed_rad_s: Array
    sense: Array
    columns: Mapping[str, Array]
    fastest_rad_s: float
    dropped: int

    @property
    def by_angle(self) -> bool:
        """Whether the motion of every drive is an angle, and no speed of the bench's own."""
        return all(c.has("theta_mech_rad") for c in self.captures if c.meta.test == "drive")

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.sense.size)

    def kinds(self) -> list[Flags]:
        """Rows [w] of the drives and of the coast-downs, of those that there are."""
        return [rows for rows in (self.kind == DRIVE, self.kind == COAST) if np.any(rows)]

    def disjoint(self, kind: int) -> int:
        """How many windows of a kind share no sample with another.

        Parameters
        ----------
        kind
            `DRIVE` or `COAST`.

        Returns
        -------
        int
            Number of windows that count as independent.

        """
        return math.ceil(np.count_nonzero(self.kind == kind) * (1.0 - policy().shaft_rows.overlap))


@dataclass(frozen=True, slots=True)
class _Part:
    """One capture on its own clock, with its windows."""

    capture: Capture
    kind: int
    weak: WeakRows
    theta: Array
    speed: Array
    current: Array
    direct: Array
    warm: Array
    load: Array
    between: Array
    ripple: tuple[Array, Array]
    hidden: Flags


def shaft_rows(
    captures: Sequence[Capture],
    speed_functions: Mapping[str, SpeedFunction],
    cogging_orders: Sequence[int] = (),
    ripple_orders: Sequence[int] = (),
    winding: Winding | None = None,
) -> ShaftRows | None:
    """Rows of drive and spin_down captures, or None where none can be made.

    `speed_functions` are functions of speed over the fastest, f(w / w_max) [n], whose window
    means become columns. `cogging_orders` and `ripple_orders` [per mechanical turn] make columns of
    torque against angle, the latter in proportion to q current.
    Windows in which the shaft all but stands (friction undetermined), and those of a coast-down in
    which it is still being driven or held at its speed, are dropped and counted.

    Parameters
    ----------
    captures
        Drives and coast-downs.
    speed_functions
        By name: f(ω/ω_max) [n] of [n].
    cogging_orders, ripple_orders
        Orders a mechanical turn.
    winding
        For the torque of ripple; None where not known.

    Returns
    -------
    ShaftRows or None
        Window means; None where no window is left.

    """
    parts = [part for part in (_part(c, winding) for c in captures) if part is not None]
    if not parts:
        return None
    fastest = max(float(np.max(np.abs(part.speed))) for part in parts)
    pieces = [
        _rows(i, part, fastest, speed_functions, cogging_orders, ripple_orders)
        for i, part in enumerate(parts)
    ]
    joined = {name: np.concatenate([piece[name] for piece, _ in pieces]) for name in pieces[0][0]}
    own: dict[str, Any] = {
        field.name: joined.pop(field.name) for field in fields(ShaftRows) if field.name in joined
    }
    rows = ShaftRows(
        captures=tuple(part.capture for part in parts),
        columns=joined,
        fastest_rad_s=fastest,
        dropped=sum(dropped for _, dropped in pieces),
        **own,
    )
    return rows if rows.count else None


def _part(capture: Capture, winding: Winding | None) -> _Part | None:
    kind = COAST if capture.meta.test == "spin_down" else DRIVE
    angle = motion_column(capture)
    if not capture.has("t_s", angle) or (kind == DRIVE and not capture.has("iq_a")):
        return None
    required = ["t_s", angle]
    optional = ["iq_a", "id_a", "torque_shaft_nm", "temp_magnet_degc"] if kind == DRIVE else []
    columns = capture.arrays(*required, *(name for name in optional if capture.has(name)))
    zero = np.zeros(columns["t_s"].size)
    columns = {name: columns.get(name, zero) for name in (*required, *optional)}
    if kind == DRIVE and not capture.has("temp_magnet_degc"):
        columns["temp_magnet_degc"] = zero + assumed_temperature(capture)
    finite = np.all([np.isfinite(column) for column in columns.values()], axis=0)
    columns = {name: column[finite] for name, column in columns.items()}
    t, theta = columns["t_s"], columns[angle]
    if t.size < LEAST_SAMPLES:
        return None
    if angle == SPEED:
        theta = trapezoid(t, theta)
    try:
        weak = _windows(t, theta, kind)
        speed = smooth_speed(t, theta, max(0.005, 10.0 * float(np.median(np.diff(t)))))
    except ValueError:
        return None
    current = columns.get("iq_a", np.zeros(t.size))
    return _Part(
        capture, kind, weak, theta, speed, current, columns.get("id_a", current * 0.0),
        columns.get("temp_magnet_degc", current * 0.0 + 25.0) - 25.0,
        columns.get("torque_shaft_nm", current * 0.0), between_samples(capture, t, current),
        _ripple(capture, winding, weak.integral(theta, 1)), _hidden(weak, theta, kind),
    )  # fmt: skip


def between_samples(capture: Capture, t_s: Array, current_a: Array) -> Array:
    """Current [n, A] beside the straight line between the instants of a slower load; else 0.

    Parameters
    ----------
    capture
        Of a drive.
    t_s, current_a
        Instants [n, s] of the current's rows, and the current [n, A].

    Notes
    -----
    A load that follows the current is off a straight line between its own samples as the current
    is. Of one that is sampled less than twice a period of the current nothing else is known there.

    """
    if not capture.has("torque_shaft_nm"):
        return np.zeros(t_s.size)
    at = capture.tables[capture.table_of("torque_shaft_nm")]["t_s"].to_numpy()
    if not slower_rows(at, t_s):
        return np.zeros(t_s.size)
    return current_a - np.interp(t_s, at, np.interp(at, t_s, current_a))


def half_row_s(capture: Capture, name: str) -> float:
    """Half of the time [s] between two samples of a column; 0 where it is not there.

    Parameters
    ----------
    capture
        Of a drive or a coast.
    name
        Of the column.

    """
    if not capture.has(name):
        return 0.0
    at = capture.tables[capture.table_of(name)]["t_s"].to_numpy()
    return 0.5 * float(np.median(np.diff(at)))


def _late(names: tuple[str, str], weak: WeakRows, signal: Array, late_s: float) -> dict[str, Array]:
    """Terms of a signal that is late, to first and to second order, in its unit."""
    return {
        names[0]: weak.integral(signal, 1) * late_s,
        names[1]: weak.integral(signal, 2) * late_s**2 / 2.0,
    }


def _hidden(weak: WeakRows, theta: Array, kind: int) -> Flags:
    """Windows [w] of a drive in which the speed jumps: what the current did there is in no row."""
    limits = policy().shaft_rows
    jumping = speed_jumps(theta, limits.jump_share, limits.jump_sigmas, limits.jump_rows)
    found: Flags = weak.integral(jumping.astype(float)) > 0.0
    return found if kind == DRIVE else np.zeros(weak.count, dtype=bool)


def _ripple(capture: Capture, winding: Winding | None, speed: Array) -> tuple[Array, Array]:
    """Torque of ripple at each window's speed [w], and its standard uncertainty [w, N·m].

    Over speed it may be anything from none to twice as much at rest, rectangular (GUM 4.3.7), of
    that at the speed next to a window's at which ripple was seen.
    """
    at, *per_speed = ripple_by_speed(capture, winding)
    if at.size == 0:
        return np.zeros(speed.size), np.zeros(speed.size)
    torque, u = (speed * np.interp(speed, at, column) for column in per_speed)
    near = at[np.abs(speed[:, np.newaxis] - at).argmin(axis=1)]
    apart = np.minimum(np.abs(speed / near - 1.0), 1.0)
    return torque, np.copysign(np.hypot(u, apart * torque / np.sqrt(3.0)), speed)


def _windows(t_s: Array, theta_rad: Array, kind: int) -> WeakRows:
    """Windows of a coast, a share of it; of a drive, the shortest that are quiet."""
    if kind == COAST:
        share = policy().shaft_rows.coast_share * float(t_s[-1] - t_s[0])
        return weak_rows(
            t_s,
            min(
                max(share, policy().shaft_rows.drive_windows_s[0]),
                policy().shaft_rows.longest_coast_window_s,
            ),
            policy().shaft_rows.overlap,
        )
    least_s = (LEAST_SAMPLES + 1) * float(np.median(np.diff(t_s)))
    return quiet_windows(t_s, theta_rad, least_s)[0]


def quiet_windows(t_s: Array, theta_rad: Array, least_s: float) -> tuple[WeakRows, bool]:
    """The shortest windows in which the encoder's noise is a fiftieth of the acceleration.

    Parameters
    ----------
    t_s, theta_rad
        Time [n, s] and angle of the shaft [n, rad].
    least_s
        What the samples that a window needs take [s].

    Returns
    -------
    windows, quiet
        The longest that are tried, and False, where none are quiet.

    """
    sigma, limits = noise_about_cubics(t_s, theta_rad), policy().shaft_rows
    slower = max(1.0, least_s / limits.drive_windows_s[0])
    for usual in limits.drive_windows_s:
        weak = weak_rows(t_s, slower * usual, limits.overlap)
        noise = sigma * weak.noise_gain(2)
        if noise < limits.quiet_share * float(np.std(weak.integral(theta_rad, 2))):
            return weak, True
    return weak, False


def _held(weak: WeakRows, speed: Array) -> Flags:
    """Windows [w] with a row that belongs to no coast."""
    outside = np.ones(speed.size, dtype=bool)
    for rows, _ in coasting_rows(speed):
        outside[rows] = False
    before = np.concatenate([[0], np.cumsum(outside)])
    return before[weak.starts + weak.sizes] > before[weak.starts]


def _undetermined(part: _Part, fastest: float) -> Flags:
    """Windows [w] in which the shaft may stand, in which its speed jumps from row to row, or in
    which a coast-down is no coast yet.
    """
    weak = part.weak
    ends = zip(weak.starts, weak.starts + weak.sizes, strict=True)
    least = np.array([np.min(np.abs(part.speed[a:b])) for a, b in ends])
    slow: Flags = least < policy().shaft_rows.slowest_share * fastest
    slow |= part.hidden
    if part.kind == COAST:
        gaining = weak.integral(part.theta, 2) * weak.integral(part.theta, 1) > 0.0
        slow |= np.convolve(gaining, np.ones(3))[1:-1] > 1.5
        slow |= _held(weak, part.speed)
    return slow


def _rows(
    index: int,
    part: _Part,
    fastest: float,
    speed_functions: Mapping[str, SpeedFunction],
    cogging_orders: Sequence[int],
    ripple_orders: Sequence[int],
) -> tuple[dict[str, Array], int]:
    """Columns of one capture's windows, and how many of these were dropped."""
    weak = part.weak
    columns = {
        "capture": np.full(weak.count, index),
        "kind": np.full(weak.count, part.kind),
        "cluster": weak.clusters(policy().evidence.cluster_s, index),
        "time_s": weak.centres_s,
        "acceleration_rad_s2": weak.integral(part.theta, 2),
        "q_current_a": weak.integral(part.current),
        "warm_current_k_a": weak.integral(part.current * part.warm),
        "product_a2": weak.integral(part.current * part.direct),
        "load_nm": weak.integral(part.load),
        "ripple_nm": part.ripple[0],
        "u_ripple_nm": part.ripple[1],
        "speed_rad_s": weak.integral(part.theta, 1),
        "sense": weak.integral(np.sign(part.speed)),
        **_nuisances(part),
        **_noise(part),
        **_ripples(part, cogging_orders, ripple_orders),
    }
    for name, function in speed_functions.items():
        columns[name] = weak.integral(function(part.speed / fastest))
    slow = _undetermined(part, fastest)
    return {name: column[~slow] for name, column in columns.items()}, int(slow.sum())


def _nuisances(part: _Part) -> dict[str, Array]:
    """What a sensor's fault, saturation or an unbalance adds to the acceleration, per unit."""
    weak = part.weak
    turning = np.exp(1j * part.theta)
    driven = float(part.kind == DRIVE)
    torque = np.abs(part.current) * np.sign(part.speed)
    return {
        OFFSET: np.full(weak.count, driven),
        COAST_LOAD: np.full(weak.count, 1.0 - driven),
        BY_SENSE: weak.integral(np.abs(part.speed)),
        SAMPLED: weak.integral(part.theta, 1) * driven,
        JUMPS: weak.integral(_jumps(part.current)),
        "load friction": weak.integral(torque),
        "d current": weak.integral(part.direct),
        RELUCTANCE: weak.integral(part.direct * part.current),
        "d current cos": weak.integral(part.direct * turning.real),
        "d current sin": weak.integral(part.direct * turning.imag),
        "q current cubed": weak.integral(part.current**3),
        "d squared q current": weak.integral(part.direct**2 * part.current),
        "d q current cubed": weak.integral(part.direct * part.current**3),
        "load lag": weak.integral(part.load, 1) * driven,
        LOAD_BETWEEN: weak.integral(part.between),
        **_late(LATE_LOAD, weak, part.load, half_row_s(part.capture, "torque_shaft_nm")),
        **_late(LATE_CURRENT, weak, part.current, half_row_s(part.capture, "iq_a")),
        CURRENT_LAG: weak.integral(part.current, 1) * driven,
        CURVATURE: weak.integral(part.current, 2) * driven,
        "eccentric cos": weak.integral(turning.real, 2),
        "eccentric sin": weak.integral(turning.imag, 2),
        "unbalance cos": weak.integral(turning.real),
        "unbalance sin": weak.integral(turning.imag),
    }


def _jumps(current: Array) -> Array:
    """Current [n, A] by which the mean between two samples may be off a straight line, where it
    jumps: snapshots do not show when.
    """
    sigma = noise_about_cubics(np.arange(current.size, dtype=np.float64), current)
    half = 0.5 * jumps(current, policy().shaft_rows.jump_sigmas * sigma)
    return np.append(half, 0.0) + np.append(0.0, half)


def _noise(part: _Part) -> dict[str, Array]:
    """Standard deviation [w] that the noise of angle and current makes in means of a window."""
    clock, weak = part.capture.arrays("t_s")["t_s"], part.weak
    uniform = clock if clock.size == part.theta.size else np.arange(part.theta.size, dtype=float)
    angle, current = (noise_about_cubics(uniform, one) for one in (part.theta, part.current))
    return {
        ACCELERATION_NOISE: np.full(weak.count, angle * weak.noise_gain(2)),
        CURRENT_NOISE: np.full(weak.count, current * weak.noise_gain(0)),
    }


def _ripples(
    part: _Part, cogging_orders: Sequence[int], ripple_orders: Sequence[int]
) -> dict[str, Array]:
    """Torque against angle of these orders a turn, the latter in proportion to q current."""
    ripples = {}
    for order in cogging_orders:
        ripple = np.exp(1j * order * part.theta)
        ripples[f"order {order} cos"] = part.weak.integral(ripple.real)
        ripples[f"order {order} sin"] = part.weak.integral(ripple.imag)
    for order in ripple_orders:
        ripple = part.current * np.exp(1j * order * part.theta)
        ripples[f"order {order} q current cos"] = part.weak.integral(ripple.real)
        ripples[f"order {order} q current sin"] = part.weak.integral(ripple.imag)
    return ripples
