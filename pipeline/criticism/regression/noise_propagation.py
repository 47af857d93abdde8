"""How the noise of sensors propagates into a residual: the floor of each weak sample."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.rounding import readings_error, rounding_error, smoothed, unrounded
from pipeline.criticism.data.segment import (
    UNSMOOTHED,
    Segment,
    SpeedSensor,
    joins,
    projected,
    row_index,
)
from pipeline.criticism.data.traces import LINES_V, READ_BETWEEN, parabolas
from pipeline.criticism.data.traces import smoothed as box_mean
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.operating import Array, Indices, Signals, Values
from pipeline.criticism.policy.sensors import SensorNoise
from pipeline.criticism.regression.sampler import Sampler
from pipeline.criticism.residuals.residual import residual
from pipeline.physics.frames import vector_of_lines
from pipeline.records.row_means import bridged

IN_ROTOR_FRAME = (("id_a", "iq_a"), ("vd_v", "vq_v"))
"""Columns of the two axes that a recorder turns by the angle that it reads."""
_SPEED = "omega_mech_rad_s"
"""A speed whose integral is the angle: no column of the segment."""


def noise_floor(segment: Segment, model: Model, values: Values, seed: int) -> Array:
    """What the sensors' noise alone makes of the weak residual.

    Parameters
    ----------
    segment
        With the noise and steps of its columns.
    model, values
        At which the residual is computed.
    seed
        Of the noise.

    Returns
    -------
    array [R]
        Standard deviation of each weak sample.

    Notes
    -----
    Noise is added to the recording and the residual computed again; the variance of the change is
    pooled over the windows of a (channel, order). The noise is white, of each sensor's own level;
    of an angle that is an integrated speed it is a random walk, from anywhere in the turn: what a
    model has that goes with the angle is noise there. Signals that are coarse are rounded anew. The
    noise of an angle that was smoothed is smoothed alike: what is slow in it stays as it was. What
    the smoothing changes in the residual counts too: it may have been noise or motion. A rounded
    angle, or speed that is integrated, is rounded anew as well (`_of_rounding`). A row that
    was lost, or lacks its angle, has the noise of those that it is read between.

    """
    policy, recording = model.policy.noise_floors, _Recording.of(segment, model, values)
    replicates = max(policy.replicates, min(policy.pooled // recording.windows, policy.pooled))
    if segment.sensors.steps:
        replicates = max(replicates, policy.shifts)
    variance = recording.pooled(map(recording.change, recording.noisy(seed, replicates)))
    if UNSMOOTHED in segment.recorded:
        rough = {**segment.recorded, "theta_mech_rad": segment.recorded[UNSMOOTHED]}
        variance += recording.pooled([recording.change(rough)])
    of_rows: Array = variance[recording.group]
    if segment.sensors.rounded:
        of_rows = of_rows + _of_rounding(recording, variance)
    return np.sqrt(of_rows) + 1e-300


def noise_growth(segment: Segment, model: Model, values: Values, near: Values, seed: int) -> Array:
    """Noise floor of a segment over the one at other values.

    Parameters
    ----------
    segment
        With the noise and steps of its columns.
    model, values
        At which the residual is computed.
    near
        The other values; an effect without a value is not there.
    seed
        Of the noise.

    Returns
    -------
    array [R]
        Ratio [1], the same in each (channel, order). The same noise is added in both, so that a few
        samples of it tell.

    """
    there = {name.partition(".")[0] for name in near}
    model_near = model.without(*(e.name for e in model.effects if e.name not in there))
    known = segment.cache.get("noise near")
    if known is None or known[:3] != (model_near, near, seed):
        before = _noise_of_few(segment, model_near, near, seed)
        known = segment.cache["noise near"] = model_near, dict(near), seed, before
    ratio: Array = np.sqrt(_noise_of_few(segment, model, values, seed) / known[3])
    group, _, valid, _ = row_index(segment)
    return ratio[group[valid]]


def quick_noise(segment: Segment, model: Model, values: Values, seed: int) -> Array:
    """As `noise_floor`, by a few samples of the noise: good to a third.

    Parameters
    ----------
    segment
        With the noise and steps of its columns.
    model, values
        At which the residual is computed.
    seed
        Of the noise.

    Returns
    -------
    array [R]
        Standard deviation of each weak sample, the same in each (channel, order).

    """
    group, _, valid, _ = row_index(segment)
    return np.sqrt(_noise_of_few(segment, model, values, seed))[group[valid]]


def _noise_of_few(segment: Segment, model: Model, values: Values, seed: int) -> Array:
    """Variance of the weak residual [groups] by a few samples of its noise and roundings. These are
    kept: a search asks for them at every fit that it tries.
    """
    for effect in model.effects:
        values = {**zero(effect, model), **values}
    recording, few = _Recording.of(segment, model, values), model.policy.noise_floors.few
    by = seed, model.machine.pole_pairs, model.policy
    known = segment.cache.get("few")
    if known is None or known[0] is not segment or known[1] != by:
        recorded = [*recording.noisy(seed, few), *recording.rounded(few)]
        known = segment.cache["few"] = segment, by, recorded
    return recording.pooled(map(recording.change, known[2])) + 1e-300


@dataclass(frozen=True, slots=True)
class _Recording:
    """A recording whose columns may be other by the noise of their sensors.

    `even`: coarse columns as they were before they were rounded; `group` [R] of each weak sample,
    `counts` of each group; `unperturbed` [R]: the weak residual as recorded.
    """

    segment: Segment
    model: Model
    values: Values
    even: Mapping[str, Array]
    group: Indices
    counts: Array
    unperturbed: Array

    @classmethod
    def of(cls, segment: Segment, model: Model, values: Values) -> _Recording:
        group, _, valid, groups = row_index(segment)
        group = group[valid]
        counts = np.maximum(np.bincount(group, minlength=len(groups)), 1).astype(float)
        even = _before_rounding(segment, model.policy.sensor_noise)
        sampler: Sampler | None = segment.cache.get("sampler")
        if sampler is not None and sampler.at(segment, model, values):
            sampled = sampler.base_residual
        else:
            sampled = residual(segment, model, values)
        unperturbed = projected(segment, sampled)[valid]
        return cls(segment, model, values, even, group, counts, unperturbed)

    @property
    def windows(self) -> int:
        """Weak samples of a group, on average."""
        return max(self.unperturbed.size // max(self.counts.size, 1), 1)

    def change(self, recorded: Signals) -> Array:
        """What other columns make of the weak residual [R]."""
        _, _, valid, _ = row_index(self.segment)
        bridged_too = _between_rows(self.segment, recorded)
        changed = residual(self.segment, self.model, self.values, bridged_too)
        return projected(self.segment, changed)[valid] - self.unperturbed

    def pooled(self, changes: Iterable[Array]) -> Array:
        """Mean square [groups] of changes of the weak residual."""
        means = [np.bincount(self.group, one**2, self.counts.size) / self.counts for one in changes]
        return np.mean(means, axis=0) if means else np.zeros(self.counts.size)

    def noisy(self, seed: int, count: int) -> Iterator[dict[str, Array]]:
        """The columns with other noise of their sensors, but for the rounding of a motion."""
        shifts = _shifts(self.segment, count, seed)
        for replicate in range(count):
            shift = {name: shifts[name][replicate] for name in self.segment.sensors.steps}
            generator = np.random.default_rng([seed, replicate])
            noisy = _noisy(self.segment, self.even, shift, generator)
            if self.segment.sensors.phase_samples:
                noisy["theta_mech_rad"] = self._by_phase(noisy)
            yield noisy

    def _by_phase(self, noisy: Signals) -> Array:
        """The angle [n, rad] that is the smoothed phase of line voltages, by noisy ones."""
        of_lines = (
            vector_of_lines({name: columns[name] for name in LINES_V if name in columns})
            for columns in (self.segment.recorded, noisy)
        )
        before, after = of_lines
        error = np.angle(after * np.conj(before)) / self.model.machine.pole_pairs
        width = self.segment.sensors.phase_samples
        theta: Array = self.segment.recorded["theta_mech_rad"] + box_mean(error, width)
        return theta

    def roundings(self, count: int) -> Iterator[Array]:
        """Changes of the weak residual [R] by the rounding of a motion, none where it is not."""
        return map(self.change, self.rounded(count))

    def rounded(self, count: int) -> Iterator[dict[str, Array]]:
        """The columns with an angle, or the speed that it is the integral of, rounded anew; none
        where neither is rounded.

        A rounded signal does not show where between two steps it began, and how fast it moved to a
        part of a step a window (`NoiseFloors.pace`): both are spread evenly. Of an even pace the
        same harmonic of the rounding meets an order in every window: a wider spread would leave
        that one out.
        """
        sensors, weak = self.segment.sensors, self.segment.weak
        if not sensors.rounded:
            return
        theta = self.segment.recorded["theta_mech_rad"]
        ramp = np.arange(theta.size) / (theta.size if weak is None else weak.length)
        spread = (np.arange(count) + 0.5) / count - 0.5
        pace = 2.0 * self.model.policy.noise_floors.pace
        paces = pace * np.random.default_rng(count).permutation(spread)
        for number, (shift, of_pace) in enumerate(zip(spread, paces, strict=True)):
            moved = shift + of_pace * ramp
            if sensors.speed is not None:
                generator = np.random.default_rng([count, number])
                error = _rounded_speed(sensors.speed, self.even[_SPEED], moved, generator)
                moved_rad = theta + _integrated(self.segment, error)
                yield {**self.segment.recorded, "theta_mech_rad": moved_rad}
                continue
            even, step = self.even["theta_mech_rad"], sensors.angle_step_rad or 0.0
            if sensors.dither_rad:
                generator = np.random.default_rng([count, number])
                even = even + sensors.dither_rad * generator.normal(size=even.size)
            error = readings_error(even, step, sensors.readings, moved)
            moved_rad = theta + parabolas(error, sensors.parabola)
            yield {**self._in_turned_frame(error), "theta_mech_rad": moved_rad}

    def _in_turned_frame(self, error_rad: Array) -> dict[str, Array]:
        """The columns [n] with those of the rotor frame in one that is ahead by an error [rad] of
        the mechanical angle.
        """
        recorded = dict(self.segment.recorded)
        back = np.exp(-1j * self.model.machine.pole_pairs * error_rad)
        for d, q in IN_ROTOR_FRAME:
            if d in recorded and q in recorded:
                turned = (recorded[d] + 1j * recorded[q]) * back
                recorded |= {d: turned.real, q: turned.imag}
        return recorded


def _between_rows(segment: Segment, noisy: Signals) -> Signals:
    """Noisy columns whose noise is read between other rows where the rows themselves are."""
    between = segment.recorded.get(READ_BETWEEN)
    if between is None:
        return noisy
    lost, row = between == 1.0, np.arange(between.size, dtype=np.float64)
    columns = dict(noisy)
    for name, column in noisy.items():
        if column is not (recorded := segment.recorded.get(name)) and recorded is not None:
            noise = bridged(row, np.where(lost, np.nan, column - recorded))
            columns[name] = recorded + np.nan_to_num(noise)
    return columns


def _of_rounding(recording: _Recording, noise: Array) -> Array:
    """Variance [R] that the rounding of a motion makes of the weak residual, beside that of the
    `noise` [groups].

    It is each window's own: where a signal moves by nearly whole steps from sample to sample, its
    error creeps instead of jumping about, and none of it averages out [Widrow & Kollar (2008), ch.
    20]. Where a few roundings show next to nothing beside the noise, their mean will do.
    """
    policy = recording.model.policy.noise_floors
    few = recording.pooled(recording.roundings(policy.few))
    if np.all(few <= policy.unseen * noise):
        return few[recording.group]
    changes = recording.roundings(policy.shifts)
    return np.mean([change**2 for change in changes], axis=0)


def _noisy(
    segment: Segment,
    even: Mapping[str, Array],
    shift: Mapping[str, float],
    generator: np.random.Generator,
) -> dict[str, Array]:
    """The recorded columns with other noise of their sensors, except for the rounding of an angle.

    `even` are those that are rounded anew, as they were before; `shift` the part of a step by which
    coarse signals are moved.
    """
    sensors = segment.sensors
    noisy = {}
    for name, column in segment.recorded.items():
        noise = _smoothed(segment, name, generator.normal(size=column.size))
        noisy[name] = column + noise if noise.any() else column
    if sensors.speed is not None:
        anywhere = generator.uniform(0.0, 2.0 * math.pi)
        noisy["theta_mech_rad"] = noisy["theta_mech_rad"] + anywhere
    for name, step in sensors.steps.items():
        noisy[name] = noisy[name] + rounding_error(even[name], step, shift[name])
    if sensors.angle_step_rad:
        dither = sensors.dither_rad * generator.normal(size=segment.size)
        theta = segment.recorded["theta_mech_rad"]
        noisy["theta_mech_rad"] = theta + parabolas(dither, sensors.parabola)
    return noisy


def _rounded_speed(
    speed: SpeedSensor, even: Array, shift: Array, generator: np.random.Generator
) -> Array:
    """Error [n, rad/s] of a speed that is noisy before it is rounded: what noise dithers of a
    rounding is as white as the noise.
    """
    above = _above_rounding(speed.noise_rad_s, speed.step_rad_s)
    noise = above * generator.normal(size=even.size)
    return noise + rounding_error(even + noise, speed.step_rad_s, shift)


def _before_rounding(segment: Segment, policy: SensorNoise) -> dict[str, Array]:
    """Coarse signals and a rounded angle as they may have been before they were rounded; an angle
    that was smoothed stays as it is.
    """
    sensors = segment.sensors

    def even_of(signal: Array, step: float, between: Array | None = None) -> Array:
        columns = np.stack([signal, signal if between is None else between])
        parts = np.split(columns, joins(segment), axis=1)
        return np.concatenate([smoothed(part[0], step, policy, part[1]) for part in parts])

    even = {}
    for name, step in sensors.steps.items():
        column = segment.recorded[name]
        even[name] = even_of(column, step, unrounded(column, step))
    if sensors.speed is not None and sensors.speed.step_rad_s:
        # means of neighbours are in half steps
        half = 0.5 * sensors.speed.step_rad_s
        speed = np.diff(segment.recorded["theta_mech_rad"], append=math.nan) / segment.ts_s
        speed[-1:] = speed[-2:-1]
        even[_SPEED] = even_of(speed, half, unrounded(speed, half))
    if sensors.angle_step_rad:
        theta = segment.recorded["theta_mech_rad"]
        rough = sensors.parabola == 1
        passing = math.hypot(sensors.angle_step_rad, math.sqrt(12.0) * sensors.dither_rad)
        even["theta_mech_rad"] = even_of(theta, passing) if rough else theta
    return even


def _smoothed(segment: Segment, name: str, normal: Array) -> Array:
    """Noise of a column from standard normal numbers [n]; that of a smoothed angle is smoothed, and
    that of an integrated speed is a random walk, none here where the speed is rounded.
    """
    width = segment.sensors.parabola if name == "theta_mech_rad" else 1
    speed = segment.sensors.speed
    if name == "theta_mech_rad" and speed is not None:
        white = 0.0 if speed.step_rad_s else speed.noise_rad_s
        return _integrated(segment, white * normal)
    if width == 1:
        return _white(segment, name) * normal
    smooth = parabolas(normal, width)
    return _white(segment, name) / math.sqrt(2.25 / width) * smooth


def _white(segment: Segment, name: str) -> float:
    """Standard deviation of a column's noise, without the rounding that follows the signal."""
    return _above_rounding(
        segment.sensors.noise.get(name, 0.0), segment.sensors.steps.get(name, 0.0)
    )


def _above_rounding(noise: float, step: float) -> float:
    """What a noise is beside that of a rounding in steps, in their unit."""
    return math.sqrt(max(noise**2 - step**2 / 12.0, 0.0))


def _integrated(segment: Segment, speed_rad_s: Array) -> Array:
    """Angle [n, rad] of an error of a speed whose integral is the angle."""
    walk = segment.ts_s * np.cumsum(speed_rad_s)
    width = segment.sensors.parabola
    return walk if width == 1 else parabolas(walk, width)


def _shifts(segment: Segment, count: int, seed: int) -> dict[str, Array]:
    """Parts of a step [count] by which coarse signals are moved to be rounded anew.

    They are evenly spread, since the error of a steady signal depends on the shift alone, and every
    signal has them in an order of its own.
    """
    even = (np.arange(count) + 0.5) / count - 0.5
    generator = np.random.default_rng([seed, count])
    return {name: generator.permutation(even) for name in segment.sensors.steps}
