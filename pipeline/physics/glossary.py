"""Every column and constant once: name, unit, words, range.

The pandera contracts, JSON Schemas, docs and unit checks are built from here. A plug-in that
publishes a constant of its own declares a `Term` in its own file; the published names of
`contract/` are all here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from pipeline.physics.units import SUFFIX_UNITS

TermKind = Literal["column", "constant", "metadata"]
# What a motor cannot be without; an exact zero is a dead channel, not a measurement.
TINY = 1e-12
TESTS: dict[str, str] = {
    "resistance": "DC steps through one terminal pair, four-wire",
    "current_step": "rotor locked, voltage step on one terminal pair",
    "lcr": "LCR meter across a pair at several rotor angles",
    "open_circuit": "terminals open, shaft driven at several speeds",
    "hand_turn": "one mechanical turn by hand, terminals open",
    "cogging": "zero current, slow turn, both directions",
    "torque_map": "dynamometer holds speed, steps of d and q current",
    "spin_down": "coasts with terminals open",
    "heat_run": "current on a locked or slow rotor until it warms",
    "holding_current": "rotor held at many angles, both directions",
    "flux_map": "table of currents and flux linkages",
    "drive": "everyday closed-loop log",
    "torque_table": "static table of torque and current",
}
TESTS_WITHOUT_CLOCK = frozenset({"lcr", "flux_map", "torque_table"})
"""Tests whose captures are tables: their rows come in no time."""
OHMMETER = ("rab_ohm", "rbc_ohm", "rca_ohm")
"""What an ohmmeter shows of each terminal pair: a `resistance` capture may be a table of them."""


@dataclass(frozen=True, slots=True)
class Term:
    """One name of the glossary.

    Attributes
    ----------
    name
        Its unit is the last part, from the closed table of suffixes.
    unit, words
        Unit, and meaning in a few words.
    kind
        `column`, `constant` or `metadata`.
    low, high
        Bounds of what is physically plausible [unit], both inclusive; None without a bound.
    integer
        Whether only whole numbers are meant.

    Raises
    ------
    ValueError
        The suffix is that of another unit, or the bounds leave no value.

    """

    name: str
    unit: str
    words: str
    kind: TermKind
    low: float | None = None
    high: float | None = None
    integer: bool = False

    def __post_init__(self) -> None:
        stated = SUFFIX_UNITS.get(suffix_of(self.name))
        if stated is not None and stated != self.unit:
            raise ValueError(f"{self.name} ends in the suffix of {stated} but states {self.unit}")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError(f"{self.name} is plausible from {self.low} to {self.high}: nowhere")


def suffix_of(name: str) -> str:
    """The unit suffix that ends a name.

    Parameters
    ----------
    name
        Of a column, constant or key.

    Returns
    -------
    str
        The longest suffix of `SUFFIX_UNITS` that fits; empty where none does.

    Examples
    --------
    >>> suffix_of("omega_mech_rad_s"), suffix_of("pole_pairs")
    ('rad_s', '')

    """
    parts = name.split("_")
    for start in range(1, len(parts)):
        tail = "_".join(parts[start:])
        if tail in SUFFIX_UNITS:
            return tail
    return ""


def unit_of(name: str) -> str:
    """The unit that the suffix of a name stands for.

    Parameters
    ----------
    name
        A name of the glossary's form.

    Returns
    -------
    str
        `1` where the name has no suffix of a unit.

    """
    return SUFFIX_UNITS.get(suffix_of(name), "1")


def _columns() -> Iterable[Term]:
    def column(name: str, unit: str, words: str, low: float, high: float) -> Term:
        return Term(name, unit, words, "column", low, high)

    yield column("t_s", "s", "sampling instant, strictly increasing", -1e9, 1e10)
    for phase in "abc":
        yield column(f"v{phase}_v", "V", f"phase {phase} to star point", -2e3, 2e3)
    for pair in ("ab", "bc", "ca"):
        yield column(f"v{pair}_v", "V", f"terminal {pair[0]} to {pair[1]}", -4e3, 4e3)
    for phase in "abc":
        yield column(
            f"i{phase}_a", "A", f"line current {phase}, positive into the motor", -5e3, 5e3
        )
    for axis, words in (("d", "on the magnet's flux"), ("q", "a quarter turn ahead of d")):
        yield column(f"v{axis}_v", "V", f"rotor-frame voltage, {axis} {words}", -2e3, 2e3)
        yield column(f"i{axis}_a", "A", f"rotor-frame current, {axis} {words}", -5e3, 5e3)
        yield column(f"psi_{axis}_wb", "Wb", f"flux linkage, {axis} {words}", -100.0, 100.0)
    yield column("vdc_v", "V", "DC link voltage", -10.0, 2e3)
    yield column("idc_a", "A", "DC link current", -5e3, 5e3)
    yield column("theta_mech_rad", "rad", "shaft angle, unwrapped", -1e9, 1e9)
    yield column("theta_elec_rad", "rad", "electrical angle, unwrapped", -1e10, 1e10)
    yield column("omega_mech_rad_s", "rad/s", "the bench's own shaft speed", -2e4, 2e4)
    yield column("torque_shaft_nm", "N·m", "what the shaft delivers to the load", -1e5, 1e5)
    for place in ("winding", "magnet", "case", "ambient"):
        yield column(f"temp_{place}_degc", "degC", f"temperature of the {place}", -80.0, 400.0)
    yield column("theta_elec_deg", "deg", "electrical angle of a locked rotor", -1e5, 1e5)
    for pair in ("ab", "bc", "ca"):
        yield column(f"l{pair}_h", "H", f"inductance between {pair[0]} and {pair[1]}", 0.0, 10.0)
    for pair in ("ab", "bc", "ca"):
        words = f"resistance between {pair[0]} and {pair[1]}"
        yield column(f"r{pair}_ohm", "ohm", words, 0.0, 1e4)
    yield column("freq_hz", "Hz", "frequency of the LCR meter", 0.0, 1e7)


def _constants() -> Iterable[Term]:
    def constant(
        name: str, unit: str, words: str, low: float = TINY, high: float = 1e6, whole: bool = False
    ) -> Term:
        return Term(name, unit, words, "constant", low, high, whole)

    yield constant("r_phase_ohm", "ohm", "wye-equivalent phase resistance at 25 degC", TINY, 1e3)
    yield constant("r_ll_ohm", "ohm", "mean line-to-line resistance at 25 degC", TINY, 2e3)
    yield constant("resistance_imbalance", "1", "largest less smallest phase over their mean", 0, 2)
    yield constant("temp_coeff_copper_1_k", "1/K", "of the winding resistance, at 25 degC", 0, 0.02)
    yield constant("ld_h", "H", "incremental d inductance near zero current", TINY, 10.0)
    yield constant("lq_h", "H", "incremental q inductance near zero current", TINY, 10.0)
    yield constant("ld_rated_h", "H", "apparent d inductance at rated current", TINY, 10.0)
    yield constant("lq_rated_h", "H", "apparent q inductance at rated current", TINY, 10.0)
    yield constant("saliency_ratio", "1", "saliency, Lq over Ld", 0.01, 100.0)
    yield constant("psi_pm_wb", "Wb", "magnet flux linkage, phase peak, at 25 degC", TINY, 100.0)
    yield constant("temp_coeff_magnet_1_k", "1/K", "of the magnet flux, at 25 degC", -0.02, 0.02)
    yield constant("ke_phase_peak_v_s_rad", "V·s/rad", "back-EMF, phase peak per mechanical rad/s")
    yield constant("ke_ll_peak_v_s_rad", "V·s/rad", "back-EMF, line-line peak per rad/s")
    yield constant("ke_ll_rms_v_s_rad", "V·s/rad", "back-EMF, line-line rms per rad/s")
    yield constant("ke_ll_peak_v_krpm", "V/krpm", "back-EMF, line-line peak per 1000 rpm")
    yield constant("kv_ll_peak_rpm_v", "rpm/V", "speed per volt of line-line peak back-EMF")
    yield constant("kt_peak_nm_a", "N·m/A", "torque per peak q ampere, from the torque test")
    yield constant("kt_rms_nm_a", "N·m/A", "torque per rms phase ampere, from the torque test")
    yield constant("kt_from_ke_nm_a", "N·m/A", "torque per peak q ampere, 1.5 p ψ of the back-EMF")
    yield constant("motor_constant_nm_sqrt_w", "N·m/sqrt(W)", "torque per root of copper loss")
    yield constant("pole_pairs", "1", "electrical cycles a mechanical turn", 1, 200, True)
    yield constant("cogging_peak_nm", "N·m", "half the peak-to-peak of the cogging torque", 0.0)
    yield constant("cogging_order", "1", "leading cogging order a mechanical turn", 1, 5000, True)
    yield constant("cogging_amplitude_nm", "N·m", "amplitude of the leading cogging order", 0.0)
    yield constant("j_rotor_kgm2", "kg·m²", "rotor inertia", TINY, 1e4)
    # the magnet's flux brakes at zero current too: only a rotor without magnets parts iron from dry
    dry = "drag of any speed: Coulomb friction, and hysteresis of the iron"
    viscous = "drag over speed: viscous friction, and eddy currents of the magnet's flux"
    yield constant("torque_coulomb_nm", "N·m", dry, 0.0)
    yield constant("b_visc_nm_s_rad", "N·m·s/rad", viscous, -1.0, 1e4)
    yield constant("tau_elec_s", "s", "electrical time constant, Lq over R", TINY, 100.0)
    yield constant("tau_mech_s", "s", "mechanical time constant, J R over 1.5 (p ψ)²", TINY, 1e5)
    yield constant("rth_winding_k_w", "K/W", "winding to ambient, steady state", TINY, 1e4)


def _metadata() -> Iterable[Term]:
    def number(
        name: str, unit: str, words: str, low: float, high: float, whole: bool = False
    ) -> Term:
        return Term(name, unit, words, "metadata", low, high, whole)

    def text(name: str, words: str) -> Term:
        return Term(name, "text", words, "metadata")

    yield text("contract", "version of the capture contract")
    yield text("motor_id", "serial number")
    yield text("test", "which test was done")
    yield text("motor_type", "the design; lots of one type are compared")
    yield text("lot", "production lot")
    yield text("station", "test bench")
    yield text("operator", "who recorded it")
    yield text("started_at", "ISO 8601, UTC")
    yield text("winding", "wye or delta")
    yield number("pole_pairs", "1", "nameplate pole pairs", 1, 200, True)
    yield number("slots", "1", "nameplate stator slots", 1, 1000, True)
    yield number("ambient_degc", "degC", "ambient temperature", -80.0, 200.0)
    yield text("pair", "ab, bc or ca: terminals of a two-terminal test")
    yield number("theta_elec_deg", "deg", "where the rotor is locked", -1e5, 1e5)
    yield text("voltage_kind", "measured or commanded")
    yield text("voltage_timing", "instant, held or centred")
    yield number("pwm_hz", "Hz", "switching frequency", 0.0, 1e7)
    yield number("vdc_v", "V", "DC link voltage", 0.0, 2e3)
    for gain in ("current", "voltage", "torque"):
        words = f"relative standard uncertainty of the {gain} gain; 0.01 where not stated"
        yield number(f"u_rel_{gain}", "1", words, 0, 1)
    words = "standard uncertainty of the temperatures; 2 where not stated"
    yield number("u_temp_degc", "degC", words, 0, 100)
    words = "relative standard uncertainty of the time base of t_s; 1e-4 where not stated"
    yield number("u_rel_clock", "1", words, 0, 1)
    words = "the recorder paused where its clock steps by more: no sample is missing there"
    yield number("pause_s", "s", words, 0.0, 1e6)
    yield text("sha256_rows", "HEX/ROWS over the rows of a CSV")


def _index(terms: Iterable[Term]) -> dict[str, Term]:
    index: dict[str, Term] = {}
    for term in terms:
        if term.name in index:
            raise ValueError(f"{term.name} is in the glossary twice")
        index[term.name] = term
    return index


COLUMNS = _index(_columns())
CONSTANTS = _index(_constants())
METADATA = _index(_metadata())


def has_clock(test: str, columns: frozenset[str]) -> bool:
    """Whether the rows of a capture come in time, and are not those of a table.

    Parameters
    ----------
    test
        Its test.
    columns
        Columns that it holds.

    """
    table = "t_s" not in columns and of_ohmmeter(test, columns)
    return test not in TESTS_WITHOUT_CLOCK and not table


def of_ohmmeter(test: str, columns: frozenset[str]) -> bool:
    """Whether a capture holds readings of an ohmmeter, and no current that was driven.

    Parameters
    ----------
    test
        Its test.
    columns
        Columns that it holds.

    """
    driven = not columns.isdisjoint(("ia_a", "ib_a", "ic_a"))
    return test == "resistance" and not columns.isdisjoint(OHMMETER) and not driven
