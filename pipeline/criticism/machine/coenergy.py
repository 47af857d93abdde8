"""Flux linkage and torque of the air gap from one function.

With W the co-energy over 1.5,

    ψ = ∂W/∂i_d + j ∂W/∂i_q,       T = 1.5 p [Im(ψ* i) + ∂W/∂ε].

References: Woodson & Melcher, Electromechanical Dynamics (1968), ch. 3 (torque from co-energy).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from pipeline.criticism.effect import CoenergyHook, Hooks
from pipeline.criticism.operating import Array, Complex, Operating, Values

_STEP = 1e-30
"""Complex step [A, rad]: its square is below the rounding of anything."""


def base_flux(x: Operating, base: Mapping[str, float]) -> Complex:
    """Flux linkage of magnet and constant inductances.

    Parameters
    ----------
    x
        True state [n].
    base
        Constants of the base model.

    Returns
    -------
    array [n], complex
        L_d i_d + ψ_m + j L_q i_q [Wb].

    """
    return base["ld_h"] * x.id_a + base["psi_wb"] + 1j * base["lq_h"] * x.iq_a


def flux_of(current: Complex, base: Values) -> Complex:
    """Flux linkage that a current makes in the constant inductances.

    Parameters
    ----------
    current
        Complex [n, A].
    base
        Constants of the base model.

    Returns
    -------
    array [n], complex
        L_d i_d + j L_q i_q [Wb].

    """
    return base["ld_h"] * current.real + 1j * base["lq_h"] * current.imag


def effect_flux(effect: Hooks, x: Operating, q: Values) -> tuple[Complex, Array]:
    """Flux linkage of one effect from its co-energy W, by complex steps.

    Parameters
    ----------
    effect
        With or without a co-energy.
    x
        State of the machine [n].
    q
        Parameters of the effect by their short names.

    Returns
    -------
    flux [n], complex
        ∂W/∂i_d + j ∂W/∂i_q [Wb].
    slope [n]
        ∂W/∂ε [Wb·A], for the torque.

    Notes
    -----
    f'(x) = Im f(x + ih)/h is exact to rounding for an analytic f.

    References
    ----------
    Squire and Trapp, SIAM Review 40(1), 1998, 110, doi:10.1137/S003614459631241X.

    """
    hook = effect.coenergy
    shape = x.omega_rad_s.shape
    if hook is None:
        return np.zeros(shape, dtype=complex), np.zeros(shape)
    ones = np.ones(shape)

    def slope(moved: Operating) -> Array:
        return np.imag(hook(moved, q)) / _STEP * ones

    by_d = slope(replace(x, id_a=_stepped(x, x.id_a)))
    by_q = slope(replace(x, iq_a=_stepped(x, x.iq_a)))
    flux: Complex = by_d + 1j * by_q
    used = frozenset(name for name, value in q.items() if value)
    first = x.once(x.eps_rad, "first", x.one_sample)
    if not x.once(x.eps_rad, (hook, used), lambda: _turns(hook, first, q)):
        return flux, np.zeros(shape)
    return flux, slope(replace(x, eps_rad=_stepped(x, x.eps_rad)))


def unsampled_voltage(flux: Callable[[Operating], Complex], x: Operating) -> Complex:
    """Voltage of a flux that differences between far samples miss.

    Parameters
    ----------
    flux
        Flux linkage [n, Wb] of a state.
    x
        State of the machine [n].

    Returns
    -------
    array [n], complex
        d + jq [V]; zero but of snapshots between which the rotor turns far.

    Notes
    -----
    A vector that is held for h has the mean (ψ_end − ψ_begin)/h + jω (ψ_begin + ψ_end)/2. Samples
    show (ψ_(k+1) − ψ_(k−1))/2T + jω ψ_k.

    """
    if x.supply.hold_ends is None:
        return np.zeros(x.omega_rad_s.shape, dtype=complex)
    omega = x.machine.pole_pairs * x.omega_rad_s
    (begin_s, begin_a), (end_s, end_a) = x.supply.hold_ends
    begin, end = (
        flux(
            replace(
                x,
                id_a=x.id_a + more_a.real,
                iq_a=x.iq_a + more_a.imag,
                eps_rad=x.eps_rad + omega * later_s,
                cache={},
            )
        )
        for later_s, more_a in ((begin_s, begin_a), (end_s, end_a))
    )
    sampled = flux(x)
    held: Complex = (end - begin) / (end_s - begin_s) + 0.5j * omega * (begin + end)
    return held - np.gradient(sampled, x.ts_s) - 1j * omega * sampled


def _stepped(x: Operating, column: Array) -> Complex:
    """A column [n] of a state after its complex step; the same array for all effects."""

    def stepped() -> Complex:
        return column + np.complex128(1j * _STEP)

    return x.once(column, "beside", stepped)


def _turns(hook: CoenergyHook, x: Operating, q: Values) -> bool:
    """Whether a co-energy has the electrical angle in it: it is complex if that is."""
    return np.iscomplexobj(hook(replace(x, eps_rad=x.eps_rad + 1j * _STEP), q))


def air_gap_torque(x: Operating, psi_wb: Complex, slope_wb: Array) -> Array:
    """Torque of the air gap.

    Parameters
    ----------
    x
        State of the machine, its currents [n, A].
    psi_wb
        Flux linkage [n, Wb].
    slope_wb
        ∂W/∂ε of the co-energy [n, Wb·A].

    Returns
    -------
    array [n, N·m]

    Notes
    -----
    T = 1.5 p [ψ_d i_q − ψ_q i_d + ∂W/∂ε]

    """
    return 1.5 * x.machine.pole_pairs * (psi_wb.real * x.iq_a - psi_wb.imag * x.id_a + slope_wb)
