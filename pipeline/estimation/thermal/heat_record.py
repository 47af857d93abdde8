"""A heat run as block means: resistance seen by voltage over current, temperatures, current."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.terminals import (
    bridged,
    first_temperature,
    pair_of,
    pair_signals,
)
from pipeline.estimation.policy import policy
from pipeline.numerics.integrals import GAP
from pipeline.numerics.plateaus import block_means, find_plateaus
from pipeline.physics.windings import phase_from_line
from pipeline.records.capture import Array, Capture, Flags
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, derived

DQ = ("vd_v", "vq_v", "id_a", "iq_a")
TURNING = ("psi_pm_wb", "pole_pairs", "ld_h", "lq_h")
REFERENCE = ("r_phase_ohm", "r_a_ohm", "r_b_ohm", "r_c_ohm", "angle_offset_elec_rad")


@dataclass(frozen=True, slots=True)
class HeatRecord:
    """Block means of one heat run while the current flows.

    Attributes
    ----------
    capture
        The capture.
    t_s
        Mean time of each block [n, s].
    r_phase_ohm
        Voltage along the current over current, per wye-equivalent phase [n, ohm].
    current_a
        Amplitude of the current [n, A].
    square_a2
        Mean of i_d² + i_q² [n, A²]; the copper loss is 1.5 R times it.
    temp_winding_degc
        Winding [n, degC].
    temp_second_degc, temp_ambient_degc
        Case or magnet, and ambient [n, degC]; None where not recorded.
    turning
        Whether back-EMF was subtracted.
    shares
        Weights of phases a, b and c in `r_phase_ohm`; None where the position of the current in the
        stator is not known.

    """

    capture: Capture
    t_s: Array
    r_phase_ohm: Array
    current_a: Array
    square_a2: Array
    temp_winding_degc: Array
    temp_second_degc: Array | None
    temp_ambient_degc: Array | None
    turning: bool
    shares: tuple[float, float, float] | None


def read_heat(capture: Capture, known: Constants) -> HeatRecord | None:
    """The record of a capture, or None where no current flows long enough.

    Parameters
    ----------
    capture
        Of a heat run: rotor frame, or one terminal pair.
    known
        Constants found so far: flux, pole pairs and inductances, where the rotor turns.

    Returns
    -------
    HeatRecord or None
        Block means of resistance [ohm], current [A] and temperatures [degC].

    Raises
    ------
    KeyError
        Where voltage, current or winding temperature is missing, or the back-EMF is not known.

    Notes
    -----
    R = (v_d i_d + v_q i_q - ω_e (ψ_d i_q - ψ_q i_d)) / (i_d² + i_q²)

    """
    if first_temperature(capture, "winding") is None:
        raise KeyError(f"{capture.path}: no temp_winding_degc")
    second = first_temperature(capture, "case", "magnet")
    ambient = first_temperature(capture, "ambient")
    columns = ["temp_winding_degc", *(n for n in (second, ambient) if n is not None)]
    turning = False
    if capture.has(*DQ, "t_s"):
        data, turning = _rotor_frame(capture, columns, known)
        shares = _phase_shares(capture, known)
    else:
        data = _terminal_frame(capture, columns)
        pair = pair_of(capture) or ""
        a, b, c = (0.5 * (phase in pair) for phase in "abc")
        shares = (a, b, c)
    return _blocks(capture, data, (second, ambient), turning, shares)


def _phase_shares(capture: Capture, known: Constants) -> tuple[float, float, float] | None:
    """(2/3) cos² of the angle from each phase to the current, the mean over the capture.

    Copper loss is the sum of R_k i_k², so a locked rotor sees its own mix of the phases. None
    where the angle is not known or no current flows.
    """
    offset = known.best("angle_offset_elec_rad")
    zero = 0.0 if offset is None else offset.number
    if capture.has("theta_elec_rad"):
        columns = capture.arrays("id_a", "iq_a", "theta_elec_rad")
        theta = columns["theta_elec_rad"]
    elif capture.has("theta_mech_rad") and (pairs := known.best("pole_pairs")) is not None:
        columns = capture.arrays("id_a", "iq_a", "theta_mech_rad")
        theta = pairs.number * columns["theta_mech_rad"] + zero
    else:
        return None
    angle = theta + np.arctan2(columns["iq_a"], columns["id_a"])
    weight = columns["id_a"] ** 2 + columns["iq_a"] ** 2
    finite = np.isfinite(angle) & (weight > 0.0)
    if not finite.any():
        return None
    a, b, c = (
        2.0 / 3.0 * float(np.average(np.cos(angle[finite] - place) ** 2, weights=weight[finite]))
        for place in (0.0, 2.0 * math.pi / 3.0, -2.0 * math.pi / 3.0)
    )
    return a, b, c


def reference_resistance(record: HeatRecord, known: Constants) -> Estimate | None:
    """R at 25 degC of the mix of phases that this run's current saw, by the resistance test.

    Where the phases or their mix are not known, the best R of the mean phase, whatever gives it: a
    resistance test, else a heat run or a drive log. None where nothing did.

    Parameters
    ----------
    record
        The run, with the phases' shares in the resistance that its current saw.
    known
        Constants found so far.

    Returns
    -------
    Estimate or None
        [ohm, at 25 degC].

    """
    phases = [known.best(f"r_{phase}_ohm") for phase in "abc"]
    if record.shares is None or any(one is None for one in phases):
        return known.best("r_phase_ohm")
    terms = [(w, one) for w, one in zip(record.shares, phases, strict=True) if one is not None]
    value = sum(w * one.number for w, one in terms)
    return derived("r_phase_ohm", "ohm", value, terms, terms[0][1].method)


def _rotor_frame(
    capture: Capture, columns: list[str], known: Constants
) -> tuple[dict[str, Array], bool]:
    speed = [n for n in ("omega_mech_rad_s",) if capture.has(n)]
    magnet = [n for n in ("temp_magnet_degc",) if capture.has(n) and n not in columns]
    frame = capture.arrays("t_s", *DQ, *columns, *speed, *magnet)
    along = frame["vd_v"] * frame["id_a"] + frame["vq_v"] * frame["iq_a"]
    turning = False
    if speed and np.nanmax(np.abs(frame[speed[0]])) > 0.0:
        power, turning = _motional(capture, frame, known)
        along = along - power
    frame["square_a2"] = frame["id_a"] ** 2 + frame["iq_a"] ** 2
    frame["along_va"] = along
    return frame, turning


def _motional(capture: Capture, data: dict[str, Array], known: Constants) -> tuple[Array, bool]:
    """omega_e (psi_d i_q - psi_q i_d) [n], and whether it is large enough to matter."""
    omega = np.nan_to_num(data["omega_mech_rad_s"])
    constants = {name: known.best(name) for name in TURNING}
    numbers = {
        name: estimate.number for name, estimate in constants.items() if estimate is not None
    }
    if len(numbers) < len(TURNING):
        if abs(float(np.mean(omega))) < 0.02:
            return np.zeros(omega.size), False
        raise KeyError(
            f"{capture.path}: the rotor turns, and its back-EMF needs an open_circuit spin and "
            "current steps; or lock the rotor"
        )
    psi = np.full(omega.size, numbers["psi_pm_wb"])
    coefficient = known.best("temp_coeff_magnet_1_k")
    if coefficient is not None and "temp_magnet_degc" in data:
        psi = psi * (1.0 + coefficient.number * (data["temp_magnet_degc"] - 25.0))
    psi_d = psi + numbers["ld_h"] * data["id_a"]
    psi_q = numbers["lq_h"] * data["iq_a"]
    power = numbers["pole_pairs"] * omega * (psi_d * data["iq_a"] - psi_q * data["id_a"])
    copper = data["vd_v"] * data["id_a"] + data["vq_v"] * data["iq_a"]
    least = policy().heat_record.motional_share * abs(float(np.nanmean(copper)))
    matters = abs(float(np.nanmean(power))) > least
    return (power if matters else np.zeros(omega.size)), matters


def _terminal_frame(capture: Capture, columns: list[str]) -> dict[str, Array]:
    """Current through one pair: i_d² + i_q² is 4/3 I² and the loss 2 R I²."""
    pair = pair_of(capture)
    if pair is None:
        raise KeyError(f"{capture.path}: neither dq nor one pair's voltage and current")
    frame = pair_signals(capture, pair, *columns)
    frame["square_a2"] = frame["i_a"] ** 2 * (4.0 / 3.0)
    frame["along_va"] = phase_from_line(1.0) * frame["v_v"] * frame["i_a"] * (4.0 / 3.0)
    return frame


def _blocks(
    capture: Capture,
    data: dict[str, Array],
    others: tuple[str | None, str | None],
    turning: bool,
    shares: tuple[float, float, float] | None,
) -> HeatRecord | None:
    """Means over equal blocks of the longest settled stretch of current.

    Steady is within 2 % of the largest current: one step of a coarse converter is no change. A
    block over a gap in time is left out: its mean is of no one moment.
    """
    needed = ("t_s", "along_va", "square_a2", "temp_winding_degc")
    finite = np.all([np.isfinite(data[n]) for n in needed], axis=0)
    data = {name: values[finite] for name, values in data.items()}
    second, ambient = (
        name if name is not None and _bridged(data, name) else None for name in others
    )
    current = np.sqrt(data["square_a2"])
    most_a = float(current.max(initial=0.0))
    plateaus = find_plateaus(
        current, least=50, tolerance=policy().heat_record.steady_share, least_span=most_a
    )
    flowing = [
        p for p in plateaus if current[p.rows].mean() > policy().heat_record.flowing_share * most_a
    ]
    if not flowing:
        return None
    longest = max(flowing, key=lambda p: p.size)
    size = max(1, longest.size // policy().heat_record.blocks)
    unbroken = _unbroken(data["t_s"][longest.rows], size)
    mean = {n: block_means(v[longest.rows], size)[unbroken] for n, v in data.items()}
    return HeatRecord(
        capture,
        mean["t_s"],
        mean["along_va"] / mean["square_a2"],
        np.sqrt(mean["square_a2"]),
        mean["square_a2"],
        mean["temp_winding_degc"],
        None if second is None else mean[second],
        None if ambient is None else mean[ambient],
        turning,
        shares,
    )


def _unbroken(t_s: Array, size: int) -> Flags:
    """Which blocks of `size` rows of a clock [n, s] take no more than `GAP` times what is usual."""
    last = t_s[size - 1 :: size]
    spans = last - t_s[::size][: last.size]
    return spans <= GAP * np.median(spans)


def _bridged(data: dict[str, Array], name: str) -> bool:
    """Draws a slow channel's gaps as straight lines in place; False where it holds no value."""
    data[name] = bridged(data["t_s"], data[name])
    return bool(np.isfinite(data[name]).any())


def ambient_degc(record: HeatRecord) -> float | None:
    """Ambient temperature of a heat run.

    Parameters
    ----------
    record
        The heat run.

    Returns
    -------
    float or None
        Mean of the measured one [degC], else what the metadata state; None where neither is there.

    """
    if record.temp_ambient_degc is not None:
        return float(np.nanmean(record.temp_ambient_degc))
    stated = record.capture.meta.ambient_degc
    return None if stated is None or not math.isfinite(stated) else stated
