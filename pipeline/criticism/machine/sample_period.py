"""Means of current and flux over a sample period, within which the voltage is held."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.criticism.machine.coenergy import base_flux
from pipeline.criticism.operating import Array, Complex, Operating, Values


def mean_current(x: Operating, values: Values) -> Operating:
    """Where the drops of a sample period act: at its mean current, not at the sampled one.

    Parameters
    ----------
    x
        State at the samples [n].
    values
        With the nuisances `ripple_slope` and `ripple_mean` [1].

    Returns
    -------
    Operating
        Currents and electrical angle of the period's mean; `x` itself without an inverter.

    Notes
    -----
    A voltage is held in the stationary frame while the rotor turns, so that the flux follows chords
    instead of arcs. So the current ripples, and its mean is that of another instant and is below
    its samples. The nuisances of the fit say by how much.

    """
    if not x.inverter or not (values["ripple_slope"] or values["ripple_mean"]):
        return x
    current, periods = x.i_a, values["ripple_slope"]
    _, below = ripple(x, values["ripple_mean"], values)

    def mean() -> tuple[Complex, Array, Array]:
        slope = np.zeros(current.shape, dtype=complex)
        slope[1:-1] = 0.5 * x.shaft.finer * (current[2:] - current[:-2])
        of_period = current - periods * slope - below
        return below, of_period.real, of_period.imag

    _, id_a, iq_a = x.once(current, ("mean", periods, id(below)), mean)
    return replace(x, id_a=id_a, iq_a=iq_a, eps_rad=_earlier(x, periods))


def _earlier(x: Operating, periods: float) -> Array:
    """Electrical angle [n, rad] so many sample periods ago."""
    omega = x.omega_rad_s

    def angle() -> tuple[Array, Array]:
        return omega, x.eps_rad - periods * (x.machine.pole_pairs * omega * x.ts_s)

    _, earlier = x.once(x.eps_rad, ("earlier", periods, id(omega)), angle)
    return earlier


def ripple(x: Operating, part: float, values: Values) -> tuple[Complex, Complex]:
    """What a period's means of flux and current are below the samples.

    Parameters
    ----------
    x
        State at the samples [n].
    part
        Share [1]: 1/12 for samples where the voltage changes, −1/24 for samples half a period from
        there.
    values
        Constants of the base.

    Returns
    -------
    flux [n, Wb], current [n, A]
        Complex, d + jq.

    Notes
    -----
    A voltage v that is held for T while the rotor turns by φ = ω_e T makes the flux ripple by
    v T φ; the means are `part` of that below, −j v T φ with v = R i + j ω_e ψ.

    """
    r_ohm, l_d, l_q = values["r_ohm"], values["ld_h"], values["lq_h"]
    hold_s, iq_a, omega = x.supply.hold_s, x.iq_a, x.omega_rad_s

    def made() -> tuple[Any, Array, tuple[Complex, Complex]]:
        turn = x.machine.pole_pairs * omega * hold_s
        flux = part * turn * (turn * base_flux(x, values) - 1j * hold_s * r_ohm * x.i_a)
        # what no capture determines is zero, or next to it
        least = max(l_d, l_q) / x.machine.policy.cutting.saliency or math.inf
        return (
            iq_a,
            omega,
            (flux, flux.real / max(l_d, least) + 1j * flux.imag / max(l_q, least)),
        )

    of_state = hold_s, id(iq_a), id(omega)
    name = ("ripple", part, r_ohm, l_d, l_q, values["psi_wb"], *of_state)
    return x.once(x.id_a, name, made)[2]
