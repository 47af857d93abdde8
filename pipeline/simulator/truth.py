"""What is true of a simulated motor, computed from the motor that is simulated."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator.design import Motor
from pipeline.simulator.effects import ALWAYS, active, cogging_order
from pipeline.simulator.plant import Plant, plant_of
from pipeline.simulator.protocols import TorqueMap

ANGLES: NDArray[np.float64] = np.linspace(0.0, 2.0 * math.pi, 720, endpoint=False)
AT_DEGC = 25.0
D_SHARE = min(TorqueMap().id_levels)


def rth_winding(p: Plant) -> float:
    """Winding to ambient at steady state: the direct path beside the one through the magnet.

    Parameters
    ----------
    p
        The motor in numbers.

    """
    through = p.rth_wm + p.rth_ma
    return float(p.rth_wa * through / (p.rth_wa + through))


def psi_fundamental_wb(p: Plant) -> float:
    """Amplitude of the fundamental of phase a's open-circuit flux linkage at 25 degC [Wb].

    Parameters
    ----------
    p
        The motor in numbers.

    """
    from pipeline.simulator.field import open_flux

    phase_a = open_flux(ANGLES, np.full(ANGLES.size, AT_DEGC), p)[:, 0]
    return float(2.0 * abs(np.mean(phase_a * np.exp(-1j * ANGLES))))


def mean_torque_nm(i_d: float, i_q: float, p: Plant) -> float:
    """Electromagnetic torque averaged over a turn at 25 degC [N·m].

    Parameters
    ----------
    i_d
        Current along d [A].
    i_q
        Current along q [A].
    p
        The motor in numbers.

    """
    from pipeline.simulator.field import torques

    n = ANGLES.size
    return float(np.mean(torques(np.full(n, i_d), np.full(n, i_q), ANGLES, AT_DEGC, p)))


def mean_flux_wb(i_d: float, i_q: float, p: Plant) -> tuple[float, float]:
    """Flux averaged over a turn at 25 degC [Wb].

    Parameters
    ----------
    i_d
        Current along d [A].
    i_q
        Current along q [A].
    p
        The motor in numbers.

    """
    from pipeline.simulator.field import fluxes

    n = ANGLES.size
    psi = fluxes(np.full(n, i_d), np.full(n, i_q), ANGLES, AT_DEGC, p)
    return float(np.mean(psi[:, 0])), float(np.mean(psi[:, 1]))


def _inductances(motor: Motor, p: Plant, psi: float) -> dict[str, float]:
    from pipeline.simulator.field import inductances

    near = np.mean(inductances(ANGLES, AT_DEGC, p), axis=0)
    rated = motor.current_rated_a
    i_d = D_SHARE * rated
    psi_d, _ = mean_flux_wb(i_d, 0.0, p)
    _, psi_q = mean_flux_wb(0.0, rated, p)
    return {
        "ld_h": float(near[0]),
        "lq_h": float(near[1]),
        "ld_rated_h": (psi_d - psi) / i_d,
        "lq_rated_h": psi_q / rated,
        "saliency_ratio": float(near[1] / near[0]),
    }


def _coupling(motor: Motor, p: Plant, psi: float, r: float) -> dict[str, float | None]:
    k = motor.pole_pairs * psi
    small = 1e-3 * motor.current_rated_a
    kt = (mean_torque_nm(0.0, small, p) - mean_torque_nm(0.0, -small, p)) / (2.0 * small)
    line = math.sqrt(3.0) * k
    return {
        "ke_phase_peak_v_s_rad": k,
        "ke_ll_peak_v_s_rad": line,
        "ke_ll_rms_v_s_rad": line / math.sqrt(2.0),
        "ke_ll_peak_v_krpm": line * 1000.0 * 2.0 * math.pi / 60.0,
        "kv_ll_peak_rpm_v": 60.0 / (2.0 * math.pi * line) if k > 0.0 else None,
        "kt_peak_nm_a": kt,
        "kt_rms_nm_a": kt * math.sqrt(2.0),
        "kt_from_ke_nm_a": 1.5 * k,
        "motor_constant_nm_sqrt_w": kt / math.sqrt(1.5 * r),
        "tau_mech_s": float(p.j_rotor) * r / (1.5 * k * k) if k > 0.0 else None,
    }


def _crest(wave: NDArray[np.float64]) -> float:
    """Maximum of a periodic wave between its samples, by the parabola through the three highest."""
    at = int(np.argmax(wave))
    before, top, after = wave[at - 1], wave[at], wave[(at + 1) % wave.size]
    bend = before - 2.0 * top + after
    return float(top - (after - before) ** 2 / (8.0 * bend)) if bend < 0.0 else float(top)


def _cogging(motor: Motor, p: Plant) -> dict[str, float | int | None]:
    from pipeline.simulator.field import cogging

    if p.lines == 0:
        return {"cogging_peak_nm": 0.0, "cogging_order": None, "cogging_amplitude_nm": None}
    n = 64 * cogging_order(motor)
    torque = np.array([cogging(x, p) for x in np.arange(n) * 2.0 * math.pi / n])
    lines = 2.0 * np.abs(np.fft.rfft(torque)) / n
    order = int(np.argmax(lines[1:])) + 1
    return {
        "cogging_peak_nm": 0.5 * (_crest(torque) + _crest(-torque)),
        "cogging_order": order,
        "cogging_amplitude_nm": float(lines[order]),
    }


def truth(motor: Motor) -> dict[str, object]:
    """What is true of a simulated motor, computed from the field that is simulated.

    Parameters
    ----------
    motor
        Design and effects.

    Returns
    -------
    dict
        `constants` by the names of `contract/outputs.md` and in their units, `hidden` effects,
        their `sizes`, the `nameplate`, and `at` which currents [A] the inductances at rated current
        hold.

    Notes
    -----
    Inductances are incremental at zero current, averaged over a turn; `ld_rated_h` is (ψ_d −
    ψ_pm)/i_d at the largest d current of the bench's torque map without q current, `lq_rated_h`
    ψ_q/i_q at rated q current without d current; `kt_peak_nm_a` is the slope at zero current.
    Magnets and copper are at 25 degC.

    """
    p = plant_of(motor)
    ohm = np.array([p.r_a_ohm, p.r_b_ohm, p.r_c_ohm])
    r, psi = float(np.mean(ohm)), psi_fundamental_wb(p)
    field = _inductances(motor, p, psi)
    constants: dict[str, float | int | None] = {
        "r_phase_ohm": r,
        "r_ll_ohm": 2.0 * r,
        "resistance_imbalance": float((np.max(ohm) - np.min(ohm)) / r),
        "temp_coeff_copper_1_k": float(p.alpha_copper),
        **field,
        "psi_pm_wb": psi,
        "temp_coeff_magnet_1_k": float(p.alpha_magnet),
        **_coupling(motor, p, psi, r),
        "pole_pairs": motor.pole_pairs,
        **_cogging(motor, p),
        "j_rotor_kgm2": float(p.j_rotor),
        "torque_coulomb_nm": float(p.coulomb),
        "b_visc_nm_s_rad": motor.b_visc_nm_s_rad,
        "tau_elec_s": field["lq_h"] / r,
        "rth_winding_k_w": rth_winding(p),
    }
    hidden = sorted(name for name in motor.effects if name not in ALWAYS)
    if motor.thermometer_share != 1.0:
        hidden.append("unknown: winding thermometer")
    unknown = [f"unknown: {extra.signal} against {extra.variable}" for extra in motor.extras]
    sizes = {name: values for name, values in active(motor).items() if name in motor.effects}
    return {
        "motor_id": motor.motor_id,
        "constants": constants,
        "hidden": hidden + unknown,
        "sizes": {name: {k: float(v) for k, v in values.items()} for name, values in sizes.items()},
        "nameplate": dict(motor.nameplate),
        "at": {
            "ld_rated_h": {"id_a": D_SHARE * motor.current_rated_a, "iq_a": 0.0},
            "lq_rated_h": {"id_a": 0.0, "iq_a": motor.current_rated_a},
        },
    }
