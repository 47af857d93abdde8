"""Back-EMF of a spinning rotor, timed by its own phase.

Speed and amplitude both come from the voltages, v = j omega psi e^{j theta}: flux is amplitude
over the rate of the voltage's own phase, so an eccentric, quantised or lagging angle sensor does
not enter. The angle, where there, only counts pole pairs and gives the offset to the d axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.terminals import PAIRS, bridged
from pipeline.estimation.policy import policy
from pipeline.numerics.harmonics import hermite, whole_cycles
from pipeline.numerics.least_squares import autocorrelation_time
from pipeline.numerics.plateaus import true_runs, white_noise_sigma
from pipeline.physics.units import TURN_RAD
from pipeline.physics.windings import PAIR_AXES_RAD
from pipeline.records.capture import Array, Capture

Complex = NDArray[np.complex128]
Rows = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Channel:
    """One measured voltage: v = gain Re(x e^{−j angle}) of the space vector x.

    Attributes
    ----------
    name
        Column of the capture.
    v_v
        Samples [n, V].
    gain
        √3 for a line voltage, 1 for a phase voltage.
    angle_rad
        Electrical angle of the channel's axis from phase a.

    """

    name: str
    v_v: Array
    gain: float
    angle_rad: float


@dataclass(frozen=True, slots=True)
class Spin:
    """The voltages of one open-circuit capture on one clock.

    Attributes
    ----------
    t_s
        Sampling instants [n, s].
    channels
        One or more voltages.
    theta_rad, omega_rad_s
        Mechanical angle and speed [n], None where not recorded.
    temp_degc
        Temperature of the magnets or near them [n], None where not recorded.

    """

    t_s: Array
    channels: tuple[Channel, ...]
    theta_rad: Array | None
    omega_rad_s: Array | None
    temp_degc: Array | None

    def vector_v(self, centred: bool = True) -> Complex:
        """The space vector of the voltages, by least squares over the channels.

        One voltage alone gives the vector of a rotor that turns in the positive sense: the part of
        its spectrum at positive frequencies (analytic signal).

        Parameters
        ----------
        centred
            Whether each channel's mean is taken off, which whole turns make its offset.

        Returns
        -------
        array [n, V], complex
            Phase to star point.

        Raises
        ------
        ValueError
            There are several channels, none independent of the others.

        References
        ----------
        Gabor, J. IEE 93(26), 1946, 429, doi:10.1049/ji-3-2.1946.0074 (analytic signal).

        """
        if len(self.channels) == 1:
            (only,) = self.channels
            mean = 0.0 if centred else float(np.mean(only.v_v))
            turn = np.exp(1j * only.angle_rad) / only.gain
            return (_analytic(self.t_s, only.v_v) + mean) * turn
        rows = np.array([c.gain * np.exp(1j * c.angle_rad) for c in self.channels])
        design = np.column_stack([rows.real, rows.imag])
        if np.linalg.matrix_rank(design, tol=1e-6) < 2:
            raise ValueError("the voltages are multiples of one another")
        inverse = np.linalg.pinv(design)
        vector: Complex = np.zeros(self.t_s.size, dtype=np.complex128)
        for weight, channel in zip((inverse[0] + 1j * inverse[1]), self.channels, strict=True):
            vector += weight * (channel.v_v - (np.mean(channel.v_v) if centred else 0.0))
        return vector


def _analytic(t_s: Array, values: Array) -> Complex:
    """The analytic signal [n] of samples less their mean, by way of an even clock."""
    from scipy.signal import hilbert

    even = np.linspace(t_s[0], t_s[-1], t_s.size)
    signal = hilbert(np.interp(even, t_s, values - np.mean(values)))
    return np.interp(t_s, even, signal.real) + 1j * np.interp(t_s, even, signal.imag)


def read_spin(capture: Capture, temp_column: str | None) -> Spin:
    """The voltages of a capture: line to line where two are there, else phase.

    Parameters
    ----------
    capture
        Of a spin with open terminals.
    temp_column
        The temperature that the magnets are taken at, None where none was logged.

    Returns
    -------
    Spin
        On the clock of the voltages, rows with NaN left out; a temperature with gaps is bridged.

    Raises
    ------
    KeyError
        No terminal voltage is there.

    """
    lines = {f"v{p}_v": (math.sqrt(3.0), PAIR_AXES_RAD[p]) for p in PAIRS}
    phases = {f"v{p}_v": (1.0, k * TURN_RAD / 3.0) for k, p in enumerate("abc")}
    chosen = next(
        (
            {n: g for n, g in kind.items() if capture.has(n)}
            for kind in (lines, phases)
            if sum(capture.has(n) for n in kind) >= 2
        ),
        {n: g for n, g in (lines | phases).items() if capture.has(n)},
    )
    if not chosen:
        raise KeyError(f"{capture.path} holds no terminal voltage")
    others = [n for n in ("theta_mech_rad", "omega_mech_rad_s") if capture.has(n)]
    if temp_column is not None:
        others.append(temp_column)
    columns = capture.finite("t_s", *chosen, *others, needed=("t_s", *chosen))
    channels = tuple(Channel(n, columns[n], *chosen[n]) for n in chosen)
    return Spin(
        columns["t_s"],
        channels,
        columns.get("theta_mech_rad"),
        columns.get("omega_mech_rad_s"),
        None if temp_column is None else bridged(columns["t_s"], columns[temp_column]),
    )


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows of one steady speed, with the phase of the voltage itself.

    Attributes
    ----------
    rows
        Indices [m] into the arrays of the spin.
    phase_rad
        Smoothed electrical phase of the voltage vector [m, rad].
    omega_elec_rad_s
        Its rate [m, rad/s].

    """

    rows: NDArray[np.intp]
    phase_rad: Array
    omega_elec_rad_s: Array

    @property
    def speed_rad_s(self) -> float:
        """Mean electrical speed, signed by the sense of a to b to c."""
        return float(self.omega_elec_rad_s.mean())

    @property
    def trend(self) -> float:
        """Relative change of the speed from the first to the last quarter."""
        quarter = max(self.rows.size // 4, 1)
        ends = self.omega_elec_rad_s[-quarter:].mean() - self.omega_elec_rad_s[:quarter].mean()
        return abs(float(ends) / self.speed_rad_s)


def steady_stretches(spin: Spin, change: float) -> list[Stretch]:
    """Stretches of at least three cycles in which the speed stays within `change`, relative.

    Where they hold less than a fifth of the spinning rows, the speed is taken as it comes and
    `change` is widened; ramps are left out where steady speeds are there.

    Parameters
    ----------
    spin
        The voltages of one capture.
    change
        Largest change of the speed within a stretch [1, relative].

    Returns
    -------
    list of Stretch
        Rows with the voltage's own phase [rad] and its rate [rad/s].

    """
    for allowed in (change, policy().back_emf.widened * change, math.inf):
        stretches, spinning = _stretches(spin, allowed)
        if sum(s.rows.size for s in stretches) >= policy().back_emf.least_share * spinning:
            break
    steady = [s for s in stretches if s.trend <= 0.5 * change]
    return steady or stretches


def _stretches(spin: Spin, change: float) -> tuple[list[Stretch], int]:
    """The stretches and the number of spinning rows.

    The phase of the space vector is averaged over whole cycles, which removes harmonics and
    offsets, and joined by a smooth curve whose slope is the speed.
    """
    vector = spin.vector_v()
    size = np.abs(vector)
    sigma = math.hypot(white_noise_sigma(vector.real), white_noise_sigma(vector.imag))
    least, share = policy().back_emf.standing_sigmas * sigma, policy().back_emf.standing_share
    moving = size > max(least, share * float(np.quantile(size, 0.99)))
    stretches: list[Stretch] = []
    for start, stop in _unbroken(spin.t_s, vector, moving):
        unwrapped = np.unwrap(np.angle(vector[start:stop]))
        for first, last in _one_way(unwrapped):
            rows = np.arange(start + first, start + last)
            smooth = _smooth_phase(spin.t_s[rows], unwrapped[first:last])
            if smooth is not None:
                stretches += _split(rows, *smooth, change)
    return stretches, int(np.count_nonzero(moving))


def _unbroken(t_s: Array, vector: Complex, moving: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Runs of moving rows, split where rows are missing for more than half a cycle.

    Across such a gap the phase cannot be unwrapped. Half a cycle is seen by nine tenths of the
    advances from row to row.
    """
    consecutive = np.flatnonzero(moving[1:] & moving[:-1])
    if not consecutive.size:
        return
    advance = np.abs(np.angle(vector[consecutive + 1] * np.conj(vector[consecutive])))
    usual_s, after_s = float(np.median(np.diff(t_s)[consecutive])), np.diff(t_s)
    missed = float(np.quantile(advance, 0.9)) * after_s > math.pi * usual_s
    gaps = (
        np.flatnonzero(missed & (after_s > 1.5 * usual_s)) + 1 if usual_s > 0.0 else consecutive[:0]
    )
    for start, stop in true_runs(moving):
        inner = gaps[(gaps > start) & (gaps < stop)]
        edges = [start, *(int(k) for k in inner), stop]
        yield from pairwise(edges)


def _one_way(phase: Array) -> list[tuple[int, int]]:
    """Rows start..stop that split a phase [n] wherever it turns back by a cycle or more."""
    open_pieces, pieces = [(0, phase.size)], []
    while open_pieces:
        start, stop = open_pieces.pop()
        forward = phase[start:stop] * (1.0 if phase[stop - 1] >= phase[start] else -1.0)
        back = np.maximum.accumulate(forward) - forward
        low = int(np.argmax(back))
        if back[low] < TURN_RAD:
            pieces.append((start, stop))
            continue
        high = int(np.argmax(forward[: low + 1]))
        edges = sorted({start, start + high, start + low, stop})
        open_pieces += pairwise(edges)
    return sorted(pieces)


def _smooth_phase(t_s: Array, phase: Array) -> tuple[Array, Array, Rows] | None:
    """Phase and its rate [n] from means over whole cycles, and the cycle's number of each row."""
    if phase.size < 12:
        return None
    cuts = whole_cycles(phase)
    cuts = cuts[np.concatenate([[True], np.diff(cuts) >= 4])]
    if cuts.size < policy().back_emf.least_cycles + 1:
        return None
    counts = np.diff(cuts)
    mid_t = np.add.reduceat(t_s, cuts[:-1])[: counts.size].copy()
    mid_p = np.add.reduceat(phase, cuts[:-1])[: counts.size].copy()
    last = slice(int(cuts[-2]), int(cuts[-1]))
    mid_t[-1], mid_p[-1] = t_s[last].sum(), phase[last].sum()
    value, slope = hermite(mid_t / counts, mid_p / counts, t_s)
    number = np.clip(np.searchsorted(cuts, np.arange(phase.size), side="right") - 1, -1, None)
    number[cuts[-1] :] = -1
    return value, slope, number


def _split(rows: Rows, phase: Array, omega: Array, number: Rows, change: float) -> list[Stretch]:
    """Cuts a run where the speed leaves a band of ± `change` around its level."""
    cycles = int(number.max()) + 1
    inside = number >= 0
    speeds = np.bincount(number[inside], omega[inside], cycles) / np.bincount(
        number[inside], minlength=cycles
    )
    pieces, start = [], 0
    for stop in range(1, cycles + 1):
        level = float(speeds[start:stop].mean())
        if stop == cycles or abs(float(speeds[stop]) - level) > change * abs(level):
            first, last = _steady_core(speeds, start, stop)
            if last - first >= policy().back_emf.least_cycles:
                keep = np.flatnonzero((number >= first) & (number < last))
                pieces.append(Stretch(rows[keep], phase[keep], omega[keep]))
            start = stop
    return pieces


def _steady_core(speeds: Array, start: int, stop: int) -> tuple[int, int]:
    """The cycles between the ramps' last traces at both ends, less one cycle at each.

    A trace of a ramp is a speed that stands out of the scatter of the stretch's middle.
    """
    quarter = (stop - start) // 4
    middle = speeds[start + quarter : stop - quarter]
    level = float(np.median(middle))
    limit = 5.0 * 1.4826 * float(np.median(np.abs(middle - level))) + 1e-6 * abs(level)
    if stop - start < 2 * policy().back_emf.least_cycles + 2:
        return start, stop
    while start < stop and abs(float(speeds[start]) - level) > limit:
        start += 1
    while stop > start and abs(float(speeds[stop - 1]) - level) > limit:
        stop -= 1
    return start + 1, stop - 1


@dataclass(frozen=True, slots=True)
class StretchFlux:
    """Flux linkage and harmonics of one stretch.

    Attributes
    ----------
    psi_wb, u_psi_wb
        Amplitude of the fundamental over the speed, and its standard uncertainty [Wb].
    harmonics
        Complex harmonic relative to the fundamental, by order.
    u_harmonic
        Standard uncertainty of each component, real and imaginary [1].
    speed_elec_rad_s
        Mean electrical speed, signed by the phase order [rad/s].
    temp_degc
        Mean temperature; None where not recorded.
    amplitude_v
        Mean amplitude of the fundamental, phase peak [V].

    """

    psi_wb: float
    u_psi_wb: float
    harmonics: dict[int, complex]
    u_harmonic: float
    speed_elec_rad_s: float
    temp_degc: float | None
    amplitude_v: float


def flux_of(spin: Spin, stretch: Stretch, orders: Sequence[int]) -> StretchFlux:
    """Psi and harmonics of one stretch by least squares over the raw channels.

    v = omega sum_k c_k e^{j k phase}, k = 1, its mirror -1 (unequal gains, where several voltages
    are there) and -5, 7, -11, 13 ..., and an offset a channel; psi = |c_1|. Orders beyond the
    sampling rate are left out. The standard error counts correlated residuals by their
    autocorrelation time.

    Parameters
    ----------
    spin
        The voltages of one capture.
    stretch
        Rows of one steady speed.
    orders
        Harmonics that are fitted beside the fundamental.

    Returns
    -------
    StretchFlux
        Flux linkage [Wb], its standard error [Wb], and the relative complex harmonics [1].

    """
    step = float(np.median(np.abs(np.diff(stretch.phase_rad))))
    mirror = [-1] if len(spin.channels) > 1 else []
    ranks = [1, *mirror] + [k if k % 6 == 1 else -k for k in orders if k * step < 0.8 * math.pi]
    omega = np.abs(stretch.omega_elec_rad_s)
    waves = [omega * np.exp(1j * k * stretch.phase_rad) for k in ranks]
    width = 2 * len(ranks)
    designs = _designs(spin, waves)
    total = designs[0].shape[1]
    normal, right = np.zeros((total, total)), np.zeros(total)
    for channel, design in zip(spin.channels, designs, strict=True):
        normal += design.T @ design
        right += design.T @ channel.v_v[stretch.rows]
    scale = np.sqrt(np.diag(normal))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True)
    inverse = inverse / np.outer(scale, scale)
    solution = inverse @ right
    residuals = [
        c.v_v[stretch.rows] - d @ solution for c, d in zip(spin.channels, designs, strict=True)
    ]
    tau = float(np.mean([autocorrelation_time(r) for r in residuals]))
    dof = max(stretch.rows.size * len(residuals) - total, 1)
    variance = float(sum(r @ r for r in residuals)) / dof * tau
    c = solution[:width:2] + 1j * solution[1:width:2]
    psi = abs(c[0])
    slope = np.array([c[0].real, c[0].imag]) / psi
    u_psi = math.sqrt(variance * float(slope @ inverse[:2, :2] @ slope))
    temps = None if spin.temp_degc is None else spin.temp_degc[stretch.rows]
    return StretchFlux(
        psi,
        u_psi,
        {abs(k): complex(c[n] / c[0]) for n, k in enumerate(ranks) if abs(k) > 1},
        u_psi / psi,
        stretch.speed_rad_s,
        None if temps is None or not np.isfinite(temps).any() else float(np.nanmean(temps)),
        float(psi * omega.mean()),
    )


def _designs(spin: Spin, waves: Sequence[Array]) -> list[Array]:
    """Design [n, 2 waves + channels] of each channel: Re, -Im of each wave [n], and its offset."""
    width = 2 * len(waves)
    designs = []
    for index, channel in enumerate(spin.channels):
        design = np.zeros((waves[0].size, width + len(spin.channels)))
        turn = channel.gain * np.exp(-1j * channel.angle_rad)
        for k, wave in enumerate(waves):
            design[:, 2 * k] = (turn * wave).real
            design[:, 2 * k + 1] = -(turn * wave).imag
        design[:, width + index] = 1.0
        designs.append(design)
    return designs


def electrical_per_mechanical(spin: Spin, stretches: Sequence[Stretch]) -> tuple[float, bool]:
    """Signed electrical over mechanical speed, and whether it rests on the angle.

    From the angle where there, else the bench's speed; nan where neither is. Positive where a
    positive rotation runs through a, b, c in this order.

    Parameters
    ----------
    spin
        The voltages of one capture, with angle or speed where there.
    stretches
        Its steady speeds.

    Returns
    -------
    ratio : float
        Cycles a turn [1].
    by_angle : bool
        False where it rests on the bench's speed.

    Notes
    -----
    By the angle it is the slope of the vector's phase, as measured, on the angle of the same rows,
    weighed by the stretches' travel. A smoothed phase follows no speed that changes within a cycle,
    and its ends are off by what they lack of one: 1 % over a sixth of a turn.

    """
    electrical = mechanical = 0.0
    vector = spin.vector_v(centred=False) if len(spin.channels) > 1 else None
    for stretch in stretches:
        if spin.theta_rad is not None:
            phase, theta = stretch.phase_rad, spin.theta_rad[stretch.rows]
            if vector is not None:
                turning = np.exp(1j * phase)
                wave = vector[stretch.rows]
                offset, _ = np.linalg.lstsq(
                    np.column_stack([np.ones_like(turning), turning]), wave, rcond=None
                )[0]
                phase = phase + np.angle((wave - offset) / turning)
            finite = np.isfinite(theta)
            if np.count_nonzero(finite) < 2:
                continue
            turned = float(theta[finite][-1] - theta[finite][0])
            along = theta[finite] - theta[finite].mean()
            electrical += float(along @ phase[finite] / (along @ along)) * abs(turned)
            mechanical += abs(turned)
        elif spin.omega_rad_s is not None:
            speed = float(np.nanmean(spin.omega_rad_s[stretch.rows]))
            electrical += stretch.speed_rad_s * math.copysign(1.0, speed) * stretch.rows.size
            mechanical += abs(speed) * stretch.rows.size
    ratio = electrical / mechanical if mechanical > 0.0 else math.nan
    return ratio, spin.theta_rad is not None
