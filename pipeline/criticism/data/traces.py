"""Columns of a capture as even, smoothed, decimated or thinned signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.clocks import counted, sampled_unevenly
from pipeline.criticism.data.segment import UNSMOOTHED, Sensors
from pipeline.criticism.data.sensor_noise import coarse_step, sensor_noise
from pipeline.criticism.operating import Array
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.captures import Cutting
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.policy.sensors import SensorNoise
from pipeline.numerics.projection import window_starts
from pipeline.physics.glossary import TESTS_WITHOUT_CLOCK
from pipeline.records.capture import Capture

if TYPE_CHECKING:
    import polars as pl

ANGLES = frozenset({"theta_mech_rad", "theta_elec_rad"})
LINES_V = ("vab_v", "vbc_v", "vca_v")
SMOOTHED = ("temp_winding_degc", "temp_magnet_degc")
PAD = 24
"""Samples kept on either side of a window that is cut out: what differences and smoothing of a
speed reach over."""
_SHORTEST = 24
"""Fewest rows of a capture with a clock: three windows of eight, by judgement."""


def with_values(capture: Capture) -> Capture | None:
    """The capture without columns that hold no value at the samples of its richest table.

    Parameters
    ----------
    capture
        Any capture.

    Returns
    -------
    Capture or None
        None where nothing remains, and for a test with a clock whose time does not rise or is too
        short.

    """
    table = max(capture.tables, key=lambda t: (len(t.columns), t.height), default=None)
    if table is None or table.height == 0:
        return None
    if capture.meta.test not in TESTS_WITHOUT_CLOCK and not _rises(table):
        return None
    names_of = [[n for n in t.columns if _has_values(t, n, table)] for t in capture.tables]
    if all(set(names) <= {"t_s"} for names in names_of):
        return None
    if all(len(names) == len(t.columns) for names, t in zip(names_of, capture.tables, strict=True)):
        return capture
    tables = tuple(t.select(names) for names, t in zip(names_of, capture.tables, strict=True))
    return replace(capture, tables=tables)


def _rises(table: pl.DataFrame) -> bool:
    if "t_s" not in table.columns or table.height < _SHORTEST:
        return False
    return bool((np.diff(table["t_s"].to_numpy()) > 0.0).all())


def _has_values(table: pl.DataFrame, name: str, home: pl.DataFrame) -> bool:
    """Whether a column has a finite value, and one of another clock has it while this one ran."""
    finite = np.isfinite(table[name].to_numpy())
    if table is home or not finite.any() or "t_s" not in table.columns:
        return bool(finite.any())
    known, time = table["t_s"].to_numpy()[finite], home["t_s"].to_numpy()
    return bool(known[0] <= time[-1] and known[-1] >= time[0])


def even_clock(
    capture: Capture, names: tuple[str, ...], policy: Cutting
) -> tuple[float, dict[str, Array], NDArray[np.bool_]]:
    """Columns of a capture on an even clock.

    Parameters
    ----------
    capture
        With `t_s`.
    names
        Columns that are wanted, on one clock.
    policy
        Constants of judgement.

    Returns
    -------
    period
        Sample period [s].
    columns
        [n each]; missing values are bridged.
    keep
        Samples that count [n]: not those bridged, inside a gap of over 1.5 periods, or at either
        end.

    Notes
    -----
    A clock that is even within a thousandth is taken as it is. Of another one it is found out
    whether the samples came unevenly, and are interpolated, or only their stamps, and are counted.

    """
    home = capture.table_of("t_s", *names)
    columns = capture.arrays("t_s", *names, masked=False)
    keep = capture.kept(home).copy()
    time = columns.pop("t_s")
    period = float(np.median(np.diff(time)))
    for name, column in columns.items():
        finite = np.isfinite(column)
        if not finite.all() and finite.any():
            columns[name] = np.interp(time, time[finite], column[finite])
            keep &= finite
    uneven = np.abs(np.diff(time) - period).max() > policy.clock_even * period
    clock = counted(time, policy) if uneven else None
    if clock is not None and not sampled_unevenly(time, clock[1], columns.values(), policy):
        period, number = clock
        even = np.arange(number[-1] + 1)
        recorded = np.zeros(even.size, dtype=bool)
        recorded[number] = keep
        columns = {name: np.interp(even, number, column) for name, column in columns.items()}
        keep = recorded
    elif uneven:
        even = time[0] + period * np.arange(round((time[-1] - time[0]) / period) + 1)
        after = np.clip(np.searchsorted(time, even), 1, time.size - 1)
        bridged = (
            (time[after] - time[after - 1] < policy.clock_gap * period)
            & keep[after]
            & keep[after - 1]
        )
        columns = {name: np.interp(even, time, column) for name, column in columns.items()}
        keep = bridged
    keep[:1] = keep[-1:] = False
    return period, columns, keep


def smoothed(signal: Array, width: int) -> Array:
    """Centred moving mean, the ends continued by the mean of their half window.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    width
        Samples of the mean, odd.

    Returns
    -------
    array [n]
        Same unit.

    """
    half = min(width, signal.size) // 2
    if half == 0:
        return signal
    padded = np.concatenate(
        [np.full(half, signal[:half].mean()), signal, np.full(half, signal[-half:].mean())]
    )
    total = np.concatenate([[0.0], np.cumsum(padded)])
    return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)


def decimated(signal: Array, factor: int) -> Array:
    """Means of consecutive samples.

    Parameters
    ----------
    signal
        [n].
    factor
        Samples a mean.

    Returns
    -------
    array [n // factor]
        Samples beyond the last whole group are dropped.

    """
    n = signal.size // factor * factor
    return signal[:n].reshape(-1, factor).mean(axis=1)


def reversals(theta: Array, slack: float) -> NDArray[np.int64]:
    """First samples of the runs after each reversal of an angle.

    Parameters
    ----------
    theta
        Unwrapped angle [n, rad].
    slack
        What its noise may do [rad].

    Returns
    -------
    array
        Extremes that the angle then leaves by more than `slack`.

    Examples
    --------
    >>> reversals(np.array([0.0, 1.0, 2.0, 1.9, 2.0, 1.0, 0.0]), 0.5).tolist()
    [4]

    """
    step = np.diff(theta)
    moving = np.flatnonzero(step)
    sense = step[moving] > 0
    extremes = moving[1:][sense[1:] != sense[:-1]]
    places: list[int] = []
    going, best = 0, 0
    values = theta[extremes].tolist()
    at = [0, *extremes.tolist(), theta.size - 1]
    lowest = highest = (float(theta[0]), 0)
    for place, value in zip(at, [float(theta[0]), *values, float(theta[-1])], strict=True):
        lowest, highest = min(lowest, (value, place)), max(highest, (value, place))
        if going <= 0 and value > lowest[0] + slack:
            best = lowest[1]
        elif going >= 0 and value < highest[0] - slack:
            best = highest[1]
        else:
            continue
        if going:
            places.append(best)
        going = 1 if value > theta[best] else -1
        lowest = highest = (value, place)
    return np.array(places, dtype=np.int64)


def travel(theta: Array, slack: float) -> tuple[Array, Array, Array]:
    """Angle turned since the last reversal.

    Parameters
    ----------
    theta
        Unwrapped angle [n, rad].
    slack
        What its noise may do [rad].

    Returns
    -------
    since
        [n, rad], infinite before the first reversal.
    run
        Number of the run of each sample [n].
    turned
        Angle turned in each run [runs, rad], negative backwards; that of the first is infinite.

    """
    starts = np.concatenate([[0], reversals(theta, slack)])
    run = np.searchsorted(starts, np.arange(theta.size), side="right") - 1
    since = np.abs(theta - theta[starts[run]])
    since[run == 0] = np.inf
    ends = np.concatenate([starts[1:], [theta.size - 1]])
    turned = theta[ends] - theta[starts]
    turned[0] = math.copysign(math.inf, turned[0])
    return since, run.astype(float), turned


def thinned(
    columns: Mapping[str, Array], keep: NDArray[np.bool_], length: int, most: int, pad: int = PAD
) -> tuple[dict[str, Array], NDArray[np.int64]]:
    """Signals cut to an even selection of windows.

    Parameters
    ----------
    columns
        Signals [n each].
    keep
        Samples that count [n].
    length
        Samples a window.
    most
        Windows that stay.
    pad
        Samples kept on each side of a window, for what is smoothed or differenced.

    Returns
    -------
    signals
        Cut to the windows and their pads, one after the other; whole where little would go.
    starts
        First samples of the windows in them.

    Notes
    -----
    A bench log holds far more windows than the effects need, and cost goes with samples.

    """
    starts = window_starts(keep, length, length, most)
    if starts.size * (length + 2 * pad) >= keep.size:
        return dict(columns), window_starts(keep, length)
    starts = starts[(starts >= pad) & (starts + length + pad <= keep.size)]
    rows = (starts[:, None] - pad + np.arange(length + 2 * pad)[None, :]).ravel()
    cut = {name: column[rows] for name, column in columns.items()}
    return cut, pad + (length + 2 * pad) * np.arange(starts.size)


def whole_log(columns: Mapping[str, Array], period: float, policy: Cutting) -> dict[str, Array]:
    """The signals of a log that an instrument may record late, of all samples.

    Parameters
    ----------
    columns
        Columns [N].
    period
        Sample period [s].
    policy
        Smoothing of the speed.

    Returns
    -------
    dict of array [N]
        Currents, torque, and the smoothed angle.

    """
    names = ("id_a", "iq_a", "torque_shaft_nm")
    turned = smoothed(columns["theta_mech_rad"], 2 * round(policy.speed_s / period / 2) + 1)
    return {"theta_mech_rad": turned, **{name: columns[name] for name in names if name in columns}}


def window_of(period: float, size: int, policy: Cutting) -> int:
    """Samples a window.

    Parameters
    ----------
    period
        Sample period [s].
    size
        Samples of the capture.
    policy
        Length of a window.

    Returns
    -------
    int
        The policy's time, but no fewer than its samples, and four windows in the capture where that
        leaves enough.

    """
    samples = max(round(policy.window_s / period), policy.window_samples)
    return max(min(samples, size // 4), policy.least_window)


def with_angle(capture: Capture, names: list[str]) -> list[str]:
    """Some columns and the first column that gives the angle.

    Parameters
    ----------
    capture
        Any capture.
    names
        Columns.

    Returns
    -------
    list of str
        `names` alone where there is no angle or speed.

    """
    for name in ("theta_mech_rad", "theta_elec_rad", "omega_mech_rad_s"):
        if capture.has(name):
            return [*names, name]
    return names


def shaft_angle(columns: dict[str, Array], period: float, machine: Machine) -> float | None:
    """Adds the shaft angle to columns, from whatever gives it.

    Parameters
    ----------
    columns
        Columns [n]; `theta_mech_rad` is put in, an electrical angle or a speed taken out. Without
        any of them the angle is 0.
    period
        Sample period [s].
    machine
        Pole pairs and policy.

    Returns
    -------
    float or None
        Standard deviation of the noise of a speed that was integrated [rad/s]; None of an angle.

    """
    if "theta_mech_rad" in columns:
        return None
    if "theta_elec_rad" in columns:
        columns["theta_mech_rad"] = columns.pop("theta_elec_rad") / machine.pole_pairs
    elif "omega_mech_rad_s" in columns:
        speed = columns.pop("omega_mech_rad_s")
        columns["theta_mech_rad"] = np.concatenate(
            [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) * period]
        )
        return sensor_noise(speed, machine.policy.sensor_noise)
    else:
        columns["theta_mech_rad"] = np.zeros(next(iter(columns.values())).size)
    return None


def prepared(
    columns: dict[str, Array],
    period: float,
    policy: Policy,
    speed_noise_rad_s: float | None = None,
) -> Sensors:
    """Noise, coarse steps and runs of columns.

    Parameters
    ----------
    columns
        Columns [n]; temperatures are smoothed in place; `travel_rad`, `run` and `behind_nm` are
        added.
    period
        Sample period [s].
    policy
        Constants of judgement.
    speed_noise_rad_s
        Of a speed whose integral is the angle (`shaft_angle`).

    Returns
    -------
    Sensors
        For `segment_of`.

    """
    noise, steps = noise_and_steps(columns, policy.sensor_noise)
    width = max(2 * round(policy.cutting.temperature_s / period) + 1, 51)
    for name in SMOOTHED:
        if name in columns:
            columns[name] = smoothed(columns[name], width)
            noise[name] /= math.sqrt(width)
    runs = np.array([math.inf])
    if "theta_mech_rad" in columns:
        runs = with_travel(columns, noise, policy.cutting)
    if "torque_shaft_nm" in columns:
        columns["behind_nm"] = behind(columns["torque_shaft_nm"], policy.cutting.play_share)
    return Sensors(noise, steps, runs, speed_noise_rad_s=speed_noise_rad_s)


def behind(signal: Array, share: float) -> Array:
    """What a signal is over one that follows it with a play: its past, of hysteresis.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    share
        Half of the play, of the largest size of the signal [1].

    Returns
    -------
    array [n]
        Same unit, at most half of the play; that where it rises, less that where it falls.

    References
    ----------
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer, 1989 (play operator).

    """
    half = share * float(np.abs(signal).max(initial=0.0))
    lagged, follows = np.empty(signal.size), float(signal[0]) if signal.size else 0.0
    for n, value in enumerate(signal.tolist()):
        follows = min(max(follows, value - half), value + half)
        lagged[n] = value - follows
    return lagged


def noise_and_steps(
    columns: Mapping[str, Array], policy: SensorNoise
) -> tuple[dict[str, float], dict[str, float]]:
    """Noise of columns, and steps of those that are rounded too coarsely for it.

    Parameters
    ----------
    columns
        Columns [n].
    policy
        Constants of judgement.

    Returns
    -------
    tuple of dict
        Standard deviations and steps by name; an angle has no step here.

    """
    angles = {name: name.startswith("theta") for name in columns}
    noise = {n: sensor_noise(column, policy, angles[n]) for n, column in columns.items()}
    steps = {n: coarse_step(c, noise[n], policy) for n, c in columns.items() if not angles[n]}
    return noise, {name: step for name, step in steps.items() if step > 0.0}


def even_angle(
    columns: dict[str, Array], noise: dict[str, float], window: int, policy: Cutting
) -> int:
    """Takes an angle as its local parabola, as long a one as the motion of the shaft allows.

    Parameters
    ----------
    columns
        Columns; `theta_mech_rad` [n] is replaced, and stays as `UNSMOOTHED`.
    noise
        Of each column; that of the angle is lowered to what the parabola leaves [rad].
    window
        Samples of a weak window; a parabola has as many.
    policy
        Constants of judgement.

    Returns
    -------
    int
        Samples of the parabola; 1 where the shaft itself moves.

    Notes
    -----
    A dynamometer that holds its speed leaves only the encoder's rounding to difference twice; times
    J that would be a torque, and a model that takes inertia away would seem to explain it. Where
    the speed gives way for a moment, at a step of the load, a long parabola would take that
    acceleration away: the width is halved until no stretch of one width scatters by more than the
    angle's noise does. An acceleration that hides in that noise may still be more than the noise of
    the torque: what the smoothing changes in an equation is part of its noise floor.

    References
    ----------
    Savitzky and Golay, Anal. Chem. 36(8), 1964, 1627, doi:10.1021/ac60214a047.

    """
    theta, half = columns["theta_mech_rad"], window // 2
    if theta.size < 3 * (2 * half + 1) or noise["theta_mech_rad"] <= 0.0:
        return 1
    while (width := 2 * half + 1) >= policy.narrowest:
        run = parabolas(theta, width)
        power = np.convolve((theta - run) ** 2, np.full(width, 1.0 / width), mode="valid")
        if float(power.max()) <= (policy.motion_u * noise["theta_mech_rad"]) ** 2:
            columns |= {"theta_mech_rad": run, UNSMOOTHED: theta}
            # variance of a parabola's middle by least squares
            noise["theta_mech_rad"] *= math.sqrt(2.25 / width)
            return width
        half //= 2
    return 1


def evened(
    capture: Capture, columns: dict[str, Array], sensors: Sensors, machine: Machine, window: int
) -> Sensors:
    """The sensors of a log once the angle of a torque map is smoothed by `even_angle`.

    Parameters
    ----------
    capture
        Any capture; only a torque map is changed, since a dynamometer turns it evenly.
    columns
        Columns [n]; the angle is replaced in place.
    sensors
        Noise of the columns.
    machine
        Step of its encoder, which drive logs show; an even speed hides it.
    window
        Samples a window.

    Returns
    -------
    Sensors
        With the noise of the smoothed angle.

    """
    if capture.meta.test != "torque_map":
        return sensors
    noise = dict(sensors.noise)
    noise["theta_mech_rad"] = max(noise["theta_mech_rad"], machine.encoder_rad / math.sqrt(12))
    width = even_angle(columns, noise, window, machine.policy.cutting)
    return replace(sensors, noise=noise, parabola=width)


def held_speed(
    theta_rad: Array, noise_rad: float, window: int, policy: Cutting
) -> NDArray[np.bool_]:
    """Samples around which a recorded speed does not change beyond its noise.

    Parameters
    ----------
    theta_rad
        Integral of the speed [n].
    noise_rad
        Standard deviation of the speed's noise, times the sample period.
    window
        Samples of a weak window.
    policy
        Constants of judgement.

    Returns
    -------
    array [n] of bool
        Where the speed scatters no more than its noise in a window, and the means of the window
        before and of the one behind agree; none in a record of less than three windows.

    """
    travel, width = np.diff(theta_rad), 2 * (window // 2) + 1
    if travel.size < 3 * width:
        return np.zeros(theta_rad.size, dtype=bool)
    mean = smoothed(travel, width)
    apart = np.zeros(travel.size)
    apart[width:-width] = mean[2 * width :] - mean[: -2 * width]
    level = np.abs(apart) <= policy.change_u * noise_rad * math.sqrt(2.0 / width)
    quiet = smoothed((travel - mean) ** 2, width) <= (policy.motion_u * noise_rad) ** 2
    return np.append(level & quiet, False)


def parabolas(signal: Array, width: int) -> Array:
    """Local parabolas by least squares, those of the ends to the ends.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    width
        Samples of a parabola, odd; 1 leaves the signal.

    Returns
    -------
    array [n]
        Same unit.

    References
    ----------
    Savitzky and Golay, Anal. Chem. 36(8), 1964, 1627, doi:10.1021/ac60214a047.

    """
    if width == 1:
        return signal
    half = width // 2
    at = np.arange(-half, half + 1) / half
    basis = np.vander(at, 3, increasing=True)
    weights = np.linalg.pinv(basis)
    start, end = signal[:width], signal[-width:]
    middle = np.convolve(signal, weights[0][::-1], mode="valid")
    first, last = basis @ (weights @ start), basis @ (weights @ end)
    return np.concatenate([first[:half], middle, last[half + 1 :]])


def with_travel(columns: dict[str, Array], noise: Mapping[str, float], policy: Cutting) -> Array:
    """Adds travel since the last reversal and number of the run to columns.

    Parameters
    ----------
    columns
        Columns [n]; `travel_rad` and `run` are put in.
    noise
        Standard deviation of `theta_mech_rad`.
    policy
        How far beyond the noise a reversal must go.

    Returns
    -------
    array [runs]
        Angle turned in each run [rad]; the first is infinite.

    """
    slack = policy.reversal_u * noise["theta_mech_rad"]
    columns["travel_rad"], columns["run"], runs = travel(columns["theta_mech_rad"], slack)
    return runs
