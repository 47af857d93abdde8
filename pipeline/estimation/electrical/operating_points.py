"""A constant-speed dq test as a table: one settled operating point a step of current."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import assumed_temperature, magnet_source
from pipeline.estimation.electrical.ripple_torque import RIPPLE, ripple_of, winding_of
from pipeline.estimation.electrical.terminals import bridged
from pipeline.estimation.policy import policy
from pipeline.estimation.uncertainty.instruments import current_source, torque_source
from pipeline.estimation.uncertainty.instruments import voltage_source as source_of_voltage
from pipeline.numerics.least_squares import autocorrelation_time
from pipeline.numerics.plateaus import find_plateaus, white_noise_sigma
from pipeline.numerics.quantisation import RoundedColumn, Rounding, rounded_column
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate

ROUNDED = ("vd_v", "vq_v", "id_a", "iq_a")
MEANS = ("id_a", "iq_a", "vd_v", "vq_v", "torque_shaft_nm", "temp_magnet_degc")
TURN_RAD = 2.0 * np.pi
SPEED = "omega_mech_rad_s"


@dataclass(frozen=True, slots=True)
class Point:
    """Means over one settled step of a constant-speed test; NaN where a column is missing.

    Attributes
    ----------
    group
        Number of the constant-speed stretch; of a shaft that stands, of its angle.
    rows
        Samples in the mean.
    omega_mech_rad_s
        Slope of the angle where there is one, else the mean of the speed; 0 for a shaft that
        stands.
    id_a, iq_a, vd_v, vq_v, torque_nm
        Means in the frame of the drive [A, V, N·m].
    u_vd_v, u_vq_v
        Standard errors of the means by noise, correlation included.
    temp_magnet_degc
        Mean, or assumed.
    cos_turn, sin_turn
        Means of cosine and sine of the shaft angle; 0 where it was not recorded.
    period_s
        Sampling period [s].
    capture
        Where the point comes from.
    alpha_mech_rad_s2
        Acceleration of the shaft, of a bench that gives way; 0 where no motion was recorded.
    ripple_nm, u_ripple_nm
        Torque that harmonics of the currents make beside their means (`ripple_torque`), and its
        standard uncertainty; 0 where it is not known.
    rounded
        What rounding leaves in the means of voltages and currents, by column; none where it is
        empty.

    """

    group: int
    rows: int
    omega_mech_rad_s: float
    id_a: float
    iq_a: float
    vd_v: float
    vq_v: float
    torque_nm: float
    u_vd_v: float
    u_vq_v: float
    temp_magnet_degc: float
    cos_turn: float
    sin_turn: float
    period_s: float
    capture: Capture
    alpha_mech_rad_s2: float = 0.0
    ripple_nm: float = 0.0
    u_ripple_nm: float = 0.0
    rounded: Mapping[str, Rounding] = field(default_factory=dict, repr=False)

    @property
    def torque_of_means_nm(self) -> float:
        """Shaft torque less that of ripple: what the mean currents make, less drag."""
        return self.torque_nm - self.ripple_nm

    @property
    def standing(self) -> bool:
        """Whether the shaft is held still."""
        return self.omega_mech_rad_s == 0.0

    @property
    def angle_rad(self) -> float:
        """Mean shaft angle in a turn; NaN where no angle was logged."""
        known = self.cos_turn != 0.0 or self.sin_turn != 0.0
        return float(np.arctan2(self.sin_turn, self.cos_turn)) if known else float("nan")

    def shifted(self, shift: Mapping[str, float]) -> Point:
        """This point as it was if each instrument were off.

        Parameters
        ----------
        shift
            By source: gains of current, voltage and torque [1, relative], temperature [K]; what is
            not named is right.

        Returns
        -------
        Point
            Standard errors stay as they are.

        """
        meta = self.capture.meta
        current = 1.0 + shift.get(current_source(meta), 0.0)
        voltage = 1.0 + shift.get(source_of_voltage(meta), 0.0)
        torque = 1.0 + shift.get(torque_source(meta), 0.0)
        return replace(
            self,
            id_a=self.id_a * current,
            iq_a=self.iq_a * current,
            vd_v=self.vd_v * voltage,
            vq_v=self.vq_v * voltage,
            torque_nm=self.torque_nm * torque,
            ripple_nm=self.ripple_nm * current * voltage
            + shift.get(RIPPLE, 0.0) * self.u_ripple_nm,
            temp_magnet_degc=self.temp_magnet_degc + shift.get(magnet_source(self.capture), 0.0),
        )


@dataclass(frozen=True, slots=True)
class PointTable:
    """All points of several captures, and how many rows were settled of how many."""

    points: tuple[Point, ...]
    settled_rows: int
    rows: int

    def column(self, name: str) -> Array:
        """One attribute of every point.

        Parameters
        ----------
        name
            A field of `Point`.

        Returns
        -------
        array [n]
            In the unit of the field.

        """
        return np.array([getattr(point, name) for point in self.points], dtype=np.float64)

    def beside(self, other: PointTable) -> PointTable:
        """These points and others, those of one speed in one group.

        Parameters
        ----------
        other
            Of further captures.

        """
        points = tuple(_numbered([*self.points, *other.points]))
        settled = self.settled_rows + other.settled_rows
        return PointTable(points, settled, self.rows + other.rows)

    def note(self) -> str:
        """The mask, counted."""
        dropped = self.rows - self.settled_rows
        return f"{len(self.points)} settled points; {dropped} of {self.rows} rows were transient"


def operating_points(
    captures: Sequence[Capture], pole_pairs: int | None, resistance: Estimate | None = None
) -> PointTable:
    """Settled points of the captures; transients after each step of current or torque are left out.

    A stretch is settled where i_d, i_q and the torque all are; where the torque never is (it rings
    on in a soft coupling), the currents decide. It is cut to whole turns, or to
    whole electrical cycles where that would cost too much, so that ripple averages out.

    Parameters
    ----------
    captures
        Of a dynamometer that holds the speed while currents are stepped.
    pole_pairs
        For whole electrical cycles; None where not known.
    resistance
        Of a phase at 25 degC, for the torque of ripple; None where not known.

    Returns
    -------
    PointTable
        Means with standard errors, and how many rows they rest on.

    """
    winding = winding_of(pole_pairs, resistance)
    points: list[Point] = []
    total = 0
    for capture in captures:
        columns = _columns(capture)
        n = columns["iq_a"].size
        total += n
        if n < policy().evidence.rows:
            continue
        stretches = _stretches(columns)
        readings = {name: rounded_column(columns[name], stretches) for name in ROUNDED}
        for rows in stretches:
            whole = _whole_cycles(rows, columns, pole_pairs)
            point = _point(capture, columns, whole, readings)
            ripple, u = (
                (0.0, 0.0) if point.standing else ripple_of(capture, columns, whole, winding)
            )
            points.append(replace(point, ripple_nm=ripple, u_ripple_nm=u))
    numbered = _numbered(points)
    return PointTable(tuple(numbered), sum(p.rows for p in numbered), total)


def turning_tables(campaign: Campaign) -> list[Capture]:
    """Tables of settled points of a shaft that turns.

    Parameters
    ----------
    campaign
        Captures of one motor.

    Returns
    -------
    list of Capture
        Those of `torque_table` with a speed; without one the shaft was clamped.

    """
    return [c for c in campaign.of("torque_table") if c.turning]


def table_points(captures: Sequence[Capture]) -> PointTable:
    """The rows of tables as settled points, each the mean of one.

    Parameters
    ----------
    captures
        `turning_tables`.

    Returns
    -------
    PointTable
        Every row that holds speed, q current and torque.

    """
    points = []
    for capture in captures:
        names = (SPEED, "iq_a", "torque_shaft_nm")
        beside = ("id_a", "vd_v", "vq_v", "temp_magnet_degc")
        there = (name for name in beside if capture.has(name))
        columns = capture.finite(*names, *there, needed=names)
        size = columns["iq_a"].size
        usual = {"id_a": 0.0, "temp_magnet_degc": assumed_temperature(capture)}
        columns = {n: np.full(size, usual.get(n, np.nan)) for n in beside} | columns
        for name, value in usual.items():
            columns[name] = np.where(np.isfinite(columns[name]), columns[name], value)
        points += [
            _row_point(capture, {n: float(c[k]) for n, c in columns.items()}) for k in range(size)
        ]
    numbered = _numbered(points)
    return PointTable(tuple(numbered), len(numbered), len(numbered))


def _row_point(capture: Capture, row: Mapping[str, float]) -> Point:
    return Point(
        group=0,
        rows=1,
        omega_mech_rad_s=row[SPEED],
        id_a=row["id_a"],
        iq_a=row["iq_a"],
        vd_v=row["vd_v"],
        vq_v=row["vq_v"],
        torque_nm=row["torque_shaft_nm"],
        u_vd_v=float("nan"),
        u_vq_v=float("nan"),
        temp_magnet_degc=row["temp_magnet_degc"],
        cos_turn=0.0,
        sin_turn=0.0,
        period_s=float("nan"),
        capture=capture,
    )


def _numbered(points: Sequence[Point]) -> list[Point]:
    """The points with their groups: those of one speed, or of one angle where the shaft stands."""
    firsts: list[Point] = []
    numbered = []
    for point in points:
        group = next((g for g, first in enumerate(firsts) if _alike(point, first)), len(firsts))
        if group == len(firsts):
            firsts.append(point)
        numbered.append(replace(point, group=group))
    return numbered


def _alike(point: Point, first: Point) -> bool:
    """Whether two points share drag, or cogging at rest: one speed, one angle, else one capture."""
    if point.standing or first.standing:
        apart = abs(np.angle(np.exp(1j * (point.angle_rad - first.angle_rad)))) / TURN_RAD
        same_angle = (
            point.capture is first.capture
            if np.isnan(apart)
            else apart < policy().points.same_angle_turn
        )
        return point.standing and first.standing and bool(same_angle)
    speed = first.omega_mech_rad_s
    return abs(point.omega_mech_rad_s - speed) <= policy().points.same_speed * abs(speed)


def pole_pairs_of(known: Constants, nameplate: object) -> int | None:
    """Measured pole pairs, else those of the nameplate.

    Parameters
    ----------
    known
        Constants found so far.
    nameplate
        What the captures state, of any type.

    Returns
    -------
    int or None
        None where neither is there.

    """
    pairs = known.best("pole_pairs")
    if pairs is not None:
        return round(pairs.number)
    return nameplate if isinstance(nameplate, int) else None


def _columns(capture: Capture) -> dict[str, Array]:
    wanted = (*MEANS, "t_s", "theta_mech_rad", "omega_mech_rad_s", "temp_winding_degc")
    present = [n for n in wanted if capture.has(n)]
    columns = capture.arrays(*present)
    blank = np.full(columns["t_s"].size, np.nan)
    for name in (*MEANS, "theta_mech_rad", "omega_mech_rad_s"):
        columns.setdefault(name, blank)
    if not capture.has("id_a"):
        columns["id_a"] = np.zeros(blank.size)
    columns["temp_magnet_degc"] = bridged(columns["t_s"], columns["temp_magnet_degc"])
    ok = np.isfinite(columns["iq_a"]) & np.isfinite(columns["id_a"])
    return _without_gaps({name: column[ok] for name, column in columns.items()})


def _without_gaps(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Columns with straight lines across gaps that are shorter than any settled stretch, without
    the rows before and after that such a gap leaves open.
    """
    t_s, longest = columns["t_s"], policy().evidence.rows
    filled, begin, end = {}, 0, t_s.size
    for name, column in columns.items():
        filled[name] = column
        edges = np.flatnonzero(np.diff(np.isfinite(column), prepend=True, append=True))
        short = [(a, b) for a, b in edges.reshape(-1, 2) if b - a < longest]
        if not short:
            continue
        rows = np.concatenate([np.arange(a, b) for a, b in short])
        filled[name] = column.copy()
        filled[name][rows] = bridged(t_s, column)[rows]
        begin = max([begin, *(b for a, b in short if a == 0)])
        end = min([end, *(a for a, b in short if b == t_s.size)])
    return {name: column[begin:end] for name, column in filled.items()}


def _stretches(data: Mapping[str, Array]) -> list[slice]:
    """Settled stretches of a capture; of a slow log, whose levels are of few rows, by few rows.

    Where the means before and after each step leave less than half of the rows, means of the fewest
    rows are taken, which find the same steps in a signal that is larger than its noise.
    """
    fewest = policy().points.fewest_rows
    for names in (("id_a", "iq_a", "torque_shaft_nm"), ("id_a", "iq_a")):
        wide = _settled(data, names)
        little = 2 * _rows_in(wide) < data["iq_a"].size
        stretches = max(wide, _settled(data, names, fewest) if little else [], key=_rows_in)
        if stretches:
            return stretches
    return []


def _rows_in(stretches: Sequence[slice]) -> int:
    return sum(rows.stop - rows.start for rows in stretches)


def _settled(
    data: Mapping[str, Array], names: Sequence[str], window: int | None = None
) -> list[slice]:
    """Rows after each step of these columns, less twice the time that the step took to settle."""
    size = data["iq_a"].size
    flags = np.ones(size, dtype=bool)
    edges = {0, size}
    for name in names:
        if not np.all(np.isfinite(data[name])):
            continue
        inside = np.zeros(size, dtype=bool)
        for plateau in find_plateaus(
            data[name], policy().evidence.rows, window, tolerance=policy().points.step_share
        ):
            inside[plateau.rows] = True
            edges |= {plateau.start, plateau.stop}
        flags &= inside
    stretches, last = [], 0
    for a, b in pairwise(sorted(edges)):
        if b - a < policy().evidence.rows or not flags[a:b].all():
            continue
        start = a + min(a - last, (b - a) // 2)
        last = b
        if b - start >= policy().evidence.rows and _steady(data, slice(start, b), names):
            stretches.append(slice(start, b))
    return stretches


def _steady(data: Mapping[str, Array], rows: slice, names: Sequence[str]) -> bool:
    """Whether the halves of a stretch agree to 2 % of the signal's span, or to its noise."""
    for name in names:
        signal, part = data[name], data[name][rows]
        if not np.all(np.isfinite(signal)):
            continue
        half = part.size // 2
        drift = abs(float(np.mean(part[half:]) - np.mean(part[:half])))
        noise = policy().points.drift_sigmas * white_noise_sigma(part) / np.sqrt(half)
        if drift > max(policy().points.drift_share * float(np.ptp(signal)), noise):
            return False
    return True


def _whole_cycles(rows: slice, data: Mapping[str, Array], pole_pairs: int | None) -> slice:
    theta = data["theta_mech_rad"][rows]
    if not np.all(np.isfinite(theta)):
        return rows
    turns = abs(float(theta[-1] - theta[0])) / (2.0 * np.pi)
    for cycles in (turns, turns * (pole_pairs or 1)):
        whole = np.floor(cycles)
        if whole >= 1 and whole / cycles >= policy().points.whole_share:
            return slice(rows.stop - round(theta.size * whole / cycles), rows.stop)
    return rows


def _point(
    capture: Capture, data: Mapping[str, Array], rows: slice, readings: Mapping[str, RoundedColumn]
) -> Point:
    """The means over some rows, of which those of some `readings` are rounded."""
    t, theta = data["t_s"][rows], data["theta_mech_rad"][rows]
    cos_turn = sin_turn = 0.0
    has_angle = bool(np.all(np.isfinite(theta)))
    if has_angle:
        cos_turn, sin_turn = float(np.mean(np.cos(theta))), float(np.mean(np.sin(theta)))
        omega = float(np.polyfit(t - t.mean(), theta - theta.mean(), 1)[0])
        alpha = _acceleration(t, theta, 2)
    else:
        speed = data["omega_mech_rad_s"][rows]
        omega = float(np.mean(speed))
        alpha = _acceleration(t, speed, 1)
    travel = abs(omega) * np.array([t[-1] - t[0], data["t_s"][-1] - data["t_s"][0]]) / TURN_RAD
    still = policy().points
    if travel[0] < still.still_turn and (not has_angle or travel[1] < still.still_capture_turn):
        omega = 0.0
    means = {name: float(np.mean(data[name][rows])) for name in MEANS}
    u = {name: _error_of_mean(data[name][rows]) for name in ("vd_v", "vq_v")}
    rounded = {name: one.error_of_mean(rows) for name, one in readings.items()}
    if not np.isfinite(means["temp_magnet_degc"]):
        means["temp_magnet_degc"] = assumed_temperature(capture)
    return Point(
        group=0,
        rows=t.size,
        omega_mech_rad_s=omega,
        id_a=means["id_a"],
        iq_a=means["iq_a"],
        vd_v=means["vd_v"],
        vq_v=means["vq_v"],
        torque_nm=means["torque_shaft_nm"],
        u_vd_v=u["vd_v"],
        u_vq_v=u["vq_v"],
        temp_magnet_degc=means["temp_magnet_degc"],
        cos_turn=cos_turn,
        sin_turn=sin_turn,
        period_s=float(np.median(np.diff(t))),
        capture=capture,
        alpha_mech_rad_s2=alpha,
        rounded=rounded,
    )


def _acceleration(t_s: Array, motion: Array, power: int) -> float:
    """Mean acceleration [rad/s²]: the curvature of an angle, `power` 2, or the slope of a speed, 1;
    0 where it is not known.
    """
    if motion.size <= power or not np.all(np.isfinite(motion)):
        return 0.0
    return float(power * np.polyfit(t_s - t_s.mean(), motion - motion.mean(), power)[0])


def _error_of_mean(part: Array) -> float:
    if not np.all(np.isfinite(part)):
        return float("nan")
    return float(np.std(part) * np.sqrt(autocorrelation_time(part) / part.size))
