"""Flux linkage and harmonics of a spinning rotor, timed by the voltage's own phase.

Speed and amplitude both come from the voltages, v = j omega psi e^{j theta}: flux is amplitude
over the rate of the voltage's own phase, so an eccentric, quantised or lagging angle sensor does
not enter. The angle, where there, counts pole pairs and gives the offset to the d axis; of a speed
that is not steady it is the better clock where it leaves less.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.spin import Complex, Spin
from pipeline.estimation.electrical.steady_speed import Stretch
from pipeline.numerics.least_squares import autocorrelation_time
from pipeline.numerics.weak_rows import smooth_speed
from pipeline.physics.pole_pairs import pole_pairs_from
from pipeline.records.capture import Array


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
    designs = _designs(spin, [omega * np.exp(1j * k * stretch.phase_rad) for k in ranks])
    samples = [channel.v_v[stretch.rows] for channel in spin.channels]
    solution, inverse = _least_squares(designs, samples)
    residuals = [v - design @ solution for v, design in zip(samples, designs, strict=True)]
    tau = float(np.mean([autocorrelation_time(r) for r in residuals]))
    dof = max(stretch.rows.size * len(residuals) - solution.size, 1)
    variance = float(sum(r @ r for r in residuals)) / dof * tau
    width = 2 * len(ranks)
    c = solution[:width:2] + 1j * solution[1:width:2]
    psi = abs(c[0])
    slope = np.array([c[0].real, c[0].imag]) / psi
    u_psi = math.sqrt(variance * float(slope @ inverse[:2, :2] @ slope))
    temps = None if spin.temp_degc is None else spin.temp_degc[stretch.rows]
    ratios = {abs(k): complex(c[n] / c[0]) for n, k in enumerate(ranks) if abs(k) > 1}
    if len(spin.channels) == 1 and _backward(spin, stretch):
        ratios = {k: ratio.conjugate() for k, ratio in ratios.items()}
    return StretchFlux(
        psi,
        u_psi,
        ratios,
        u_psi / psi,
        stretch.speed_rad_s,
        None if temps is None or not np.isfinite(temps).any() else float(np.nanmean(temps)),
        float(psi * omega.mean()),
    )


def _backward(spin: Spin, stretch: Stretch) -> bool:
    """Whether the shaft turns backward, as far as it is recorded: one voltage alone does not tell,
    and is read as that of the positive sense, which mirrors the phases of its harmonics.
    """
    motion = spin.omega_rad_s if spin.theta_rad is None else np.gradient(spin.theta_rad)
    return motion is not None and float(np.nanmean(motion[stretch.rows])) < 0.0


def _least_squares(designs: Sequence[Array], samples: Sequence[Array]) -> tuple[Array, Array]:
    """Solution [k] over all channels, and the inverse [k, k] of their normal matrix."""
    total = designs[0].shape[1]
    normal, right = np.zeros((total, total)), np.zeros(total)
    for design, v in zip(designs, samples, strict=True):
        normal += design.T @ design
        right += design.T @ v
    scale = np.sqrt(np.diag(normal))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True)
    inverse = inverse / np.outer(scale, scale)
    return inverse @ right, inverse


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
            theta = spin.theta_rad[stretch.rows]
            phase = stretch.phase_rad if vector is None else _measured_phase(vector, stretch)
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


def by_angle(spin: Spin, stretch: Stretch, ratio: float) -> Stretch | None:
    """The same rows by the shaft's angle in place of the voltage's own phase.

    Parameters
    ----------
    spin
        The voltages of one capture, with angle where there.
    stretch
        Rows by the voltage's own phase.
    ratio
        Electrical over mechanical speed, signed (`electrical_per_mechanical`) [1].

    Returns
    -------
    Stretch or None
        None without an angle, or where the ratio is no number of pole pairs.

    Notes
    -----
    The voltage's phase is smoothed over a cycle, so a speed that changes within one, as by hand, is
    not in it: of the wave that it times a part is then lost.

    """
    if spin.theta_rad is None or pole_pairs_from(abs(ratio), 1.0).number is None:
        return None
    angle, times = spin.theta_rad[stretch.rows], spin.t_s[stretch.rows]
    if not np.isfinite(angle).all():
        return None
    phase = round(ratio) * angle
    offset = np.angle(np.exp(1j * (stretch.phase_rad - phase)).sum())
    width_s = max(0.005, 10.0 * float(np.median(np.diff(times))))
    rate = round(ratio) * smooth_speed(times, angle, width_s)
    return Stretch(stretch.rows, phase + offset, rate)


def _measured_phase(vector: Complex, stretch: Stretch) -> Array:
    """Phase [m, rad] of the voltage vector [n, V] as measured, its offset taken off."""
    turning = np.exp(1j * stretch.phase_rad)
    wave = vector[stretch.rows]
    offset, _ = np.linalg.lstsq(
        np.column_stack([np.ones_like(turning), turning]), wave, rcond=None
    )[0]
    return stretch.phase_rad + np.angle((wave - offset) / turning)
