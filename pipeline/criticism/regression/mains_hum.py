"""Mains hum in the recordings: found at its own frequencies, and taken as noise from then on.

A line at 50 or 60 Hz, or a harmonic, that stands out of the residuals of several captures, whatever
the shaft does there, is the building's and not the machine's. Every capture may then have it, of
that size and of any phase.

Reference: Kay, Fundamentals of Statistical Signal Processing II (1998), section 7.6.3, a sinusoid
of unknown phase in noise.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.criticism.data.segment import Segment, clock, with_lines
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Indices, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.regression import MainsHum
from pipeline.criticism.residuals.residual import disturbed, residual

LINES_HZ = (50.0, 60.0, 100.0, 120.0, 150.0, 180.0)
"""Mains of 50 and 60 Hz, and their second and third harmonics."""
_BESIDE = (-11, -9, -7, -5, 5, 7, 9, 11)
"""Bins at either side that a line is held against: from the fifth on, clear of two Hann windows."""
_LOBE = 3
"""Bins from a peak to where the skirt of a Hann window is low: in 200 ms, 50 and 60 Hz are two."""
_FINER = 2
"""Points of the spectrum a bin, by zeros behind the record: between bins a Hann window's line
loses up to 1.4 dB, between these 0.35 dB."""


@dataclass(frozen=True, slots=True)
class Hum:
    """A line that the recordings of one signal share: frequency [Hz], rms [the signal's unit].

    `kind` is that of the equations: terminals, drive and slow turn have instruments of their own.

    Attributes
    ----------
    kind
        Of the equations: terminals, drive and slow turn have instruments of their own.
    signal
        The recorded signal.
    freq_hz
        Frequency.
    rms
        Rms [unit of the signal].

    """

    kind: str
    signal: str
    freq_hz: float
    rms: float


def hum_of(segments: Sequence[Segment], model: Model, values: Values) -> tuple[Hum, ...]:
    """The mains lines of every signal, from the residuals of a rough fit.

    Parameters
    ----------
    segments
        The segments.
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    tuple of Hum
        Empty where no line stands out.

    Notes
    -----
    A line is present if its power is many times that beside it in enough captures, in whatever
    signals. A signal then has the line if it stands out there in half of the captures that can show
    it. A capture cannot if an order of its turning shaft, or the rate of a map's levels, is too
    near.

    """
    policy = model.policy.mains_hum
    powers: dict[tuple[str, str, float], list[tuple[float, float]]] = defaultdict(list)
    clear: dict[float, set[str]] = defaultdict(set)
    for segment in segments:
        spectrum = _Spectrum.of(segment, policy)
        if segment.weak is None or not spectrum.weight.any():
            continue
        lines = [
            f
            for f in LINES_HZ
            if spectrum.duration_s * f >= policy.cycles
            and policy.samples * f * segment.ts_s < 1.0
            and not _turns_at(segment, f, policy)
            and not spectrum.repeats_at(f)
        ]
        for channel, one in _as_sensed(segment, model, values).items():
            most = (policy.largest * _rated_size(channel, model.machine)) ** 2
            for freq, pairs in zip(lines, spectrum.lines(one, lines, most), strict=True):
                powers[segment.kind, channel, freq].append(pairs)
                if pairs[0] > policy.stands_out * pairs[1]:
                    clear[freq].add(segment.capture)
    ratios = {
        key: np.array([line / beside for line, beside in pairs]) for key, pairs in powers.items()
    }
    common = {freq for freq, captures in clear.items() if len(captures) >= policy.captures}
    return tuple(
        Hum(*key, math.sqrt(float(np.median([line for line, _ in powers[key]]))))
        for key, ratio in ratios.items()
        if key[-1] in common and float(np.median(ratio)) > policy.seen
    )


def with_hum(
    segments: Sequence[Segment], hums: Sequence[Hum], model: Model, values: Values
) -> tuple[Segment, ...]:
    """The segments with the lines that their channels may have.

    Parameters
    ----------
    segments
        The segments.
    hums
        The lines.
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    tuple of Segment
        A current sensor may pick up as much as a voltage sensor, both in multiples of their noise;
        the model determines what that does, as its share of a torque grows with the current.

    """
    return tuple(_humming(segment, hums, model, values) for segment in segments)


def hum_notes(hums: Sequence[Hum]) -> tuple[str, ...]:
    """A note on every signal with mains hum in it.

    Parameters
    ----------
    hums
        The lines.

    """
    notes = []
    for signal in dict.fromkeys(hum.signal for hum in hums):
        of_signal = [hum for hum in hums if hum.signal == signal]
        lines = ", ".join(f"{freq:g}" for freq in sorted({hum.freq_hz for hum in of_signal}))
        rms = max(hum.rms for hum in of_signal)
        notes.append(f"mains hum in {signal} at {lines} Hz, {rms:.2g} rms: taken as noise")
    return tuple(notes)


def _humming(segment: Segment, hums: Sequence[Hum], model: Model, values: Values) -> Segment:
    weak = segment.weak
    present = [h for h in hums if h.kind == segment.kind and h.signal in _sensors(segment)]
    if weak is None or not present:
        return segment
    lines = []
    for hum in present:
        waves = hum.rms * _waves(segment, hum.freq_hz)
        if hum.signal not in segment.channels:
            lines.append(disturbed(segment, weak, model, values, hum.signal, waves))
            continue
        projected_waves = np.zeros((2, len(segment.channels), weak.starts.size, weak.orders.size))
        projected_waves[:, segment.channels.index(hum.signal)] = weak.project(waves)
        lines.append(projected_waves)
    for name, rms, freq in _in_currents(segment, present):
        waves = rms * _waves(segment, freq)
        lines.append(disturbed(segment, weak, model, values, name, waves))
    return with_lines(segment, np.concatenate(lines))


def _sensors(segment: Segment) -> tuple[str, ...]:
    """Recorded signals that hum is in: the channels, or what they are made of."""
    names = equation_of(segment).sensing.sensors
    return tuple(name for name in names if name in segment.recorded) or segment.channels


def _as_sensed(segment: Segment, model: Model, values: Values) -> Mapping[str, Array]:
    """Residual [n] of every sensor; what the rotor's frame turns at its speed, turned back."""
    residuals = residual(segment, model, values)
    sensed = equation_of(segment).sensing.sensed
    if sensed is not None:
        return sensed(segment, residuals, model, values)
    return dict(zip(segment.channels, residuals, strict=True))


def _in_currents(segment: Segment, hums: Sequence[Hum]) -> Iterator[tuple[str, float, float]]:
    """Name, rms [A] and frequency of what the current sensors may have of a voltage's lines."""
    sensed = [
        h for h in hums if segment.sensors.noise.get(h.signal, 0.0) > 0.0 and "_v" in h.signal
    ]
    for freq in sorted({h.freq_hz for h in sensed}):
        times = max(h.rms / segment.sensors.noise[h.signal] for h in sensed if h.freq_hz == freq)
        for name, sigma in segment.sensors.noise.items():
            if sigma > 0.0 and name.startswith("i"):
                yield name, times * sigma, freq


def _waves(segment: Segment, freq_hz: float) -> Array:
    """Cosine and sine [2, n] of a line over a segment, of an rms of one."""
    turn = 2.0 * math.pi * freq_hz * clock(segment)
    return math.sqrt(2.0) * np.stack([np.cos(turn), np.sin(turn)])


@dataclass(frozen=True, slots=True)
class _Spectrum:
    """Where a segment's samples stand on an even clock of `bins` periods: `runs` without a gap,
    `place` [n] of every sample; `weight` [n] is a Hann window over each run, and over the whole.
    """

    ts_s: float
    bins: int
    runs: tuple[slice, ...]
    place: Indices
    weight: Array
    policy: MainsHum

    @classmethod
    def of(cls, segment: Segment, policy: MainsHum) -> _Spectrum:
        """Of the segment's own clock; what is beside a gap is of no equation, and hardly counts."""
        time = clock(segment)
        place = np.rint((time - time[0]) / segment.ts_s).astype(np.int64)
        ends = [0, *(np.flatnonzero(np.diff(place) > 1) + 1).tolist(), place.size]
        weight = np.zeros(place.size)
        for first, last in pairwise(ends):
            weight[first:last] = np.hanning(last - first + 2)[1:-1]
        runs = tuple(slice(*edges) for edges in pairwise(ends))
        weight *= np.hanning(int(place[-1]) + 3)[1:-1][place]
        return cls(segment.ts_s, int(place[-1]) + 1, runs, place, weight, policy)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return self.bins * self.ts_s

    def repeats_at(self, freq_hz: float) -> bool:
        """Whether this frequency is a multiple of the rate of the runs: whatever is alike after
        every step of a test makes a line there.
        """
        starts = self.place[[run.start for run in self.runs]]
        if starts.size < self.policy.captures:
            return False
        gaps = np.diff(starts)
        usual = float(np.median(gaps))
        if np.mean(np.abs(gaps - usual) < self.policy.even_share * usual) < 0.5:
            return False
        cycles = freq_hz * usual * self.ts_s
        return abs(cycles - round(cycles)) * starts.size < self.policy.near_bins

    def lines(
        self, signal: Array, freqs_hz: Sequence[float], most: float
    ) -> list[tuple[float, float]]:
        """Mean square of each line in a signal [n], and of what lies beside it.

        A peak is no line if its size or phase changes on the way, if it is more than `most`, or if
        it is the skirt of a stronger one beside it. Its mean square is then that beside it.
        """
        flat = self.weight * self._about_its_mean(signal)
        whole = np.zeros(_FINER * self.bins)
        whole[self.place] = flat
        power = 2.0 * (np.abs(np.fft.rfft(whole)) / self.weight.sum()) ** 2
        powers = []
        for freq in freqs_hz:
            middle = round(_FINER * freq * self.duration_s)
            beside = middle + _FINER * np.array(_BESIDE)
            beside = beside[(beside > 0) & (beside < power.size)]
            level = max(float(np.median(power[beside])), 1e-300)
            first = middle - _FINER
            top = first + int(np.argmax(power[first : middle + _FINER + 1]))
            line = float(power[top])
            one_sine = line / (line + self.policy.parts * level)
            skirt = power[max(middle - _LOBE * _FINER, 0) : middle + _LOBE * _FINER + 1].max()
            if (
                skirt > min(line, most)
                or self._share(flat, top) < self.policy.steady_share * one_sine
            ):
                line = level
            powers.append((line, level))
        return powers

    def _about_its_mean(self, signal: Array) -> Array:
        """A signal [n] less the mean of each run that holds two cycles of any line. With the gaps
        between them, runs of different means would make lines.
        """
        level = np.full_like(signal, float(np.average(signal, weights=self.weight)))
        for run in self.runs:
            if (run.stop - run.start) * self.ts_s * LINES_HZ[0] > self.policy.cycles_a_run:
                level[run] = float(np.average(signal[run], weights=self.weight[run] + 1e-12))
        return signal - level

    def _share(self, flat: Array, line: int) -> float:
        """Share of a line's power, summed over eight parts of a recording, that one sine has.

        About line / (line + 8 level) where there is one, an eighth where there is none.
        """
        wave = flat * np.exp(-2j * np.pi * line / (_FINER * self.bins) * self.place)
        part = np.minimum(self.place * self.policy.parts // self.bins, self.policy.parts - 1)
        size = np.bincount(part, self.weight, self.policy.parts)
        sums = np.bincount(part, wave.real, self.policy.parts) + 1j * np.bincount(
            part, wave.imag, self.policy.parts
        )
        nonzero = size > 0.0
        power = float((np.abs(sums[nonzero]) ** 2 / size[nonzero]).sum())
        return float(np.abs(sums.sum()) ** 2 / size.sum()) / max(power, 1e-300)


def _rated_size(channel: str, machine: Machine) -> float:
    """The machine's own voltage or torque [the channel's unit]; of other signals no end."""
    scale = {"v": "voltage_v", "nm": "torque_nm"}.get(channel.rsplit("_", 1)[-1], "")
    return machine.scales.get(scale, math.inf)


def _turns_at(segment: Segment, freq_hz: float, policy: MainsHum) -> bool:
    """Whether an order of a steadily turning shaft may make a line of this frequency."""
    theta = segment.recorded.get("theta_mech_rad")
    if theta is None:
        return False
    # a log that was thinned to windows which overlap has rows twice
    time, once = np.unique(clock(segment), return_index=True)
    speed = np.gradient(theta[once], time) / (2.0 * math.pi)
    mean = float(np.abs(speed.mean()))
    duration = float(time[-1] - time[0])
    if mean * duration < 0.5 or float(speed.std()) > policy.speed_share * mean:
        return False
    order = freq_hz / mean
    return (
        abs(order - round(order)) * mean * duration < policy.near_bins
        and order < policy.highest_order
    )
