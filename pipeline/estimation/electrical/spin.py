"""The voltages of a rotor that spins with open terminals, and their space vector."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.estimation.electrical.terminals import PAIRS, bridged
from pipeline.physics.units import TURN_RAD
from pipeline.physics.windings import PAIR_AXES_RAD
from pipeline.records.capture import Array, Capture

Complex = NDArray[np.complex128]


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
