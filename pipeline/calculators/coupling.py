"""Calculators of the coupling between electricity and torque: ke-kt, kv, grip."""

from __future__ import annotations

from typing import get_args

from pipeline.calculators.quantities import Answer, Calculator, Given, Key, Line, agreed
from pipeline.physics.coupling import (
    COUPLINGS,
    CouplingName,
    coupling_as,
    coupling_from,
    motor_constant_nm_sqrt_w,
)
from pipeline.physics.units import RAD_S_PER_RPM
from pipeline.records.errors import UsageError

NAMES: tuple[CouplingName, ...] = get_args(CouplingName)
KE_READINGS: dict[str, CouplingName] = {
    "phase_peak": "ke_phase_peak_v_s_rad",
    "ll_peak": "ke_ll_peak_v_s_rad",
    "ll_rms": "ke_ll_rms_v_s_rad",
}
KV_READINGS: dict[str, CouplingName] = {
    "ll_peak": "kv_ll_peak_rpm_v",
    "six_step": "kv_six_step_rpm_v",
}
DC = "dc"
DC_WORDS = (
    "DC-equivalent (DC machine, or trapezoidal back-EMF with two phases on, line-line flat top); "
    "for a sine back-EMF say what the volts were with reading="
)
SINE_WORDS = "sine back-EMF, amplitude-invariant frame, k = p·psi; Kt_peak = (√3/2)·Ke_ll_peak"
RPM_PER_RAD_S = 1.0 / RAD_S_PER_RPM

SINE_KEYS = (
    *(Key(name, COUPLINGS[name].unit, COUPLINGS[name].words) for name in NAMES),
    Key("psi_pm_wb", "Wb", "magnet flux linkage, phase peak; needs pole_pairs", ("psi",)),
    Key("pole_pairs", "1", "pole pairs", ("p",)),
    Key("r_phase_ohm", "ohm", "phase resistance, for the motor constant"),
)


def _sine_couplings(given: Given) -> dict[str, float]:
    """The coupling k = p·psi [V·s/rad] as each of the given quantities implies it."""
    implied: dict[str, float] = {}
    for name in NAMES:
        if given.has(name):
            implied[name] = coupling_from(name, given.one(name))
    if given.has("psi_pm_wb", "pole_pairs"):
        implied["psi_pm_wb"] = given.one("pole_pairs") * given.one("psi_pm_wb")
    return implied


def _sine_lines(given: Given, k_v_s_rad: float) -> list[Line]:
    """The coupling in every convention, and what else the given keys allow."""
    lines = [
        Line(name, coupling_as(name, k_v_s_rad), form.unit, form.formula, form.words)
        for name, form in COUPLINGS.items()
    ]
    if given.has("pole_pairs"):
        psi = k_v_s_rad / given.one("pole_pairs")
        lines.append(Line("psi_pm_wb", psi, "Wb", "k/p", "magnet flux linkage, phase peak"))
    if given.has("r_phase_ohm"):
        kt = coupling_as("kt_peak_nm_a", k_v_s_rad)
        constant = motor_constant_nm_sqrt_w(kt, given.one("r_phase_ohm"))
        words = "torque per root of copper loss, the same in every convention"
        lines.append(
            Line("motor_constant_nm_sqrt_w", constant, "N·m/sqrt(W)", "Kt_peak/√(1.5·R)", words)
        )
    return lines


def _in_one_convention(
    given: Given, plain: dict[str, float], readings: dict[str, CouplingName], reading: str
) -> dict[str, float]:
    """The sine couplings, with the plain quantities counted as `reading` says."""
    implied = _sine_couplings(given)
    if plain and reading == DC:
        if implied:
            raise UsageError(
                f"calc {given.kind}: {next(iter(plain))} beside {next(iter(implied))} does not say "
                "its convention",
                f"add reading={'|'.join(readings)}",
            )
        return {}
    for name, value in plain.items():
        implied[name] = coupling_from(readings[reading], value)
    return implied


def _ke_kt(given: Given) -> Answer | None:
    plain = {"ke_v_s_rad": given.one("ke_v_s_rad")} if given.has("ke_v_s_rad") else {}
    if given.has("v_v", "omega_mech_rad_s"):
        plain["v_v over omega_mech_rad_s"] = _ke_from_readings(given)
    reading = given.texts.get("reading", DC)
    implied = _in_one_convention(given, plain, KE_READINGS, reading)
    if implied and not given.has("kt_nm_a"):
        return Answer(tuple(_sine_lines(given, agreed(given, implied))), SINE_WORDS)
    if implied:
        raise UsageError(
            f"calc {given.kind}: kt_nm_a is DC-equivalent, {next(iter(implied))} is not",
            "give kt_peak, kt_rms, kt_power_invariant or kt_six_step",
        )
    if given.has("kt_nm_a"):
        plain["kt_nm_a"] = given.one("kt_nm_a")
    return Answer(tuple(_dc_lines(agreed(given, plain))), DC_WORDS) if plain else None


def _ke_from_readings(given: Given) -> float:
    """Least squares through the origin: Ke = Σ v ω / Σ ω² [V·s/rad]."""
    volts, speeds = given.numbers["v_v"], given.numbers["omega_mech_rad_s"]
    if len(volts) != len(speeds):
        raise UsageError(
            f"calc {given.kind}: {len(volts)} voltages and {len(speeds)} speeds",
            "give one speed a voltage",
        )
    return sum(v * w for v, w in zip(volts, speeds, strict=True)) / sum(w * w for w in speeds)


def _dc_lines(ke: float) -> list[Line]:
    lines = [
        Line("ke_v_s_rad", ke, "V·s/rad", "v/ω = Kt", "back-EMF per rad/s"),
        Line("kt_nm_a", ke, "N·m/A", "Ke", "torque per ampere: P = Ke·ω·I"),
        Line("ke_v_krpm", ke * 1e3 * RAD_S_PER_RPM, "V/krpm", "Ke·1000·2π/60", "per 1000 rpm"),
        Line("kv_rpm_v", RPM_PER_RAD_S / ke, "rpm/V", "60/(2π·Ke)", "speed per volt"),
    ]
    for reading, name in KE_READINGS.items():
        kt = coupling_as("kt_peak_nm_a", coupling_from(name, ke))
        formula = f"1.5·Ke/{COUPLINGS[name].formula.removesuffix('·k').replace('k', '1')}"
        words = f"per peak ampere, if those volts were the {COUPLINGS[name].words.split(', ')[1]}"
        lines.append(Line(f"kt_peak_nm_a ({reading})", kt, "N·m/A", formula, words))
    return lines


KE_KT = Calculator(
    "back-EMF and torque constants in every convention",
    (
        Key("ke_v_s_rad", "V·s/rad", "back-EMF, counted as reading says"),
        Key("kt_nm_a", "N·m/A", "torque per ampere, DC-equivalent"),
        Key("v_v", "V", "back-EMF read at each speed, as 4,8", many=True),
        Key("omega_mech_rad_s", "rad/s", "speed of each reading", ("omega", "speed"), many=True),
        Key("reading", "", "what the volts of ke or v were", choices=(DC, *KE_READINGS)),
        *SINE_KEYS,
    ),
    (
        "ke, kt or v and omega: the others (DC-equivalent, or as reading says)",
        "any named constant, or psi and pole_pairs: all the others; with r_phase: K_m as well",
    ),
    _ke_kt,
)


def _kv(given: Given) -> Answer | None:
    reading = given.texts.get("reading", "ll_peak")
    plain = {"kv_rpm_v": given.one("kv_rpm_v")} if given.has("kv_rpm_v") else {}
    if given.has("v_v", "omega_mech_rad_s") and not plain:
        plain["speed over v"] = given.one("omega_mech_rad_s") * RPM_PER_RAD_S / given.one("v_v")
    implied = _in_one_convention(given, plain, KV_READINGS, reading)
    if implied:
        k = agreed(given, implied)
        kv, words = coupling_as("kv_ll_peak_rpm_v", k), SINE_WORDS
        lines = _sine_lines(given, k)
        dc_kt, dc_words = RPM_PER_RAD_S / kv, "the DC form of the same KV: 15.5 % above Kt_peak"
        lines.append(Line("kt_dc_nm_a", dc_kt, "N·m/A", "9.549/KV", dc_words))
    elif plain:
        kv, words = agreed(given, plain), DC_WORDS
        lines = [Line("kv_rpm_v", kv, "rpm/V", "60·ω/(2π·v)", "speed per volt")]
        lines += _dc_lines(RPM_PER_RAD_S / kv)[:3]
    else:
        return None
    return Answer((*lines, *_no_load_lines(given, kv)), words)


def _no_load_lines(given: Given, kv_rpm_v: float) -> list[Line]:
    if given.has("v_v") and not given.has("omega_mech_rad_s"):
        omega = kv_rpm_v * given.one("v_v") * RAD_S_PER_RPM
        words = "ideal no-load speed at that voltage"
        return [
            Line("omega_mech_rad_s", omega, "rad/s", "KV·v·2π/60", words),
            Line("speed_rpm", omega * RPM_PER_RAD_S, "rpm", "KV·v", words),
        ]
    if given.has("omega_mech_rad_s") and not given.has("v_v"):
        volts = given.one("omega_mech_rad_s") * RPM_PER_RAD_S / kv_rpm_v
        return [Line("v_v", volts, "V", "60·ω/(2π·KV)", "back-EMF at that speed")]
    return []


KV = Calculator(
    "speed per volt, what torque it stands for and the no-load speed",
    (
        Key("kv_rpm_v", "rpm/V", "speed per volt, counted as reading says"),
        Key("reading", "", "what the volts of kv were", choices=(*KV_READINGS, DC)),
        Key("v_v", "V", "voltage, for the no-load speed"),
        Key("omega_mech_rad_s", "rad/s", "speed, for the back-EMF", ("omega", "speed")),
        *SINE_KEYS,
    ),
    (
        "kv, v and speed, any named constant, or psi and pole_pairs: all constants",
        "one of these and v or speed: the no-load speed or the back-EMF",
    ),
    _kv,
)


def _grip(given: Given) -> Answer | None:
    kt, torque, current = (given.any(n) for n in ("kt_nm_a", "torque_nm", "current_a"))
    if kt and torque and not current:
        value = given.one("torque_nm") / given.one("kt_nm_a")
        line = Line("current_a", value, "A", "T/Kt", "twice the torque, twice the current")
    elif kt and current and not torque:
        value = given.one("current_a") * given.one("kt_nm_a")
        line = Line("torque_nm", value, "N·m", "Kt·I", "twice the current, twice the torque")
    elif torque and current and not kt:
        value = given.one("torque_nm") / given.one("current_a")
        line = Line("kt_nm_a", value, "N·m/A", "T/I", "torque per ampere")
    elif kt and torque and current:
        implied = given.one("torque_nm") / given.one("current_a")
        both = {"kt_nm_a": given.one("kt_nm_a"), "torque_nm/current_a": implied}
        line = Line("kt_nm_a", agreed(given, both), "N·m/A", "T/I", "all three agree")
    else:
        return None
    convention = (
        "torque at the motor's shaft, friction not in it; ampere counted as Kt counts it "
        "(peak, rms or DC)"
    )
    return Answer((line,), convention)


GRIP = Calculator(
    "current for a holding torque",
    (
        Key("kt_nm_a", "N·m/A", "torque constant", ("kt_peak", "kt_rms")),
        Key("torque_nm", "N·m", "motor torque", ("t",)),
        Key("current_a", "A", "current, counted as kt counts it", ("i",)),
    ),
    ("two of kt, torque and current: the third",),
    _grip,
)
