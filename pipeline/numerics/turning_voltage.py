"""How often a motor's voltage turns for a turn of its shaft, and where its magnet is.

A rotor with magnets induces a voltage that turns p times a turn, whatever a drive assumes.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.weak_rows import smooth_speed

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

HIGHEST = 64
"""Most pole pairs that are looked for."""
CLEAR = 2.0
"""The strongest count is at least so many times the next. What does not turn with the shaft gives
every count an amplitude by chance (Rayleigh); the largest of N of them is sqrt(2 ln N) of its unit,
and twice that has a chance of N^-4. A part of a turn, which leaves neighbours alike, fails too.
"""
MOST_ROWS = 100_000
"""Rows that a count is taken of; each has its angle, so that none is needed between them."""
BLOCKS = 2000
"""Most means that a recording is cut into; a few thousand say all, and take no time."""
ROUNDS = 4
"""Times that the frame is turned to where the back-EMF was found; a saliency is taken along it."""
SPEED_WINDOW_S = 0.005
"""Over which an angle's slope is taken: short against a motion, long against an encoder's steps."""


class MagnetAngle(NamedTuple):
    """Electrical angle of the magnet at the shaft's zero and its standard uncertainty [rad]."""

    offset_rad: float
    u_rad: float


def speed_of(t_s: Array, theta_mech_rad: Array) -> Array:
    """Speed [n, rad/s] of an angle [n, rad] at instants [n, s]."""
    period = float(np.median(np.diff(t_s)))
    return smooth_speed(t_s, theta_mech_rad, max(SPEED_WINDOW_S, 10.0 * period))


def turning_voltage(volts: Complex, theta_mech_rad: Array, omega_rad_s: Array) -> int | None:
    """The count at which a voltage turns with the shaft.

    Parameters
    ----------
    volts : array [n, V], complex
        Space vector in the stator's frame.
    theta_mech_rad, omega_rad_s : array [n]
        Angle and speed of the shaft.

    Returns
    -------
    int or None
        Turns of the voltage for a turn of the shaft, below zero against it; None where no count is
        clear.

    Notes
    -----
    The back-EMF is jω p ψ e^{j(pθ + φ)}, so that |Σ v ω e^{−jkθ}| is largest at k = p. Counts of
    either sense up to `HIGHEST` are compared; over less than a turn neighbours are not apart.

    """
    every = -(-volts.size // MOST_ROWS)
    volts, omega, theta = volts[::every], omega_rad_s[::every], theta_mech_rad[::every]
    weighted, back = volts * omega, np.exp(-1j * theta)
    sizes: dict[int, float] = {}
    for sense, step in ((1, back), (-1, back.conj())):
        turned = weighted.copy()
        for count in range(1, HIGHEST + 1):
            turned *= step
            sizes[sense * count] = abs(complex(np.mean(turned)))
    first, second = sorted(sizes, key=lambda k: -sizes[k])[:2]
    lead = sizes[first] / sizes[second] if sizes[second] > 0.0 else math.inf
    known = sizes[first] > 0.0 and lead >= CLEAR
    return first if known else None


def magnet_angle(
    volts: Complex,
    current: Complex,
    theta_mech_rad: Array,
    omega_rad_s: Array,
    pairs: int,
) -> MagnetAngle:
    """Where the back-EMF puts the magnet, against pole pairs times the shaft's angle.

    Parameters
    ----------
    volts, current : array [n], complex
        Space vectors in the stator's frame [V, A].
    theta_mech_rad, omega_rad_s : array [n]
        Angle and speed of the shaft.
    pairs
        Pole pairs.

    Returns
    -------
    MagnetAngle
        Its uncertainty is infinite where the recording does not part the back-EMF from what
        currents and a delay make.

    Notes
    -----
    In the magnet's frame, v' = jω k + z i' + jω (L i' + M i'*) + c ω² + d i'/|i'|, with real mean
    inductance L and saliency M, complex z (R and cross talk), c (a delay τ turns the back-EMF by
    pωτ, which is even in ω, where the angle is odd) and d (dead time). Where i' is held, complex
    inductances would be a back-EMF of any angle. The frame is turned until k is real. Means over
    blocks are fitted, whose changes of current are slow. Rows of one sense of rotation and one
    speed leave the angle open, and u says so. What is left counts with its correlation.

    """
    angle, found = 0.0, MagnetAngle(0.0, math.inf)
    for _ in range(ROUNDS):
        found = _beside(volts, current, pairs * theta_mech_rad + angle, omega_rad_s)
        if not math.isfinite(found.u_rad):
            return MagnetAngle(0.0, math.inf)
        angle += found.offset_rad
    return MagnetAngle(math.remainder(angle, 2.0 * math.pi), found.u_rad)


def _beside(volts: Complex, current: Complex, frame_rad: Array, omega_rad_s: Array) -> MagnetAngle:
    """Where the back-EMF is beside the direct axis of a frame [n, rad], whose axes the saliency is
    taken along.
    """
    size = max(1, volts.size // BLOCKS)
    rows = volts.size // size * size

    def means(values: NDArray[Any]) -> Complex:
        return values[:rows].reshape(-1, size).mean(axis=1)

    back = np.exp(-1j * frame_rad)
    i, omega = current * back, omega_rad_s
    modulus = np.abs(i)
    noise = 0.02 * float(modulus.max(initial=0.0)) + 1e-300
    along = np.column_stack([means(1j * omega * i), means(1j * omega * i.conj())])
    free = (1j * omega, i, omega**2 + 0j, i / np.hypot(modulus, noise))
    columns = np.column_stack([means(column) for column in free])
    y = means(volts * back)
    design = np.hstack([np.vstack([c.real, c.imag]) for c in (columns, 1j * columns, along)])
    fit = linear_fit(design, np.concatenate([y.real, y.imag]))
    width = len(free)
    flux = complex(fit.coefficients[0], fit.coefficients[width])
    if flux == 0.0 or not (math.isfinite(fit.u(0)) and math.isfinite(fit.u(width))):
        return MagnetAngle(0.0, math.inf)
    # the angle is the flux across its own direction, over its size
    across = np.zeros(design.shape[1])
    across[[0, width]] = -flux.imag / abs(flux) ** 2, flux.real / abs(flux) ** 2
    variance = float(across @ fit.covariance @ across)
    alike = max(autocorrelation_time(part) for part in np.split(fit.residuals, 2))
    return MagnetAngle(float(np.angle(flux)), math.sqrt(max(variance * alike, 0.0)))
