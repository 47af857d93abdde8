"""Numbers of one motor in the flat form the compiled kernels take."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator.design import EXTRA_SIGNALS, EXTRA_VARIABLES, Motor
from pipeline.simulator.effects import active, cogging_order

NUMBERS = """
    pole_pairs r_a_ohm r_b_ohm r_c_ohm alpha_copper skin skin_knee omega_elec_rated dead_v
    dead_knee_a given_v given_ramp_a psi_wb alpha_magnet h5 h7 h11 h13 p5 p7 p11 p13 ld_h
    lq_h nu_d nu_q nu_phase
    sat_form sat_exponent sat_psi_q sat_q sat_d x0_wb cross j_rotor j_load stiffness damping
    half_gap b_visc friction coulomb stribeck stribeck_w windage windage_exponent omega_rated
    omega_eps load_friction bristle eddy eddy_knee hysteresis unbalance unbalance_phase rth_wa
    rth_wm rth_ma cth_w cth_m
"""
LINES, EXTRAS, POINTS = 8, 6, 129
LAYOUT = np.dtype(
    [(name, np.float64) for name in NUMBERS.split()]
    + [
        ("two_mass", np.bool_),
        ("lines", np.int64),
        ("cog_order", np.float64, (LINES,)),
        ("cog_amplitude", np.float64, (LINES,)),
        ("cog_phase", np.float64, (LINES,)),
        ("extras", np.int64),
        ("extra_signal", np.int64, (EXTRAS,)),
        ("extra_variable", np.int64, (EXTRAS,)),
        ("extra_times", np.int64, (EXTRAS,)),
        ("extra_points", np.int64, (EXTRAS,)),
        ("extra_x", np.float64, (EXTRAS, POINTS)),
        ("extra_y", np.float64, (EXTRAS, POINTS)),
    ],
    align=True,
)

Plant = Any
"""One record of `LAYOUT`: a motor with all its effects, absent ones zero, SI units throughout.

Compiled code takes it by reference and reads its fields by name.
"""


def plant_of(motor: Motor) -> Plant:
    """The numbers of a motor with all its effects, as compiled code takes them.

    Parameters
    ----------
    motor
        Design and effects.

    Returns
    -------
    Plant
        One record of `LAYOUT`, SI units.

    Raises
    ------
    ValueError
        An effect is too large to be physical: a phase without resistance, a flux map without
        inverse.

    Notes
    -----
    Strengths of saturation are solved so that the apparent inductance falls by the stated share at
    the rated current of its axis.

    """
    on = active(motor)
    none: dict[str, float] = {}
    fields: dict[str, object] = {
        "pole_pairs": float(motor.pole_pairs),
        "omega_rated": motor.speed_rated_rad_s,
        "omega_elec_rated": motor.pole_pairs * motor.speed_rated_rad_s,
        "psi_wb": motor.psi_pm_wb,
        "ld_h": motor.ld_h,
        "lq_h": motor.lq_h,
        "b_visc": motor.b_visc_nm_s_rad,
        "rth_wa": motor.rth_wa_k_w,
        "rth_wm": motor.rth_wm_k_w,
        "rth_ma": motor.rth_ma_k_w,
        "cth_w": motor.cth_winding_j_k,
        "cth_m": motor.cth_magnet_j_k,
        "alpha_copper": on["copper_temperature"]["size"],
        "alpha_magnet": on["magnet_temperature"]["size"],
        **_resistive(motor, on),
        **_harmonic(on.get("bemf_harmonics", none), on.get("inductance_harmonics", none)),
        **_saturating(motor, on.get("saturation", none), on.get("cross_saturation", none)),
        **_friction(motor, on),
        **_coupling(motor, on),
        **_cogging(motor, on.get("cogging", none)),
        **_extras(motor),
    }
    plant = np.zeros(1, dtype=LAYOUT).view(np.recarray)
    for name, value in fields.items():
        plant[name][0] = value
    return plant[0]


def _resistive(motor: Motor, on: dict[str, dict[str, float]]) -> dict[str, float]:
    imbalance = on.get("phase_imbalance", {})
    skin = on.get("skin_effect", {})
    dead = on.get("dead_time", {})
    lean = imbalance.get("size", 0.0)
    angle = math.radians(imbalance.get("angle_deg", 0.0))
    r = [
        motor.r_phase_ohm * (1.0 + lean * math.cos(2.0 * math.pi * k / 3.0 - angle))
        for k in range(3)
    ]
    if min(r) <= 0.0:
        raise ValueError("phase_imbalance leaves a phase without resistance")
    return {
        "r_a_ohm": r[0],
        "r_b_ohm": r[1],
        "r_c_ohm": r[2],
        "skin": skin.get("size", 0.0),
        "skin_knee": skin.get("knee", 1.0),
        "dead_v": dead.get("size", 0.0),
        "dead_knee_a": dead.get("knee_a", 1.0),
        "given_v": dead.get("compensated", 0.0) * dead.get("size", 0.0),
        "given_ramp_a": dead.get("ramp_a", 1.0),
    }


def _harmonic(bemf: dict[str, float], inductance: dict[str, float]) -> dict[str, float]:
    fifth = bemf.get("size", 0.0)
    lean = inductance.get("size", 0.0)
    if abs(lean) >= 1.0:
        raise ValueError("inductance_harmonics of 1 or more make an inductance infinite")
    return {
        "h5": fifth,
        "h7": fifth * bemf.get("seventh", 0.0),
        "h11": fifth * bemf.get("eleventh", 0.0),
        "h13": fifth * bemf.get("thirteenth", 0.0),
        "p5": bemf.get("phase5_rad", 0.0),
        "p7": bemf.get("phase7_rad", 0.0),
        "p11": bemf.get("phase11_rad", 0.0),
        "p13": bemf.get("phase13_rad", 0.0),
        "nu_q": lean,
        "nu_d": lean * inductance.get("ratio_d", 0.0),
        "nu_phase": inductance.get("phase_rad", 0.0),
    }


def _saturating(motor: Motor, own: dict[str, float], cross: dict[str, float]) -> dict[str, float]:
    """Coefficients that give the stated fall of the apparent inductance at rated current."""
    rated = motor.current_rated_a
    fall = own.get("size", 0.0)
    fall_d = own.get("size_d", 0.0)
    exponent = own.get("exponent", 3.0)
    sinh = own.get("form", 0.0) == 1.0
    knee, strength = motor.lq_h * rated, 0.0
    if fall > 0.0:
        u = 1.0 - fall
        if sinh:
            knee = motor.lq_h * rated * u / _sinh_knee(fall)
            strength = 1.0
        else:
            strength = fall / u ** (exponent + 1.0)
    root = 4.0 * (math.sqrt(1.0 + (1.0 - fall_d) ** 2 / 4.0) - 1.0)
    sat_d = fall_d / root if fall_d else 0.0
    tie = cross.get("size", 0.0)
    cross_k = math.sqrt(2.0) * tie / (1.0 - tie)
    if not 0.0 <= fall < 0.9 or not 0.0 <= sat_d < 0.8 or not 0.0 <= cross_k < 0.9:
        raise ValueError("saturation so strong that the flux map has no inverse")
    return {
        "sat_form": float(sinh),
        "sat_exponent": exponent,
        "sat_psi_q": knee,
        "sat_q": strength,
        "sat_d": sat_d,
        "x0_wb": motor.ld_h * rated,
        "cross": cross_k,
    }


def _sinh_knee(fall: float) -> float:
    """The u > 0 with sinh(u)/u = 1/(1 - fall), by bisection."""
    low, high = 1e-9, 20.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if math.sinh(middle) / middle < 1.0 / (1.0 - fall):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _friction(motor: Motor, on: dict[str, dict[str, float]]) -> dict[str, float]:
    def of(name: str, key: str = "size", absent: float = 0.0) -> float:
        return on[name][key] if name in on else absent

    return {
        "friction": 1.0,
        "coulomb": of("coulomb_friction"),
        "stribeck": of("stribeck"),
        "stribeck_w": of("stribeck", "omega_s_rad_s", 1.0),
        "windage": of("windage") * motor.speed_rated_rad_s**2,
        "windage_exponent": of("windage", "exponent", 2.0),
        "omega_eps": 5e-5 * motor.speed_rated_rad_s,
        "load_friction": of("load_dependent_friction"),
        "bristle": of("presliding"),
        "eddy": of("iron_eddy"),
        "eddy_knee": of("iron_eddy", "knee_rad_s", 1.0),
        "hysteresis": of("iron_hysteresis"),
        "unbalance": of("unbalance"),
        "unbalance_phase": of("unbalance", "phase_rad"),
    }


def _coupling(motor: Motor, on: dict[str, dict[str, float]]) -> dict[str, float | bool]:
    """Two masses where there is compliance; a gap alone gets a stiff coupling (400 Hz)."""
    compliance = on.get("compliance", {})
    gap = on.get("backlash", {}).get("size", 0.0)
    fraction = compliance.get("load_fraction", 0.5)
    soft = compliance.get("size", 0.0)
    if soft == 0.0 and gap == 0.0:
        return {
            "two_mass": False,
            "j_rotor": motor.j_rotor_kgm2,
            "j_load": motor.j_rotor_kgm2,
            "stiffness": 0.0,
            "damping": 0.0,
            "half_gap": 0.0,
        }
    reduced = motor.j_rotor_kgm2 * fraction * (1.0 - fraction)
    stiffness = 1.0 / soft if soft > 0.0 else reduced * (2.0 * math.pi * 400.0) ** 2
    ratio = compliance.get("damping_ratio", 0.05)
    return {
        "two_mass": True,
        "j_rotor": motor.j_rotor_kgm2 * (1.0 - fraction),
        "j_load": motor.j_rotor_kgm2 * fraction,
        "stiffness": stiffness,
        "damping": 2.0 * ratio * math.sqrt(stiffness * reduced),
        "half_gap": 0.5 * gap,
    }


def _cogging(motor: Motor, cogging: dict[str, float]) -> dict[str, object]:
    lead = float(cogging_order(motor))
    size = cogging.get("size", 0.0)
    phase = cogging.get("phase_rad", 0.0)
    lines = [
        (lead, size, phase),
        (2.0 * lead, size * cogging.get("second", 0.0), 1.9 * phase + 0.4),
        (float(motor.slots), size * cogging.get("order_slots", 0.0), 0.3 - phase),
        (2.0 * motor.pole_pairs, size * cogging.get("order_poles", 0.0), 2.0 + phase),
    ]
    kept = [line for line in lines if line[1] != 0.0]
    table = np.zeros((LINES, 3))
    table[: len(kept)] = np.array(kept, dtype=np.float64).reshape(len(kept), 3)
    return {
        "lines": len(kept),
        "cog_order": table[:, 0],
        "cog_amplitude": table[:, 1],
        "cog_phase": table[:, 2],
    }


def _extras(motor: Motor) -> dict[str, object]:
    if len(motor.extras) > EXTRAS:
        raise ValueError(f"at most {EXTRAS} extra terms")
    table: dict[str, NDArray[np.generic]] = {
        key: np.zeros(EXTRAS, dtype=np.int64)
        for key in ("extra_signal", "extra_variable", "extra_times", "extra_points")
    }
    x, y = np.zeros((EXTRAS, POINTS)), np.zeros((EXTRAS, POINTS))
    for row, extra in enumerate(motor.extras):
        if len(extra.x) > POINTS:
            raise ValueError(f"an extra term has at most {POINTS} points")
        table["extra_signal"][row] = EXTRA_SIGNALS.index(extra.signal)
        table["extra_variable"][row] = EXTRA_VARIABLES.index(extra.variable)
        table["extra_times"][row] = EXTRA_VARIABLES.index(extra.times)
        table["extra_points"][row] = len(extra.x)
        x[row, : len(extra.x)] = extra.x
        y[row, : len(extra.y)] = extra.y
    return {"extras": len(motor.extras), "extra_x": x, "extra_y": y, **table}
