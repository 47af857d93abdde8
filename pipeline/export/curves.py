"""What simulators hold of friction and cogging, from the tables of a motor's effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records.capture import Array
from pipeline.records.effect_table import EffectTable

OF_PEAK = 0.02
"""Share of a table's peak by which a simulator's own form may miss it and still hold it."""


@dataclass(frozen=True, slots=True)
class Bump:
    """Friction above Coulomb's at low speed: `excess_nm` exp(−(ω/`speed_rad_s`)²)."""

    excess_nm: float
    speed_rad_s: float
    miss_nm: float


def bump_of(table: EffectTable) -> Bump | None:
    """A friction curve as a bump at low speed, with the largest miss; None for any other curve.

    Parameters
    ----------
    table
        Drag over speed.

    Returns
    -------
    Bump or None
        None where the curve is not odd in speed or does not fall with it.

    """
    speed, drag = _odd_half(table)
    if drag is None or np.any(np.diff(drag) > OF_PEAK * drag[0]) or drag[-1] > 0.5 * drag[0]:
        return None
    tried = np.geomspace(speed[1], speed[-1], 400)
    bumps = drag[0] * np.exp(-((speed / tried[:, None]) ** 2))
    errors = np.sqrt(((bumps - drag) ** 2).sum(axis=1))
    best = int(errors.argmin())
    return Bump(float(drag[0]), float(tried[best]), float(np.abs(bumps[best] - drag).max()))


def drag_polynomial(table: EffectTable) -> Array | None:
    """Coefficients [3] of c₀ ω + c₁ ω |ω| + c₂ ω³ through a curve of drag; None if it misses.

    Parameters
    ----------
    table
        Drag over speed.

    Returns
    -------
    array [3] or None
        c₀, c₁, c₂ of c₀ ω + c₁ ω|ω| + c₂ ω³ [N·m, rad/s]; None where it misses the curve by more
        than `OF_PEAK` of its peak, or the other sense is another curve.

    """
    speed, drag = _odd_half(table)
    if drag is None:
        return None
    even = np.linspace(0.0, speed[-1], 200)[1:]
    wanted = np.interp(even, speed, drag)
    columns = np.stack([even, even**2, even**3], axis=1)
    scale = columns.max(axis=0)
    coefficients = np.linalg.lstsq(columns / scale, wanted, rcond=None)[0] / scale
    missed = np.abs(columns @ coefficients - wanted).max()
    return coefficients if missed <= OF_PEAK * np.abs(wanted).max() else None


def _odd_half(table: EffectTable) -> tuple[Array, Array | None]:
    """Speeds above zero and the drag there; None where the other sense is another curve."""
    speed = np.array(table.axes["omega_mech_rad_s"])
    values = np.array(table.values)
    ahead, back = values[speed > 0.0], -values[speed < 0.0][::-1]
    odd = np.allclose(ahead, back, rtol=1e-6, atol=1e-9 * float(np.abs(values).max()))
    return speed[speed > 0.0], ahead if odd else None


@dataclass(frozen=True, slots=True)
class Wave:
    """One order of a torque over the angle: amplitude · sin(order · θ + phase).

    Attributes
    ----------
    order
        Waves a turn.
    amplitude_nm, phase_rad
        Of the wave.

    """

    order: int
    amplitude_nm: float
    phase_rad: float


def waves(tables: Sequence[EffectTable]) -> list[Wave]:
    """Orders of the torque on the shaft, the largest first.

    Parameters
    ----------
    tables
        Drag over the angle of the shaft; the torque on the shaft is minus their sum.

    """
    amplitudes: dict[int, complex] = {}
    for table in tables:
        values = np.array(table.values)
        spectrum = -2.0 * np.fft.rfft(values) / values.size
        peak = np.abs(spectrum[1:]).max(initial=0.0)
        for order in np.flatnonzero(np.abs(spectrum) > 1e-9 * peak):
            if order:
                amplitudes[int(order)] = amplitudes.get(int(order), 0.0) + complex(spectrum[order])
    # Re(c exp(jkθ)) = |c| sin(kθ + arg c + π/2)
    each = [
        Wave(order, abs(c), math.remainder(math.atan2(c.imag, c.real) + math.pi / 2, math.tau))
        for order, c in amplitudes.items()
    ]
    return sorted(each, key=lambda wave: -wave.amplitude_nm)
