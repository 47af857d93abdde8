"""One capture's signals for one kind of equation: what every residual is made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipeline.criticism.operating import Array, Flags, Indices, Made
from pipeline.criticism.parameter import Machine
from pipeline.numerics.projection import Projection
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Capture

PAIR_RAD = {"ab": 0.0, "bc": 2 * math.pi / 3, "ca": 4 * math.pi / 3}
"""Where the voltage between two terminals stands beside that of ab [rad, electrical]."""
UNSMOOTHED = "theta_recorded_rad"
"""The angle as it was recorded, where a smoother one took its place."""


@dataclass(frozen=True, slots=True)
class SpeedSensor:
    """What a recording shows of the sensor of its speed.

    Attributes
    ----------
    noise_rad_s
        Standard deviation of its noise, rounding included.
    step_rad_s
        Its resolution where that is too coarse for the noise to dither; else 0.

    """

    noise_rad_s: float
    step_rad_s: float


@dataclass(frozen=True, slots=True)
class Sensors:
    """What a recording shows of its sensors.

    Attributes
    ----------
    noise
        Standard deviation of every column [its unit], rounding included.
    steps
        Resolution of columns that are rounded too coarsely for their noise to dither, so that the
        rounding error follows the signal.
    runs_rad
        Angles turned between reversals that stand out of the noise of the angle; the column `run`
        numbers the current one.
    angle_step_rad
        Resolution of an angle whose noise is its rounding, before it was smoothed; None where it
        was not determined.
    readings
        Rounded readings that each sample of such an angle is the mean of.
    dither_rad
        Standard deviation of the white noise of such an angle before it is rounded.
    parabola
        Samples of the parabola that the angle was smoothed by; 1 for none.
    speed
        That of a speed whose integral is the angle; None of a recorded angle.
    held_speed
        Whether only windows of such a speed are used in which it does not change, so that no
        inertia is in the torque.
    phase_samples
        Samples over which an angle is smoothed that is the phase of the line voltages, whose noise
        it then has; 0 of any other.
    torque_s
        Instants of a torque that is sampled more slowly than the log [s, from its first row], which
        is on straight lines between them; None of any other.
    every
        Rows from one sample to the next, of columns that are slower than the log.

    """

    noise: Mapping[str, float]
    steps: Mapping[str, float] = field(default_factory=dict)
    runs_rad: Array | None = None
    angle_step_rad: float | None = None
    readings: int = 1
    dither_rad: float = 0.0
    parabola: int = 1
    speed: SpeedSensor | None = None
    held_speed: bool = False
    phase_samples: int = 0
    torque_s: Array | None = None
    every: Mapping[str, int] = field(default_factory=dict)

    @property
    def rounded(self) -> bool:
        """Whether the angle is in steps, or the speed that it is the integral of."""
        return bool(self.angle_step_rad or (self.speed is not None and self.speed.step_rad_s))


@dataclass(frozen=True, slots=True)
class Instrument:
    """What recorded a capture.

    Attributes
    ----------
    name
        `drive` or `bench`.
    timing
        How its voltages were sampled: `instant`, `held` or `centred`.
    meter, ammeter, transducer
        Nuisances that are the gains of voltmeter, current sensors and torque transducer.
    thermometer
        Nuisance that is the offset of its thermometers.
    frame
        How long before the middle of its hold the rotor frame of a logged voltage vector is taken
        [holds]: 0 or 0.5.
    stator
        Whether its transducer holds the motor's stator and so reads the reaction torque, which no
        inertia of the rotor is in; else it is in the shaft.
    points
        Points a sample that a logged voltage is the mean of; 1 of a log as fast as its PWM.
    snapshots
        Whether a logged voltage is one vector, from one of which to the next the rotor turns far.
    waves
        Whether the current between its rows has waves of the angle, as far as the rows show some.
    behind
        How long before its motion the currents and voltages of a row are [samples]: 0.5 where they
        are means up to the instant at which the motion is read, else 0.
    single
        What `timing` is stated to be of voltages that are taken as of one PWM period each; empty
        where they are taken as stated.

    """

    name: str
    timing: str
    meter: str = "gain_voltage"
    ammeter: str = "gain_current"
    transducer: str = "gain_torque"
    thermometer: str = "offset_temp_k"
    frame: float = 0.0
    stator: bool = False
    points: int = 1
    snapshots: bool = False
    waves: bool = True
    behind: float = 0.0
    single: str = ""

    @property
    def commanded(self) -> bool:
        """Whether its voltage is what a drive commands."""
        return self.meter.startswith("gain_commanded")


@dataclass(frozen=True, slots=True)
class Disturbances:
    """What may disturb a capture and is no effect of the machine; the noise floor absorbs it.

    Attributes
    ----------
    offsets
        Offsets of the channel, of their prior size [K, n].
    lines
        Weak samples of mains lines and of drift of sensors [K, C, W, M].

    """

    offsets: Array | None = None
    lines: Array | None = None


@dataclass(frozen=True, slots=True)
class Unthinned:
    """Columns of a log before it was thinned to its windows.

    Attributes
    ----------
    columns
        Those of a drive log [N], with `good`, the samples that were recorded well.
    late
        Signals that an instrument may record late [N].

    """

    columns: Mapping[str, Array] | None = None
    late: Mapping[str, Array] = field(default_factory=dict)


class Cache(dict[Hashable, Any]):
    """Cache of what was computed of a segment; another process has its own."""

    def __reduce__(self) -> tuple[type[Cache], tuple[()]]:
        """Pickles as one that holds nothing."""
        return Cache, ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """The signals of one capture for one kind of equation, with its weak form.

    Attributes
    ----------
    capture, test
        Path and test of the capture.
    kind
        Name of the equation (`equation.Equation`).
    ts_s
        Period of the even clock [s].
    recorded
        Columns [n] on that clock.
    channels
        Recorded signals that are predicted.
    weak
        Windows and test functions; None for a table.
    instrument
        What recorded it.
    sensors
        Noise and steps of the columns.
    fixed
        Numbers of the capture: `theta_elec_rad`, `pwm_s`, `vdc_v`, `ke_v_s_rad`, `ambient_k`, and 1
        by the name of each unlogged temperature's nuisance.
    disturbances
        Offsets, mains lines and drift.
    unthinned
        The log before it was thinned.
    blocks
        Number of the part of a capture that each window [W] belongs to; parts are held out one by
        one where there is no other capture to predict it from.
    whole
        Whether it is held out as a whole where the other captures determine all that it does.
    cache
        Cache of what was computed of it.

    """

    capture: str
    test: str
    kind: str
    ts_s: float
    recorded: Mapping[str, Array]
    channels: tuple[str, ...]
    weak: Projection | None
    instrument: Instrument
    sensors: Sensors
    fixed: Mapping[str, float] = field(default_factory=dict)
    disturbances: Disturbances = Disturbances()
    unthinned: Unthinned = Unthinned()
    blocks: Indices | None = None
    whole: bool = False
    cache: Cache = field(default_factory=Cache, repr=False, compare=False)

    @property
    def size(self) -> int:
        """Samples."""
        return int(next(iter(self.recorded.values())).size)

    @property
    def windows(self) -> Projection:
        """Windows and test functions of a log; ValueError for a table, which has none."""
        if self.weak is None:
            raise ValueError(f"{self.capture} is a table")
        return self.weak

    def once(self, column: Array, name: Hashable, by: Hashable, make: Callable[[], Made]) -> Made:
        """What depends on one recorded column, computed once for all copies of the segment.

        Parameters
        ----------
        column
            The column [n]; of one that was not recorded, such as with noise added, it is computed
            every time.
        name
            What is computed from it.
        by
            What else it depends on; the last one is kept.
        make
            Computes it.

        Returns
        -------
        Made
            The result of `make`, of this call or an earlier one.

        """
        known = self.cache.get(name)
        if known is not None and known[0] is column and known[1] == by:
            return known[2]
        result = make()
        if any(column is one for one in self.recorded.values()):
            self.cache[name] = column, by, result
        return result


def segment_of(
    capture: Capture,
    kind: str,
    instrument: str,
    period: float,
    recorded: Mapping[str, Array],
    sensors: Sensors,
    *,
    channels: tuple[str, ...],
    weak: Projection | None = None,
    blocks: Indices | None = None,
    offsets: Array | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Segment:
    """A segment with what the capture's metadata says of it.

    Parameters
    ----------
    capture
        The capture.
    kind
        Name of the equation.
    instrument
        `drive` or `bench`.
    period
        Of the even clock [s].
    recorded
        Columns of the capture, by name [n].
    sensors
        Noise and steps of the columns.
    channels
        Recorded signals that are predicted.
    weak
        Windows; None for a table.
    blocks
        Part of each window [W]; None to hold the capture out as a whole.
    offsets
        Offsets of prior size [K, n].
    fixed
        Further numbers of the capture.

    Returns
    -------
    Segment
        With gains, temperatures and frequencies of the metadata, and 1 as `measured` where the
        voltages are stated to be so.

    """
    stated = capture.meta.ambient_degc
    ambient = 0.0 if stated is None else stated - REFERENCE_DEGC
    numbers = {"ambient_k": ambient, **(fixed or {})}
    if pwm_hz := capture.meta.pwm_hz:
        numbers |= {"pwm_s": 1.0 / pwm_hz, "vdc_v": capture.meta.vdc_v or 0.0}
    if capture.meta.voltage_kind == "measured":
        numbers["measured"] = 1.0
    meter = "gain_commanded" if capture.meta.voltage_kind == "commanded" else "gain_voltage"
    return Segment(
        capture=capture.path,
        test=capture.meta.test,
        kind=kind,
        ts_s=period,
        recorded=recorded,
        channels=channels,
        weak=weak,
        instrument=Instrument(instrument, capture.meta.voltage_timing, meter),
        sensors=replace(
            sensors, steps={name: step for name, step in sensors.steps.items() if name in recorded}
        ),
        fixed=numbers,
        disturbances=Disturbances(offsets),
        blocks=blocks,
    )


def joins(segment: Segment) -> Indices:
    """Where the samples of a segment begin anew: it may be a selection of windows.

    Parameters
    ----------
    segment
        Any segment.

    Returns
    -------
    array
        Samples that do not follow the one before in time; nothing is even across them.

    """
    time = segment.recorded.get("t_s")
    if time is None:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(np.abs(np.diff(time) / segment.ts_s - 1.0) > 0.5) + 1


def with_lines(segment: Segment, lines: Array) -> Segment:
    """A segment with other weak samples [K, C, W, M] of what may disturb it.

    Parameters
    ----------
    segment
        Any segment.
    lines
        Weak samples [K, C, W, M].

    """
    return replace(segment, disturbances=replace(segment.disturbances, lines=lines))


def clock(segment: Segment) -> Array:
    """Time of every sample.

    Parameters
    ----------
    segment
        Any segment; a log that was thinned to its windows has its time in the column `t_s`.

    Returns
    -------
    array [n]
        In s, from the first sample.

    """
    even: Array = segment.ts_s * np.arange(segment.size, dtype=np.float64)
    return segment.recorded.get("t_s", even)


def projected(segment: Segment, sampled: Array) -> Array:
    """Weak samples of sampled channels.

    Parameters
    ----------
    segment
        Its windows.
    sampled
        Channels [C, n].

    Returns
    -------
    array [C, W, M]
        A table is its own projection: W = n, M = 1.

    """
    if segment.weak is None:
        return sampled[:, :, None]
    return segment.weak.project(sampled)


def row_index(
    segment: Segment,
) -> tuple[Indices, Indices, Flags, tuple[tuple[str, int], ...]]:
    """Group and window of every weak sample.

    Parameters
    ----------
    segment
        Any segment.

    Returns
    -------
    tuple
        Group [C, W, M], window [C, W, M], which are valid [C, W, M], and (channel, order) of each
        group.

    """
    weak = segment.weak
    orders = np.zeros(1, dtype=np.int64) if weak is None else weak.orders
    windows = segment.size if weak is None else weak.starts.size
    valid = np.ones((windows, 1), dtype=bool) if weak is None else weak.valid
    numbers = [int(k) if k == int(k) else k for k in orders.tolist()]
    distinct = sorted(set(numbers))
    groups = tuple((c, k) for c in segment.channels for k in distinct)
    number = {group: n for n, group in enumerate(groups)}
    shape = (len(segment.channels), windows, orders.size)
    table = np.array([[number[(c, k)] for k in numbers] for c in segment.channels])
    group = np.broadcast_to(table[:, None, :], shape)
    window = np.broadcast_to(np.arange(windows)[None, :, None], shape)
    return group, window, np.broadcast_to(valid[None], shape), groups


def rows_where(segment: Segment, holds: Callable[[str, float], bool]) -> Flags:
    """Which of the valid weak samples are of certain groups.

    Parameters
    ----------
    segment
        Any segment.
    holds
        Whether a (channel, order) is meant.

    Returns
    -------
    array [R] of bool

    """
    group, _, valid, groups = row_index(segment)
    return np.array([holds(channel, order) for channel, order in groups])[group[valid]]


def slow_orders(machine: Machine) -> tuple[float, ...]:
    """Orders a turn that are examined in a slow turn.

    Parameters
    ----------
    machine
        Pole pairs, slots, and orders that were seen.

    Returns
    -------
    tuple of float
        Electrical orders, those seen, slots, and the cogging order with its double, sorted.

    """
    orders = set(machine.electrical_orders) | set(machine.torque_orders)
    if machine.slots:
        orders.add(machine.slots)
    if machine.cogging_order is not None:
        orders |= {machine.cogging_order, 2 * machine.cogging_order}
    return tuple(sorted(orders))
