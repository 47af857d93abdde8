"""Every effect of `contract/effects.md` with its parameters and a typical size for any motor.

The first parameter, `size`, is the one that is zero where the effect is absent; the others shape
it. Forms are deliberately not those of the usual textbook model, see `docs/simulator.md`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from pipeline.simulator.design import Motor, Size

Defaults = Callable[[Motor], dict[str, float]]
NEVER_NEGATIVE = frozenset({
    "copper_temperature", "skin_effect", "dead_time", "current_delay", "torque_lag", "saturation",
    "iron_eddy", "iron_hysteresis", "coulomb_friction", "stribeck", "windage",
    "load_dependent_friction", "presliding", "cogging", "compliance", "backlash",
})  # fmt: skip
"""Effects whose `size` is a loss, a time, a gap or an amplitude that has a phase of its own."""
ALWAYS = ("copper_temperature", "magnet_temperature", "coulomb_friction")


def cogging_order(motor: Motor) -> int:
    """Fundamental order of the cogging torque a turn, LCM(slots, 2p).

    Parameters
    ----------
    motor
        The motor.

    """
    return math.lcm(motor.slots, 2 * motor.pole_pairs)


def speed_elec_rad_s(motor: Motor) -> float:
    """Electrical angular speed at rated speed, p omega [rad/s].

    Parameters
    ----------
    motor
        The motor.

    """
    return motor.pole_pairs * motor.speed_rated_rad_s


def _harmonics(_: Motor) -> dict[str, float]:
    return {
        "size": 0.012,
        "seventh": 0.6,
        "eleventh": 0.2,
        "thirteenth": 0.12,
        "phase5_rad": math.pi,
        "phase7_rad": 0.2,
        "phase11_rad": 0.4,
        "phase13_rad": 2.9,
    }


def _compliance(motor: Motor) -> dict[str, float]:
    """Stiffness that puts the free-free resonance of two equal halves at 80 Hz."""
    fraction = 0.5
    reduced = motor.j_rotor_kgm2 * fraction * (1.0 - fraction)
    stiffness = reduced * (2.0 * math.pi * 80.0) ** 2
    return {"size": 1.0 / stiffness, "load_fraction": fraction, "damping_ratio": 0.03}


FORMS: dict[str, Defaults] = {
    # [1/K] R (1 + size (T_w - 25))
    "copper_temperature": lambda m: {"size": m.temp_coeff_copper_1_k},
    # [1/K] psi (1 + size (T_m - 25))
    "magnet_temperature": lambda m: {"size": m.temp_coeff_magnet_1_k},
    # [1] R (1 + size u²/(1 + (u/knee)²)), u the electrical speed over rated
    "skin_effect": lambda _: {"size": 0.08, "knee": 3.0},
    # [1] R_x = R (1 + size cos(120° x - angle_deg)), x = 0, 1, 2 for a, b, c
    "phase_imbalance": lambda _: {"size": 0.04, "angle_deg": 20.0},
    # [V] each phase loses size * i/sqrt(i² + knee_a²), of which a compensation gives back its
    # share `compensated`, in proportion to i up to ramp_a and in full beyond
    "dead_time": lambda m: {
        "size": 0.005 * m.vdc_v,
        "knee_a": 0.01 * m.current_rated_a,
        "compensated": 0.0,
        "ramp_a": 0.1 * m.current_rated_a,
    },
    # [1] recorded voltages times 1 + size
    "voltage_scale": lambda _: {"size": 0.02},
    # [s] dq voltages are logged in the frame of the rotor `size` earlier than they act
    "sample_delay": lambda m: {"size": 0.03 / speed_elec_rad_s(m)},
    # [s] phase currents are sampled `size` late
    "current_delay": lambda m: {"size": 0.03 / speed_elec_rad_s(m)},
    # [s] first-order lag of the transducer
    "torque_lag": lambda _: {"size": 2e-3},
    # [1] all current sensors times 1 + size
    "current_scale": lambda _: {"size": 0.02},
    # [1] the sensor of one phase times 1 + size
    "current_gain": lambda _: {"size": 0.02, "phase": 0.0},
    # [A] the sensor of one phase plus size
    "current_offset": lambda m: {"size": 0.008 * m.current_rated_a, "phase": 1.0},
    # [rad] electrical angle plus size
    "angle_offset": lambda _: {"size": 0.03},
    # [rad] mechanical angle plus size * sin(order * theta + phase_rad)
    "angle_eccentricity": lambda m: {
        "size": 0.04 / m.pole_pairs,
        "phase_rad": 0.6,
        "order": 1.0,
    },
    # [1] apparent Lq falls by size at rated q current (power law of flux), Ld by size_d at
    # rated d current along the magnet (root form; 0.4 of size if not given); form 1 is a sinh
    # of flux instead of the power
    "saturation": lambda _: {"size": 0.18, "size_d": math.nan, "exponent": 3.0, "form": 0.0},
    # [1] apparent Lq falls by size at rated d current along the magnet; reciprocal
    "cross_saturation": lambda _: {"size": 0.08},
    # [1] 5th, 7th, 11th, 13th of the phase flux linkage
    "bemf_harmonics": _harmonics,
    # [1] 1/Lq times 1 + size cos(6 eps + phase_rad), 1/Ld with size * ratio_d
    "inductance_harmonics": lambda _: {"size": 0.05, "ratio_d": 0.4, "phase_rad": 0.3},
    # [N·m·s/rad] drag size * omega (psi/psi_pm)²/(1 + (omega/knee_rad_s)²)
    "iron_eddy": lambda m: {
        "size": 0.012 * m.torque_rated_nm / m.speed_rated_rad_s,
        "knee_rad_s": 5.0 * m.speed_rated_rad_s,
    },
    # [N·m] drag size * (psi/psi_pm)^1.6 against the direction of rotation
    "iron_hysteresis": lambda m: {"size": 0.008 * m.torque_rated_nm},
    # [N·m] size against the direction
    "coulomb_friction": lambda m: {"size": m.torque_coulomb_nm},
    # [N·m] extra size/(1 + (omega/omega_s)²) against the direction
    "stribeck": lambda m: {
        "size": 0.008 * m.torque_rated_nm,
        "omega_s_rad_s": 0.03 * m.speed_rated_rad_s,
    },
    # [N·m·(s/rad)²] size * omega_rated² * |omega/omega_rated|^exponent against the direction
    "windage": lambda m: {
        "size": 0.012 * m.torque_rated_nm / m.speed_rated_rad_s**2,
        "exponent": 2.0,
    },
    # [1] size * |electromagnetic torque| against the direction
    "load_dependent_friction": lambda _: {"size": 0.02},
    # [rad] Dahl bristle: friction builds up over size of travel after a reversal
    "presliding": lambda m: {"size": 0.05 * 2.0 * math.pi / cogging_order(m)},
    # [N·m] orders LCM(slots, 2p) and twice it, and by request `slots` and 2p
    "cogging": lambda m: {
        "size": 0.015 * m.torque_rated_nm,
        "second": 0.15,
        "order_slots": 0.0,
        "order_poles": 0.0,
        "phase_rad": 0.7,
    },
    # [N·m] size * sin(theta + phase_rad)
    "unbalance": lambda m: {"size": 0.01 * m.torque_rated_nm, "phase_rad": 1.1},
    # [rad/(N·m)] two masses, shaft compliance size, load_fraction of J far
    "compliance": _compliance,
    # [rad] total gap of the coupling
    "backlash": lambda m: {"size": 0.05 / m.pole_pairs},
    # [1] transducer times 1 + size
    "torque_scale": lambda _: {"size": 0.02},
    # [N·m] transducer plus size
    "torque_offset": lambda m: {"size": 0.006 * m.torque_rated_nm},
}
"""Parameters of each effect at a typical size, by the motor; the unit of the size in brackets."""


def parameters(name: str, motor: Motor, size: Size | None = None) -> dict[str, float]:
    """All parameters of an effect on a motor.

    Parameters
    ----------
    name
        Of the effect.
    motor
        Whose ratings make the typical sizes.
    size
        A number, or a mapping of some of the parameters; typical where not given.

    Returns
    -------
    dict
        By name, in the units of their suffixes; `size` in that of the effect.

    Raises
    ------
    ValueError
        There is no such effect, or no such parameter of it.

    """
    if name not in FORMS:
        raise ValueError(f"no effect {name}; there are {', '.join(sorted(FORMS))}")
    full = FORMS[name](motor)
    sizes: Mapping[str, float] = {}
    if size is not None:
        sizes = size if isinstance(size, Mapping) else {"size": float(size)}
    strange = set(sizes) - set(full)
    if strange:
        raise ValueError(
            f"{name} has no parameter {', '.join(sorted(strange))}; it has {', '.join(full)}"
        )
    full.update({key: float(value) for key, value in sizes.items()})
    if math.isnan(full.get("size_d", 0.0)):
        full["size_d"] = 0.4 * full["size"]
    return full


def active(motor: Motor) -> dict[str, dict[str, float]]:
    """The effects of a motor with every parameter, those that every motor has included.

    Parameters
    ----------
    motor
        The motor.

    """
    named: dict[str, Size | None] = dict.fromkeys(ALWAYS)
    named.update(motor.effects)
    return {name: parameters(name, motor, size) for name, size in named.items()}
