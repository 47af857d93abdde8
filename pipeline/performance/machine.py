"""A permanent-magnet synchronous machine at stated temperatures: flux, voltage, torque, losses.

Amplitude-invariant rotor frame, motor convention: IEEE Std 1812-2014; J. Pyrhönen et al., Design of
Rotating Electrical Machines, 2nd ed. 2014, ch. 7. Every field may hold many draws [n].
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pipeline.records.capture import Array


@dataclass(frozen=True, slots=True)
class Machine:
    """Constants at one winding and one magnet temperature [n draws each].

    Attributes
    ----------
    pole_pairs
        Number p.
    r_ohm, psi_wb, ld_h, lq_h
        Phase resistance, magnet flux (phase peak), and apparent inductances near zero current.
    ld_slope_h_a, lq_slope_h_a2
        How the inductances change with their own current and its square.
    within_d_a, within_q_a
        Currents up to which that was measured.
    beyond
        Share of the change that goes on beyond them, 0 to 1: nobody has seen it.
    coulomb_nm, viscous_nm_s_rad
        Drag of rotation.

    """

    pole_pairs: float
    r_ohm: Array
    psi_wb: Array
    ld_h: Array
    lq_h: Array
    ld_slope_h_a: Array
    lq_slope_h_a2: Array
    within_d_a: float
    within_q_a: float
    beyond: Array
    coulomb_nm: Array
    viscous_nm_s_rad: Array

    @property
    def bends(self) -> bool:
        """Whether any inductance goes with the current."""
        return bool(np.any(self.ld_slope_h_a) or np.any(self.lq_slope_h_a2))

    def one(self, draw: int) -> Machine:
        """The machine of a single draw.

        Parameters
        ----------
        draw
            Its number; 0 is that of the published values.

        """
        at = slice(draw, draw + 1)
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        drawn: dict[str, Any] = {n: v[at] for n, v in values.items() if isinstance(v, np.ndarray)}
        return replace(self, **drawn)


def inductances_h(machine: Machine, id_a: Array, iq_a: Array) -> tuple[Array, Array]:
    """Apparent inductances L = (ψ - ψ_pm)/i at some currents.

    Parameters
    ----------
    machine : Machine
        Fields [n].
    id_a, iq_a : array [n, ...], A
        Currents, phase peak.

    Returns
    -------
    array, array [n, ...], H

    Notes
    -----
    L_d = L_d0 + s_d i_d and L_q = L_q0 + s_q i_q²: the lowest terms that the axes' symmetry allows,
    for the d axis is biased by the magnet and the q axis is not. What one axis does to the other
    (cross saturation) is not in them. Beyond the currents that were measured an inductance may stay
    as it is or go on as it did; the draws hold every share of that.

    """
    d = _seen(machine, id_a, machine.within_d_a)
    q = _seen(machine, iq_a, machine.within_q_a)
    ld = _wide(machine.ld_h, d) + _wide(machine.ld_slope_h_a, d) * d
    lq = _wide(machine.lq_h, q) + _wide(machine.lq_slope_h_a2, q) * q**2
    return ld, lq


def _seen(machine: Machine, current_a: Array, within_a: float) -> Array:
    """The current by which an inductance changes: all of it within what was measured [A]."""
    inside = np.clip(current_a, -within_a, within_a)
    return inside + _wide(machine.beyond, inside) * (current_a - inside)


def torque_nm(machine: Machine, id_a: Array, iq_a: Array) -> Array:
    """Air-gap torque.

    Parameters
    ----------
    machine
        Constants of n draws.
    id_a
        [n, ...], phase peak.
    iq_a
        [n, ...], phase peak.

    Returns
    -------
    array [n, ...]
        In N·m.

    Notes
    -----
    T = 1.5 p (ψ_pm i_q + (L_d − L_q) i_d i_q).

    """
    ld, lq = inductances_h(machine, id_a, iq_a)
    flux = _wide(machine.psi_wb, id_a) + (ld - lq) * id_a
    return 1.5 * machine.pole_pairs * flux * iq_a


def voltage_v(machine: Machine, id_a: Array, iq_a: Array, omega_rad_s: Array) -> Array:
    """Phase voltage at a steady speed.

    Parameters
    ----------
    machine
        Constants of n draws.
    id_a
        [n, ...], phase peak.
    iq_a
        [n, ...], phase peak.
    omega_rad_s
        Mechanical speed [...].

    Returns
    -------
    array [n, ...]
        Phase peak [V].

    Notes
    -----
    v_d = R i_d − ω_e L_q i_q, v_q = R i_q + ω_e (L_d i_d + ψ_pm).

    """
    ld, lq = inductances_h(machine, id_a, iq_a)
    omega = machine.pole_pairs * omega_rad_s
    r = _wide(machine.r_ohm, id_a)
    d = r * id_a - omega * lq * iq_a
    q = r * iq_a + omega * (ld * id_a + _wide(machine.psi_wb, id_a))
    return np.hypot(d, q)


def drag_nm(machine: Machine, omega_rad_s: Array) -> Array:
    """Torque that rotation takes.

    Parameters
    ----------
    machine
        Constants of n draws.
    omega_rad_s
        Speeds of one sense, 0 or more [...].

    Returns
    -------
    array [n, ...]
        T_c + B ω [N·m].

    Notes
    -----
    Friction, windage and the iron loss of the magnet's flux together, as a retardation with open
    terminals gives them.

    References
    ----------
    IEEE Std 1812-2014 (no-load and retardation tests). IEC 60034-2-1 (friction and windage plus
    iron loss).

    """
    speeds = np.asarray(omega_rad_s)
    coulomb = machine.coulomb_nm.reshape(-1, *([1] * speeds.ndim))
    viscous = machine.viscous_nm_s_rad.reshape(-1, *([1] * speeds.ndim))
    return coulomb + viscous * speeds


def copper_w(machine: Machine, id_a: Array, iq_a: Array) -> Array:
    """Copper loss of three phases.

    Parameters
    ----------
    machine
        Constants of n draws.
    id_a
        [n, ...], phase peak.
    iq_a
        [n, ...], phase peak.

    Returns
    -------
    array [n, ...]
        P = 1.5 R (i_d² + i_q²) [W].

    References
    ----------
    IEC 60034-2-1 (winding losses).

    """
    return 1.5 * _wide(machine.r_ohm, id_a) * (id_a**2 + iq_a**2)


def inverter_w(drop_v: float, on_ohm: float, current_a: Array) -> Array:
    """Conduction loss of a three-phase bridge.

    Parameters
    ----------
    drop_v
        Threshold voltage of a device.
    on_ohm
        Its on-state resistance.
    current_a
        Phase current, peak [...].

    Returns
    -------
    array [...]
        In W, without switching loss.

    Notes
    -----
    P = 3 (V 2 I/π + r I²/2): each phase current flows through one device at any time, which drops V
    + r i.

    """
    return 3.0 * (drop_v * 2.0 * current_a / np.pi + on_ohm * current_a**2 / 2.0)


def _wide(values: Array, like: Array) -> Array:
    """Draws [n] with axes appended until they go with [n, ...]."""
    return values.reshape(-1, *([1] * (np.ndim(like) - 1)))
