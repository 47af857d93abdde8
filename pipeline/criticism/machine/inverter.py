"""What an inverter's switching makes of the phase currents between two samples."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Array, Operating


def phase_ripple(x: Operating, eps_rad: Array) -> Array:
    """How far each phase current [3, n, A] is over its mean where its phase switches off, and under
    it where it switches on; 0 where the switching is not known.

    Parameters
    ----------
    x : Operating
        Currents and flux linkage [n] in the rotor frame, `pwm_s` and `vdc_v` of the inverter.
    eps_rad : Array
        Electrical angle [n, rad].

    Notes
    -----
    With centred pulses of widths d_k T and zero-sequence injection, d_k = ½ + (v_k − (max v +
    min v)/2)/V_dc, a phase that is off before its pulse has the voltage −(V_dc/3) Σ s_j, so

        Δ_k = T/(2 L) [V_dc/3 Σ_j max(d_j − d_k, 0) + v_k (1 − d_k)].

    References
    ----------
    Holmes & Lipo, Pulse Width Modulation for Power Converters (2003), ch. 6.
    doi:10.1109/9780470546284

    """
    inductance = 0.5 * (x.base["ld_h"] + x.base["lq_h"])
    size = np.shape(x.omega_rad_s)
    if not (x.pwm_s and x.vdc_v and inductance > 0.0) or x.psi_wb is None:
        return np.zeros((3, *size))
    induced = 1j * x.machine.pole_pairs * x.omega_rad_s * x.flux_wb
    stationary = (x.base["r_ohm"] * x.i_a + induced) * np.exp(1j * eps_rad)
    axes = np.exp(-2j * np.pi * np.arange(3) / 3.0)
    volts = (axes[:, None] * stationary).real
    middle = 0.5 * (volts.max(axis=0) + volts.min(axis=0))
    width = np.clip(0.5 + (volts - middle) / x.vdc_v, 0.0, 1.0)
    longer = np.maximum(width[None] - width[:, None], 0.0).sum(axis=1)
    swing: Array = x.vdc_v / 3.0 * longer + volts * (1.0 - width)
    return x.pwm_s / (2.0 * inductance) * swing
