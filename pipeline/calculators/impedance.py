"""Calculators of resistance and inductance: wye-delta, copper, saliency."""

from __future__ import annotations

import math

from pipeline.calculators.quantities import Answer, Calculator, Given, Key, Line, agreed
from pipeline.physics.copper import (
    COPPER_COEFFICIENT_25_1_K,
    COPPER_ZERO_K,
    coefficient_at_1_k,
    copper_resistance_ohm,
    copper_temperature_degc,
    linear_resistance_ohm,
)
from pipeline.physics.windings import (
    Phases,
    delta_from_wye,
    delta_windings_ohm,
    line_from_phase,
    line_resistances_ohm,
    phase_from_line,
    phase_resistances_ohm,
    saliency_words,
    terminal_inductance_h,
    unaligned_inductances_h,
    wye_from_delta,
)
from pipeline.records.errors import UsageError

WYE = "wye equivalent: what a drive sees a phase, published for wye and delta alike"
PAIRS = ("ab", "bc", "ca")
# A bridge reads to a part in a thousand: below that the angle is that of its errors.
EQUAL = 1e-3
PHASE = "inductances of one phase, wye equivalent"


def _wye_delta(given: Given) -> Answer | None:
    lines: list[Line] = []
    for letter, unit, what in (("r", "ohm", "resistance"), ("l", "H", "inductance")):
        lines += _balanced(given, letter, unit, what)
    if given.any("r_ab_ohm", "r_bc_ohm", "r_ca_ohm", "r_a_ohm", "r_b_ohm", "r_c_ohm"):
        unbalanced = _unbalanced(given)
        if unbalanced is None:
            return None
        lines += unbalanced
    if given.texts.get("winding") == "wye":
        lines = [line for line in lines if "delta" not in line.name]
    return Answer(tuple(lines), WYE) if lines else None


def _balanced(given: Given, letter: str, unit: str, what: str) -> list[Line]:
    suffix = unit.lower()
    line, phase, delta = (f"{letter}_{x}_{suffix}" for x in ("ll", "phase", "delta"))
    line_values: dict[str, float] = {}
    if given.has(line):
        line_values[line] = phase_from_line(given.one(line))
    if given.has(phase):
        line_values[phase] = given.one(phase)
    if given.has(delta):
        line_values[delta] = wye_from_delta(given.one(delta))
    if not line_values:
        return []
    value = agreed(given, line_values, "impedance")
    big = letter.upper()
    from_phase = f"3·{big}_phase" if phase in line_values else f"1.5·{big}_ll"
    phase_formula = (
        f"{big}_delta/3" if line not in line_values and delta in line_values else f"{big}_ll/2"
    )
    return [
        Line(phase, value, unit, phase_formula, f"{what} of the wye equivalent"),
        Line(line, line_from_phase(value), unit, f"2·{big}_phase", "between two terminals"),
        Line(delta, delta_from_wye(value), unit, from_phase, "one winding, if wound in delta"),
    ]


def _unbalanced(given: Given) -> list[Line] | None:
    lines = given.any("r_ab_ohm", "r_bc_ohm", "r_ca_ohm")
    phases = given.any("r_a_ohm", "r_b_ohm", "r_c_ohm")
    if lines and phases:
        raise UsageError(
            f"calc {given.kind}: pairs and phases are both given", "give one of the two"
        )
    if len(lines or phases) != 3:
        return None
    if lines:
        solved = phase_resistances_ohm(*(given.one(name) for name in lines))
        if min(solved) <= 0.0:
            raise UsageError(
                f"calc {given.kind}: no winding has these three resistances",
                "none may exceed the sum of the other two",
            )
        formulas = ("(R_ab+R_ca−R_bc)/2", "(R_ab+R_bc−R_ca)/2", "(R_bc+R_ca−R_ab)/2")
    else:
        solved = Phases(*(given.one(name) for name in phases))
        formulas = ("given", "given", "given")
    rows = [
        Line(f"r_{phase}_ohm", value, "ohm", formula, "wye equivalent")
        for phase, value, formula in zip("abc", solved, formulas, strict=True)
    ]
    read = line_resistances_ohm(*solved)
    wound = delta_windings_ohm(*solved)
    for index, pair in enumerate(PAIRS):
        formula = f"R_{pair[0]}+R_{pair[1]}"
        rows.append(Line(f"r_{pair}_ohm", read[index], "ohm", formula, "between terminals"))
    for index, pair in enumerate(PAIRS):
        other = ({*"abc"} - {*pair}).pop()
        formula = f"(R_a·R_b+R_b·R_c+R_c·R_a)/R_{other}"
        rows.append(
            Line(f"r_delta_{pair}_ohm", wound[index], "ohm", formula, "winding, if wound in delta")
        )
    return rows


WYE_DELTA = Calculator(
    "resistance and inductance between wye, delta and terminals",
    (
        Key("r_ll_ohm", "ohm", "resistance between two terminals"),
        Key("r_phase_ohm", "ohm", "of one phase, wye equivalent", ("r_wye",)),
        Key("r_delta_ohm", "ohm", "of one winding of a delta"),
        Key("l_ll_h", "H", "inductance between two terminals, mean over the angle"),
        Key("l_phase_h", "H", "of one phase, wye equivalent", ("l_wye",)),
        Key("l_delta_h", "H", "of one winding of a delta"),
        *(Key(f"r_{pair}_ohm", "ohm", f"between terminals {pair}") for pair in PAIRS),
        *(Key(f"r_{x}_ohm", "ohm", f"of phase {x}, wye equivalent") for x in "abc"),
        Key("winding", "", "how it is wound", choices=("wye", "delta")),
    ),
    (
        "r_ll, r_phase or r_delta (l_ll, l_phase, l_delta): the other two",
        "r_ab, r_bc and r_ca: the three phases; r_a, r_b and r_c: the three pairs",
    ),
    _wye_delta,
)


def _copper(given: Given) -> Answer | None:
    if given.has("alpha_1_k") != given.has("alpha_at_degc"):
        raise UsageError(
            f"calc {given.kind}: a coefficient needs the temperature it is referred to",
            "give alpha=0.00393 and alpha_at=20 together",
        )
    if given.has("r_ohm", "from_degc", "r_hot_ohm"):
        return _copper_from_two(given)
    if given.has("r_ohm", "from_degc", "to_degc"):
        return _copper_at(given)
    if given.has("alpha_1_k", "to_degc"):
        alpha, start, to = (given.one(n) for n in ("alpha_1_k", "alpha_at_degc", "to_degc"))
        moved = coefficient_at_1_k(alpha, start, to)
        words = f"the same winding's coefficient, referred to {to:g} degC"
        line = Line("alpha_1_k", moved, "1/K", "α/(1 + α·(T' − T))", words)
        return Answer((line,), "every coefficient names its reference temperature")
    return None


def _copper_at(given: Given) -> Answer:
    r, start, to = (given.one(name) for name in ("r_ohm", "from_degc", "to_degc"))
    words = f"at {to:g} degC"
    if given.has("alpha_1_k"):
        alpha, at = given.one("alpha_1_k"), given.one("alpha_at_degc")
        hot = linear_resistance_ohm(r, start, to, alpha, at)
        formula = "R0·(1 + α·(T − Tα))/(1 + α·(T0 − Tα))"
        convention = f"linear, α = {alpha:g} 1/K referred to {at:g} degC"
    else:
        hot = float(copper_resistance_ohm(r, to, start))
        formula = "R0·(234.5 + T)/(234.5 + T0)"
        convention = "annealed copper; α is 1/259.5 = 0.003854 1/K at 25 degC, 0.00393 at 20 degC"
    return Answer((Line("r_ohm", hot, "ohm", formula, words),), convention)


def _copper_from_two(given: Given) -> Answer:
    """Temperature from the rise of resistance, or the coefficient where both are known."""
    r, start, hot = (given.one(name) for name in ("r_ohm", "from_degc", "r_hot_ohm"))
    if given.has("to_degc"):
        alpha = (hot / r - 1.0) / (given.one("to_degc") - start)
        copper = coefficient_at_1_k(COPPER_COEFFICIENT_25_1_K, 25.0, start)
        words = f"referred to {start:g} degC; copper has {copper:.6f} there"
        line = Line("alpha_1_k", alpha, "1/K", "(R/R0 − 1)/(T − T0)", words)
        return Answer((line,), "a coefficient names its reference temperature")
    temp = copper_temperature_degc(hot, r, start)
    line = Line(
        "to_degc", temp, "degC", "R/R0·(234.5 + T0) − 234.5", "winding, mean over its length"
    )
    return Answer((line,), "annealed copper")


COPPER = Calculator(
    "resistance of copper and its temperature",
    (
        Key("r_ohm", "ohm", "known resistance", ("r0",)),
        Key("from_degc", "degC", "temperature at which it is known", ("t0",), low=-COPPER_ZERO_K),
        Key("to_degc", "degC", "other temperature", ("t",), low=-COPPER_ZERO_K),
        Key("r_hot_ohm", "ohm", "resistance at the other temperature"),
        Key("alpha_1_k", "1/K", "linear coefficient, in place of copper's law"),
        Key("alpha_at_degc", "degC", "temperature the coefficient is referred to", low=-273.15),
    ),
    (
        "r, from and to: the resistance there (with alpha and alpha_at: by that coefficient)",
        "r, from and r_hot: the winding's temperature; with to as well: the coefficient",
        "alpha, alpha_at and to: the coefficient referred to another temperature",
    ),
    _copper,
)


def _saliency(given: Given) -> Answer | None:
    pairs = tuple(f"l{pair}_h" for pair in PAIRS)
    if given.has(*pairs):
        return _from_three_pairs(given, pairs)
    if given.has("ld_h", "saliency_ratio") and not given.has("lq_h"):
        ld, lq = given.one("ld_h"), given.one("ld_h") * given.one("saliency_ratio")
    elif given.has("lq_h", "saliency_ratio") and not given.has("ld_h"):
        ld, lq = given.one("lq_h") / given.one("saliency_ratio"), given.one("lq_h")
    elif given.has("ld_h", "lq_h"):
        ld, lq = given.one("ld_h"), given.one("lq_h")
    else:
        return None
    ratio = lq / ld
    if given.has("saliency_ratio"):
        agreed(
            given, {"saliency_ratio": given.one("saliency_ratio"), "lq_h/ld_h": ratio}, "impedance"
        )
    lines = [
        Line("saliency_ratio", ratio, "1", "L_q/L_d", saliency_words(ratio)),
        Line("ld_h", ld, "H", "half of L_ab at −30°", "on the magnet's axis"),
        Line("lq_h", lq, "H", "half of L_ab at 60°", "90° electrical away"),
    ]
    if given.has("theta_elec_deg"):
        theta = math.radians(given.one("theta_elec_deg"))
        for pair, shift in zip(PAIRS, ("+ 60°", "− 180°", "− 60°"), strict=True):
            read = float(terminal_inductance_h(ld, lq, theta, pair))
            formula = f"(L_d+L_q) + (L_d−L_q)·cos(2θ {shift})"
            lines.append(Line(f"l{pair}_h", read, "H", formula, f"between terminals {pair}"))
    return Answer(tuple(lines), f"{PHASE}; a meter across two terminals reads twice as much")


def _from_three_pairs(given: Given, pairs: tuple[str, ...]) -> Answer:
    inductances = unaligned_inductances_h(*(given.one(name) for name in pairs))
    if inductances.low_h <= 0.0:
        raise UsageError(
            f"calc {given.kind}: these three readings are of no three-phase winding",
            "read all three pairs at one rotor angle, the third terminal open",
        )
    ratio = inductances.high_h / inductances.low_h
    angle = math.degrees(inductances.theta_low_rad)
    words = "L_d with interior magnets; the back-EMF or an alignment shows which is which"
    lines = [
        Line("l_low_h", inductances.low_h, "H", "(m − A)/2, m mean, A = √(⅔·Σ(L−m)²)", words),
        Line("l_high_h", inductances.high_h, "H", "(m + A)/2", "L_q with interior magnets"),
        Line("saliency_ratio", ratio, "1", "high/low", saliency_words(ratio)),
    ]
    if ratio - 1.0 > EQUAL:
        place = "electrical angle of the low axis, up to 180°"
        lines.append(Line("theta_low_deg", angle, "deg", "", place))
    return Answer(tuple(lines), f"{PHASE}, from terminal readings with the third terminal open")


SALIENCY = Calculator(
    "axis inductances, what they say of the rotor and what a meter reads",
    (
        Key("ld_h", "H", "phase inductance on the pole axis", ("l_pole_axis", "l_0")),
        Key("lq_h", "H", "phase inductance 90° electrical away", ("l_quadrature", "l_90")),
        Key("saliency_ratio", "1", "L_q over L_d", ("ratio",)),
        Key("theta_elec_deg", "deg", "rotor angle for terminal readings", ("theta",), -1e6),
        *(
            Key(f"l{pair}_h", "H", f"read between terminals {pair}", (f"l_{pair}",))
            for pair in PAIRS
        ),
    ),
    (
        "two of ld, lq and ratio; with theta_elec: what a meter reads on each pair",
        "lab, lbc and lca at one unknown angle: both axis inductances",
    ),
    _saliency,
)
