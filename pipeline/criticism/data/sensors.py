"""Noise, resolution and reversals that the columns of a capture show."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.acceleration import shows_acceleration
from pipeline.criticism.data.hysteresis import play_lag, with_travel
from pipeline.criticism.data.locked_waves import LockedWaves
from pipeline.criticism.data.rounding import coarse_step, step_of_differences
from pipeline.criticism.data.segment import Sensors, SpeedSensor
from pipeline.criticism.data.traces import READ_BETWEEN, smoothed
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.policy.sensors import SensorNoise
from pipeline.records.capture import Capture
from pipeline.records.row_means import slower_rows

TEMPERATURES = ("temp_winding_degc", "temp_magnet_degc")
CURRENTS, TORQUE = ("id_a", "iq_a"), "torque_shaft_nm"
VOLTS = ("vd_v", "vq_v")
FREE = 2.2
"""Third differences of white noise that are as good as one independent number."""


def prepared(
    columns: dict[str, Array],
    period: float,
    policy: Policy,
    speed: SpeedSensor | None = None,
    orders: Sequence[float] = (),
) -> Sensors:
    """Noise, coarse steps and runs of columns, which get ready for `segment_of`.

    Parameters
    ----------
    columns
        Columns [n]; temperatures are smoothed in place; `travel_rad`, `run` and `behind_nm`, the
        `play_lag` of the torque, are added.
    period
        Sample period [s].
    policy
        Constants of judgement.
    speed
        Of a speed whose integral is the angle (`shaft_angle`).
    orders
        Waves a turn of the angle that are no noise.

    Returns
    -------
    Sensors
        For `segment_of`.

    """
    sensed = {name: column for name, column in columns.items() if name != READ_BETWEEN}
    noise, steps = noise_and_steps(sensed, policy.sensor_noise, orders)
    width = max(2 * round(policy.cutting.temperature_s / period) + 1, 51)
    for name in TEMPERATURES:
        if name in columns:
            columns[name] = smoothed(columns[name], width)
            noise[name] /= math.sqrt(width)
    runs = np.array([math.inf])
    if "theta_mech_rad" in columns:
        runs = with_travel(columns, noise, policy.cutting)
    if "torque_shaft_nm" in columns:
        columns["behind_nm"] = play_lag(columns["torque_shaft_nm"], policy.cutting.play_share)
    return Sensors(noise, steps, runs, speed=speed)


def with_slow_columns(
    capture: Capture, columns: Mapping[str, Array], sensors: Sensors, period: float, policy: Policy
) -> tuple[Sensors, int]:
    """The sensors of a log of which columns may be sampled more slowly than its rows.

    Parameters
    ----------
    capture
        The log.
    columns
        Its columns [n] on an even clock; slower ones are on straight lines.
    sensors
        As `prepared` made them.
    period
        Of that clock [s].
    policy
        Constants of judgement.

    Returns
    -------
    sensors : Sensors
        With white noise of the rows that is as loud in means as that of a slower column's samples,
        of a current or torque with what straight lines miss of it; and of a slower torque its
        instants instead, where the angle shows the acceleration at these.
    rows : int
        Rows from one sample of such a torque to the next; 0 of any other.

    Notes
    -----
    Straight lines miss u (1 − u)/2 of a second difference d at a part u of the way: in the mean
    square d²/120. Nothing is known of what a current does faster than its samples. A torque's own
    instants miss nothing, but the noise of an acceleration there makes the inertia smaller than it
    is: windows average it, samples do not. A voltage has pulses, which count where they are.

    """
    rows = capture.arrays("t_s", *(set(columns) & capture.columns), masked=False)["t_s"]
    noise, every, counts = dict(sensors.noise), 0, {}
    for name in {*VOLTS, *CURRENTS, TORQUE} & set(columns) & capture.columns:
        slow = capture.finite("t_s", name)
        if not slower_rows(slow["t_s"], rows):
            continue
        counts[name] = count = max(round(float(np.median(np.diff(slow["t_s"]))) / period), 1)
        bend = 0.0 if name in VOLTS else float(np.std(np.diff(slow[name], 2)))
        missed = bend / math.sqrt(120.0)
        if name == TORQUE:
            every = count
            theta = columns.get("theta_mech_rad", np.zeros(rows.size))
            if shows_acceleration(theta, count, policy.cutting):
                missed = 0.0
                sensors = replace(sensors, torque_s=slow["t_s"] - rows[0])
            at = (slow["t_s"] - rows[0]) / period
            driving = [
                np.interp(at, np.arange(columns[n].size), columns[n])
                for n in CURRENTS
                if n in columns
            ]
            driving = [*driving, np.prod(driving, axis=0)]
            slow[name] = beside_columns(slow[name], np.column_stack(driving))
        sigma = math.hypot(sensor_noise(slow[name], policy.sensor_noise), missed)
        noise[name] = sigma * math.sqrt(count)
    return replace(sensors, noise=noise, every=counts), every


def beside_columns(signal: Array, columns: Array) -> Array:
    """What is quick in a signal [n] and no sum of columns [n, k], by its third differences.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    columns
        What makes it change as fast as its noise does [n, k].

    Returns
    -------
    array [n]
        In the unit of the signal.

    """
    shares, *_ = np.linalg.lstsq(np.diff(columns, 3, axis=0), np.diff(signal, 3), rcond=None)
    return signal - columns @ shares


def noise_and_steps(
    columns: Mapping[str, Array], policy: SensorNoise, orders: Sequence[float] = ()
) -> tuple[dict[str, float], dict[str, float]]:
    """Noise of columns, and steps of those that are rounded too coarsely for it.

    Parameters
    ----------
    columns
        Columns [n].
    policy
        Constants of judgement.
    orders
        Waves a turn of `theta_mech_rad` that are no noise, but of currents.

    Returns
    -------
    tuple of dict
        Standard deviations and steps by name; an angle has no step here.

    """
    angles = {name: name.startswith("theta") for name in columns}
    theta = columns.get("theta_mech_rad")
    waves = LockedWaves.of(theta, orders, policy) if orders and theta is not None else None
    # a wave of the current is what straight lines between its rows miss
    beside = {name: None if name.endswith("_a") else waves for name in columns}
    noise = {n: sensor_noise(column, policy, angles[n], beside[n]) for n, column in columns.items()}
    steps = {n: coarse_step(c, noise[n], policy) for n, c in columns.items() if not angles[n]}
    return noise, {name: step for name, step in steps.items() if step > 0.0}


def sensor_noise(
    signal: Array,
    policy: SensorNoise,
    steady: bool = False,
    waves: LockedWaves | None = None,
) -> float:
    """Standard deviation of a signal's white sensor noise.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite.
    policy
        Constants of judgement.
    steady
        Whether it is an angle, whose rounding comes and goes with its speed.
    waves
        Of the rotor's angle in the same samples, which the signal may contain.

    Returns
    -------
    float
        Unit of the signal; 0 for fewer than four samples. Never below q/√12 of the signal's step q.

    Notes
    -----
    Third differences of white noise have the variance 20 σ². Their mean square is taken in blocks,
    and a low quantile over the blocks keeps steps and bursts out, a higher one for a `steady`
    signal; what a quantile of chi-square is below its mean is made up for. Where shorter blocks
    have far less, the signal steps in most of the longer ones. Where waves of the rotor leave far
    less, they are most of it.

    References
    ----------
    von Neumann, Kent, Bellinson and Hart, Ann. Math. Statist. 12(2), 1941, 153 (successive
    differences), doi:10.1214/aoms/1177731746.
    Wilson and Hilferty, Proc. Natl. Acad. Sci. 17(12), 1931, 684, doi:10.1073/pnas.17.12.684.
    Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, ch. 3.

    """
    third = np.diff(signal, 3)
    if third.size == 0:
        return 0.0
    width = min(policy.block, max(third.size // policy.blocks, policy.shortest_block), third.size)
    quantile = policy.steady if steady else policy.quiet
    level = _of_blocks(third, width, quantile)
    if not steady:
        widths = [width >> n for n in range((width // policy.shortest_block).bit_length())]
        clean = min((_of_blocks(third, one, quantile) for one in widths[1:]), default=level)
        level = clean if clean * policy.steps_growth < level else level
        if waves is not None:
            fitted = [one for one in widths if one >= waves.shortest()]
            beside = (_of_blocks(waves.remainder(third, one), one, quantile) for one in fitted)
            clean = min(beside, default=level)
            level = clean if clean * policy.steps_growth < level else level
    return max(level, step_of_differences(third) / math.sqrt(12.0))


def _of_blocks(third: Array, width: int, quantile: tuple[float, ...]) -> float:
    """Standard deviation of white noise whose third differences [n] have the mean square that a
    share of all blocks stays below.
    """
    blocks = third[: third.size // width * width].reshape(-1, width)
    # Wilson and Hilferty's quantile of chi-square with the samples that third differences leave
    spread, (share, deviate) = 2.0 / (9.0 * width / FREE), quantile
    below = (1.0 - spread + deviate * math.sqrt(spread)) ** 3
    return math.sqrt(float(np.quantile((blocks**2).mean(axis=1), share)) / (20.0 * below))


def slow_noise(signal: Array, longest: float, policy: SensorNoise) -> float:
    """Standard deviation of white noise that is as loud as a signal's is in means of its samples.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite, of a filtered or observed quantity.
    longest
        Samples of a mean at the most.
    policy
        Constants of judgement.

    Returns
    -------
    float
        Unit of the signal; `sensor_noise` where the noise is white.

    Notes
    -----
    What a filter passes of a noise is smooth from sample to sample: third differences of samples
    miss it, and those of means do not. Lengths double until the means show the motion, which grows
    faster than any noise that a loop of second order leaves.

    References
    ----------
    Allan, Proc. IEEE 54(2), 1966, 221, doi:10.1109/PROC.1966.4634 (variances of means).

    """
    loudest = before = sensor_noise(signal, policy)
    length = 2
    while length <= longest and signal.size // length >= policy.block * policy.blocks:
        means = signal[: signal.size // length * length].reshape(-1, length).mean(axis=1)
        level = math.sqrt(length) * sensor_noise(means, policy)
        if level > policy.motion_growth * before:
            break
        loudest, before, length = max(loudest, level), level, 2 * length
    return loudest
