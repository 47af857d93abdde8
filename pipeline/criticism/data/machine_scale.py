"""How large the machine is: what the captures say before any fit, and what is stated of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.holding_cells import holding_orders
from pipeline.criticism.data.instruments import stated_u
from pipeline.criticism.data.rounding import rounding_step
from pipeline.criticism.data.settling import settling_of
from pipeline.criticism.data.traces import LINES_V, on_counts, with_values
from pipeline.criticism.operating import Array
from pipeline.criticism.parameter import BENDING, UNLOGGED, WARMING, Machine
from pipeline.criticism.policy.policy import DEFAULT, Policy
from pipeline.physics.coupling import COUPLINGS, coupling_from
from pipeline.physics.frames import vector_of_lines
from pipeline.physics.glossary import TESTS_WITHOUT_CLOCK
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.stated import stated_constants

_TRACED = ("torque_map", "drive", "heat_run")
_HELD = "holding_current"
"""A rotor that is held from angle to angle: its pace is the bench's."""
_TABLES = (*sorted(TESTS_WITHOUT_CLOCK), _HELD)
_SHAFT_ALONE = ("spin_down", "cogging")
"""Tests without a current, of which a winding's pole pairs say nothing."""
_OF_AN_ANGLE = ("vd_v", *LINES_V, "va_v", "vb_v", "vc_v", "ia_a", "ib_a", "ic_a")
"""What a turning winding shows by its electrical angle; q voltage, q current and torque do not."""
_ANGLES = ("theta_mech_rad", "theta_elec_rad")
_TURNING = (*_ANGLES, "omega_mech_rad_s")
_LINES_A = ("ia_a", "ib_a", "ic_a")


_BINS_AN_ORDER = 4
"""Bins of angle that a wave surely stands out of: twice what Nyquist needs."""
_SAME_ANGLE = 1e-7
"""Difference of two readings of one angle [turn], by rounding of their numbers."""


PAIRLESS = (
    "nothing gives the pole pairs, without which no speed means anything to the winding: record an "
    "open circuit spin with line voltages and angle, or state pole_pairs in the captures"
)


def machine_of(campaign: Campaign, start: Constants, policy: Policy = DEFAULT) -> Machine | None:
    """How large the machine is: pole pairs, slots, scales and orders, before any fit.

    Parameters
    ----------
    campaign
        All captures of one motor.
    start
        Constants known from elsewhere.
    policy
        Constants of judgement.

    Returns
    -------
    Machine or None
        None where the shaft turned and nothing gives its pole pairs, without which no angle means
        anything to both axes or the phases of a winding.

    """
    slots, stated = campaign.nameplate("slots"), stated_u(campaign.captures)
    pole_pairs = pole_pairs_of(campaign, start)
    counted = pole_pairs is not None
    if pole_pairs is None:
        electric = [c for c in campaign.captures if c.meta.test not in _SHAFT_ALONE]
        turning = [c for c in electric if any(c.has(name) for name in _TURNING)]
        if any(c.has(name) for c in turning for name in _OF_AN_ANGLE):
            return None
        pole_pairs = 1
    captures = tuple(c for c in map(with_values, campaign.captures) if c is not None)
    campaign = replace(campaign, captures=captures)
    known = stated_parameters(stated_constants(campaign), pole_pairs, counted=counted)
    bases = tuple(int(str(n)) for n in (pole_pairs, slots) if n)
    harmonics, usual = policy.cutting.harmonics, policy.cutting.highest_order
    highest = harmonics * math.lcm(int(str(slots)), 2 * pole_pairs) if slots else 0
    orders = torque_orders(campaign.of("cogging"), max(highest, usual)) or holding_orders(
        campaign.of("holding_current"), bases, policy, usual
    )
    return Machine(
        pole_pairs,
        int(str(slots)) if slots else None,
        _scales(campaign, start, known, pole_pairs) | _settling(campaign, policy),
        orders,
        stated,
        encoder_step(campaign, policy),
        travel_turns=max(map(_travel_turns, campaign.captures), default=0.0),
        rotor_angles=_rotor_angles(campaign, pole_pairs, policy),
        pairs_known=counted,
        unlogged=_unlogged(campaign),
        stated=known,
        policy=policy,
    )


def _unlogged(campaign: Campaign) -> dict[str, tuple[str, str]]:
    """Column and capture [path], by nuisance, of the temperatures that captures do not record.

    Captures of one day may be of a cold machine and of a warm one. One that alone lacks a column
    has the nuisance that all captures have in common. Under a current that is logged a machine
    warms as well.
    """
    nuisances: dict[str, tuple[str, str]] = {}
    warm = [c for c in campaign.captures if c.meta.test not in (*_SHAFT_ALONE, *_TABLES)]
    for column, nuisance in UNLOGGED.items():
        paths = sorted(c.path for c in warm if not c.has(column))
        if len(paths) > 1:
            nuisances |= {f"{nuisance}_{n}": (column, path) for n, path in enumerate(paths)}
        logs = (c for c in campaign.of(*_TRACED) if c.has("iq_a") and not c.has(column))
        loaded = sorted(c.path for c in logs)
        for stem in (course[column] for course in (WARMING, BENDING) if column in course):
            nuisances |= {f"{stem}_{n}": (column, path) for n, path in enumerate(loaded)}
    return nuisances


def _scales(
    campaign: Campaign, start: Constants, known: Mapping[str, tuple[float, float]], pole_pairs: int
) -> dict[str, float]:
    """Typical size of each quantity: the largest on record, 1 where there is none.

    `known` are stated parameters with their uncertainties.
    """
    logs, tables = campaign.of(*_TRACED), campaign.of(*_TABLES)
    current = _largest(logs, ("id_a", "iq_a")) or _largest(campaign.captures, _LINES_A)
    current = current or _largest(tables, ("id_a", "iq_a"))
    voltage = _largest(logs, ("vd_v", "vq_v")) or _largest(campaign.captures, LINES_V)
    voltage = voltage or _largest(tables, ("vq_v",))
    turned = max((_speed(c) for c in campaign.captures if c.meta.test != _HELD), default=0.0)
    speed = turned or max((_speed(c) for c in campaign.captures), default=0.0) or 1.0
    flux = 0.0 if voltage else _largest(tables, ("psi_d_wb", "psi_q_wb"))
    # without the voltage of a turning winding, the torque that a current makes
    made = _largest(logs, ("torque_shaft_nm",)) / (1.5 * pole_pairs * current) if current else 0.0
    voltage = voltage or (flux or made) * pole_pairs * speed
    # without a winding on record the torque's own size is all there is
    shaft = 0.0 if current and voltage else _largest(campaign.captures, ("torque_shaft_nm",))
    shaft = shaft or (0.0 if current and voltage else _stated_torque(known, speed))
    clamped = _largest(tables, ("torque_shaft_nm",))
    recorded = {"impedance_ohm": voltage / current} if current and voltage else {}
    current, voltage = current or 1.0, voltage or 1.0
    psi = _flux_scale(campaign.captures, pole_pairs) or made or voltage / (pole_pairs * speed)
    if not turned and (amperes := _largest(campaign.of("torque_table"), ("iq_a",))):
        # the voltage of a winding that no test turned is that of its resistance
        psi = clamped / (1.5 * pole_pairs * amperes)
    fitted = start.best("psi_pm_wb")
    psi = fitted.number if fitted is not None else known.get("psi_wb", (psi, 0.0))[0]
    return {
        "current_a": current,
        "voltage_v": voltage,
        "speed_rad_s": speed,
        "freq_hz": max(pole_pairs * speed / (2 * math.pi), 1.0),
        "torque_nm": max(shaft or 1.5 * pole_pairs * psi * current, clamped),
        "period_s": min((_period(c) for c in logs), default=1e-4),
        "flux_wb": psi,
        **recorded,
    }


def _flux_scale(captures: Sequence[Capture], pole_pairs: int) -> float:
    """Flux linkage [Wb] by the largest voltage of a turning winding and the largest speed of one;
    0 without any. A crawl and a spin of one motor have next to nothing of each other's.
    """
    lines = 1.0 / math.sqrt(3.0)
    spun = [
        (max(_largest([c], ("vd_v", "vq_v")), lines * _largest([c], LINES_V)), _speed(c))
        for c in captures
        if c.meta.test != _HELD
    ]
    turning = [(voltage, speed) for voltage, speed in spun if voltage and speed]
    if not turning:
        return 0.0
    voltages, speeds = zip(*turning, strict=True)
    return float(max(voltages) / (pole_pairs * max(speeds)))


def _settling(campaign: Campaign, policy: Policy) -> dict[str, float]:
    """Time constant and delay [s] of logs without a current; nothing where there are none."""
    estimated = settling_of(campaign.of("drive"), policy)
    return {} if estimated is None else {"settling_s": estimated[0], "late_s": estimated[1]}


def _stated_torque(stated: Mapping[str, tuple[float, float]], speed: float) -> float:
    """Torque [N·m] that stated constants of a shaft go with, as in `base_scales`; 0 without any."""
    inertia = 10.0 * speed * stated.get("j_kgm2", (0.0, 0.0))[0]
    return max(inertia, 10.0 * stated.get("coulomb_friction.torque_nm", (0.0, 0.0))[0])


def _travel_turns(capture: Capture) -> float:
    """How far the shaft goes in a capture [turns]; infinite without an angle."""
    if capture.has("theta_mech_rad"):
        theta = capture.arrays("theta_mech_rad")["theta_mech_rad"]
        steps = np.abs(np.diff(theta))
        # the last sample stands for the way to the next
        last = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
        return (float(np.nanmax(theta) - np.nanmin(theta)) + last) / TURN_RAD if theta.size else 0.0
    return math.inf if any(capture.has(name) for name in _TURNING) else 0.0


def _rotor_angles(campaign: Campaign, pole_pairs: int, policy: Policy) -> float:
    """Known angles of the rotor at which its winding was recorded, within a sixth of an electrical
    turn, which is the wave of a machine of three phases; infinite where it turns by a known angle.
    Those nearer than the least part of a wave that counts are one.
    """
    locked: set[int] = set()
    wave_deg, parts = 360 // 6, round(1.0 / policy.cutting.least_wave)
    for capture in campaign.captures:
        if capture.meta.test in _SHAFT_ALONE:
            continue
        stated = capture.meta.theta_elec_deg
        angles = [] if stated is None else [stated]
        for name, pairs in zip(_ANGLES, (pole_pairs, 1), strict=True):
            if capture.has(name):
                turned = np.degrees(pairs * capture.arrays(name)[name])
                if np.ptp(turned) > wave_deg:
                    return math.inf
                angles = [float(turned.mean())]
        if capture.has("theta_elec_deg"):
            angles = capture.arrays("theta_elec_deg")["theta_elec_deg"].tolist()
        places = (parts * angle / wave_deg for angle in angles if math.isfinite(angle))
        locked |= {round(place) % parts for place in places}
    return len(locked)


def encoder_step(campaign: Campaign, policy: Policy) -> float:
    """The step of the encoder in drive logs; in coasts where there are none.

    Parameters
    ----------
    campaign
        All captures of one motor.
    policy
        Constants of judgement.

    Returns
    -------
    float
        [rad]; 0 where there is none that they agree on.

    Notes
    -----
    A record at many speeds shows it; at one speed an angle may move by nearly whole steps a sample,
    and look finer or coarser than it is. Rows that are read between others are in no steps.

    """
    drives, coasts = (
        [c for c in campaign.of(test) if c.has("theta_mech_rad")] for test in ("drive", "spin_down")
    )
    angles = [on_counts(c, "theta_mech_rad", policy.cutting) for c in drives or coasts]
    steps = [rounding_step(angle, policy.sensor_noise) for angle in angles]
    step = float(np.median(steps)) if steps else 0.0
    agree = all(abs(one - step) <= policy.cutting.encoder_share * step for one in steps)
    return step if agree else 0.0


def base_scales(machine: Machine) -> dict[str, float]:
    """Order of magnitude of every base constant.

    Parameters
    ----------
    machine
        Scales of the machine.

    Returns
    -------
    dict of float
        By name, in the unit of the name.

    """
    s = machine.scales
    impedance = s["voltage_v"] / s["current_a"]
    return {
        "r_ohm": impedance,
        "ld_h": s["flux_wb"] / s["current_a"],
        "lq_h": s["flux_wb"] / s["current_a"],
        "psi_wb": s["flux_wb"],
        "j_kgm2": s["torque_nm"] / s["speed_rad_s"] * s.get("settling_s", 0.1),
        "b_nm_s_rad": 0.1 * s["torque_nm"] / s["speed_rad_s"],
    }


def pole_pairs_of(campaign: Campaign, start: Constants) -> int | None:
    """Electrical cycles a turn.

    Parameters
    ----------
    campaign
        Captures of the motor.
    start
        Constants that are known.

    Returns
    -------
    int or None
        Counted in an open-circuit spin, else from `start`, else of the nameplate; None where
        nothing gives it.

    """
    counted = counted_pole_pairs(campaign)
    if counted is not None:
        return counted
    known = start.best("pole_pairs")
    if known is not None:
        return round(known.number)
    stated = campaign.nameplate("pole_pairs")
    return int(str(stated)) if stated else None


def counted_pole_pairs(campaign: Campaign) -> int | None:
    """Electrical cycles a turn, counted in an open-circuit spin of a turn or more.

    Parameters
    ----------
    campaign
        All captures of one motor.

    Returns
    -------
    int or None
        Of the first spin whose count is within 0.02 of a whole number; None where there is none.

    """
    for recorded in campaign.of("open_circuit"):
        capture = with_values(recorded)
        if capture is None or not capture.has("theta_mech_rad"):
            continue
        lines = [name for name in LINES_V if capture.has(name)]
        if len(lines) < 2:
            continue
        columns = capture.arrays(*lines, "theta_mech_rad")
        theta = columns.pop("theta_mech_rad")
        turned = float(np.ptp(theta)) if theta.size else 0.0
        if turned < TURN_RAD:
            continue
        ratio = float(np.ptp(np.unwrap(np.angle(vector_of_lines(columns))))) / turned
        if ratio > 0.5 and abs(ratio - round(ratio)) < 0.02:
            return round(ratio)
    return None


def _largest(captures: Iterable[Capture], names: tuple[str, ...]) -> float:
    top = 0.0
    for capture in captures:
        for name in names:
            if capture.has(name):
                top = max(top, float(np.nanquantile(np.abs(capture.arrays(name)[name]), 0.999)))
    return top


def _speed(capture: Capture) -> float:
    """The largest speed [rad/s] but for spikes; 0 of an angle that moves by its rounding alone.

    Of a spin without either it is the mean one by the phase of its voltages, of a turn by hand that
    of one turn in its time.
    """
    if capture.has("omega_mech_rad_s"):
        speed = capture.arrays("omega_mech_rad_s")["omega_mech_rad_s"]
        return float(np.nanquantile(np.abs(speed), 0.999))
    if capture.has("t_s", "theta_mech_rad"):
        columns = capture.arrays("t_s", "theta_mech_rad")
        if columns["t_s"].size > 1 and (np.diff(columns["t_s"]) > 0.0).all():
            theta = columns["theta_mech_rad"]
            if np.ptp(theta) <= theta.size * np.spacing(np.max(np.abs(theta))):
                return 0.0
            speed = np.gradient(theta, columns["t_s"])
            return float(np.nanquantile(np.abs(speed), 0.999))
    lines = [name for name in LINES_V if capture.has("t_s", name)]
    if capture.meta.test == "open_circuit" and len(lines) > 1:
        columns = capture.finite("t_s", *lines)
        time = columns.pop("t_s")
        turned = (
            float(np.ptp(np.unwrap(np.angle(vector_of_lines(columns))))) if time.size > 1 else 0.0
        )
        return turned / float(np.ptp(time)) / (capture.meta.pole_pairs or 1) if turned else 0.0
    if capture.meta.test == "hand_turn" and capture.has("t_s"):
        return TURN_RAD / float(np.ptp(capture.arrays("t_s")["t_s"]))
    return 0.0


def _period(capture: Capture) -> float:
    return float(np.median(np.diff(capture.arrays("t_s")["t_s"])))


def torque_orders(captures: Iterable[Capture], highest: int) -> tuple[int, ...]:
    """Orders that stand out of the torque spectrum of slow turns.

    Parameters
    ----------
    captures
        Slow turns.
    highest
        Highest order [1/turn].

    Returns
    -------
    tuple of int
        [1/turn], rising.

    Notes
    -----
    The torque is averaged in even bins of angle over whole turns, as many as have a sample each; an
    order counts where its amplitude is 6 times the spectrum's median (of a Rayleigh floor 2^-36 of
    orders pass that), in every capture whose bins are fine enough to show it.

    """
    spectra = []
    for capture in captures:
        if capture.has("theta_mech_rad", "torque_shaft_nm"):
            signals = capture.finite("theta_mech_rad", "torque_shaft_nm")
            theta, torque = signals["theta_mech_rad"], signals["torque_shaft_nm"]
            spectra.append(_standing_out(theta, torque, highest))
    orders = set().union(*(found for _, found in spectra))
    return tuple(sorted(k for k in orders if all(k in found or k > to for to, found in spectra)))


def _standing_out(theta: Array, torque: Array, highest: int) -> tuple[int, set[int]]:
    """The highest order that would stand out of a capture's angles, and those that do."""
    bins, turns = _even_bins(theta, _BINS_AN_ORDER * highest), max(int(np.ptp(theta) / TURN_RAD), 1)
    seen, shown = bins // _BINS_AN_ORDER, min(highest, (bins - 1) // 2)
    if seen < 1:
        return 0, set()
    place = np.floor((theta - theta.min()) / TURN_RAD * bins + 0.5).astype(np.int64)
    inside = place < turns * bins
    place = place[inside] % bins
    count = np.maximum(np.bincount(place, minlength=bins), 1)
    mean = np.bincount(place, torque[inside], minlength=bins) / count
    spectrum = np.abs(np.fft.rfft(mean))[1 : shown + 1]
    floor = float(np.median(spectrum))
    return seen, {int(k) + 1 for k in np.flatnonzero(spectrum > 6.0 * floor)}


def _even_bins(theta: Array, most: int) -> int:
    """Bins of angle a turn that have a sample each, `most` of them where samples are many.

    Of an encoder they hold as many lines each: where bins hold one line and two by turns, a strong
    order beats with them, and others stand out.
    """
    around = np.sort((theta - theta.min()) % TURN_RAD)
    steps = np.append(np.diff(around), TURN_RAD - around[-1])
    # what rounding of a number alone parts is one angle
    apart = steps[steps > _SAME_ANGLE * TURN_RAD]
    filled = TURN_RAD / float(apart.max())
    lines = round(TURN_RAD / float(np.quantile(apart, 0.1)))
    least = math.ceil(lines / filled - 0.01)
    each = (m for m in range(max(lines // most, least), least - 1, -1) if lines % m == 0)
    return next((lines // m for m in each), min(most, int(filled)))


PARAMETERS: Mapping[str, str] = {
    "r_phase_ohm": "r_ohm",
    "ld_h": "ld_h",
    "lq_h": "lq_h",
    "psi_pm_wb": "psi_wb",
    "j_rotor_kgm2": "j_kgm2",
    "b_visc_nm_s_rad": "b_nm_s_rad",
    "torque_coulomb_nm": "coulomb_friction.torque_nm",
    "temp_coeff_copper_1_k": "copper_temperature.alpha_1_k",
    "temp_coeff_magnet_1_k": "magnet_temperature.alpha_1_k",
}
"""The parameter that a constant is."""
_OF_PAIRS = ("psi_pm_wb", "ld_h", "lq_h")


def stated_parameters(
    stated: Iterable[Estimate], pole_pairs: int, *, counted: bool = True
) -> dict[str, tuple[float, float]]:
    """Value and standard uncertainty by parameter, in its unit.

    Parameters
    ----------
    stated
        Of `records.stated`. Of several that say one parameter the one with the least relative
        uncertainty counts: they may all come from one measurement.
    pole_pairs
        Of the motor, for torque and back-EMF constants.
    counted
        Whether they are known; where not, a flux linkage or inductance says nothing of them.

    Notes
    -----
    Those are the flux linkage of the magnet: k = p ψ in each convention (`COUPLINGS`).

    """
    values: dict[str, tuple[float, float]] = {}
    for one in stated:
        name, value, u = PARAMETERS.get(one.name, ""), one.number, one.u
        if one.name == "r_ll_ohm":
            name, value, u = "r_ohm", value / 2.0, u / 2.0
        elif one.name in COUPLINGS and value > 0.0:
            flux_wb = coupling_from(one.name, value) / pole_pairs
            name, value, u = "psi_wb", flux_wb, flux_wb * u / value
        if not name or u <= 0.0 or (one.name in _OF_PAIRS and not counted):
            continue
        if name not in values or u * abs(values[name][0]) < values[name][1] * abs(value):
            values[name] = value, u
    return values
