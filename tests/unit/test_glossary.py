"""The glossary against the contract, against the units, and against its use in the code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.contracts.registry import gates
from pipeline.crosscheck.registry import rules
from pipeline.estimation.registry import estimators
from pipeline.physics.glossary import COLUMNS, CONSTANTS, METADATA, TESTS, Term
from pipeline.records.capture import CaptureMeta

ROOT = Path(__file__).parents[2]
CONTRACT = ROOT.parent / "shared" / "contract"


def _words(text: str) -> list[str]:
    return text.split()


# Transcribed from the contract by hand; the code's glossary was not looked at.
CONTRACT_COLUMNS = _words("""
t_s va_v vb_v vc_v vab_v vbc_v vca_v ia_a ib_a ic_a vd_v vq_v id_a iq_a vdc_v idc_a
theta_mech_rad theta_elec_rad omega_mech_rad_s psi_d_wb psi_q_wb torque_shaft_nm
temp_winding_degc temp_magnet_degc temp_case_degc temp_ambient_degc
theta_elec_deg lab_h lbc_h lca_h rab_ohm freq_hz
""")

OWN_COLUMNS = _words("rbc_ohm rca_ohm")
"""Columns beyond those of the contract: an ohmmeter's, of the other pairs."""

CONTRACT_CONSTANTS = _words("""
r_phase_ohm r_ll_ohm resistance_imbalance temp_coeff_copper_1_k ld_h lq_h ld_rated_h lq_rated_h
saliency_ratio psi_pm_wb temp_coeff_magnet_1_k ke_phase_peak_v_s_rad ke_ll_peak_v_s_rad
ke_ll_rms_v_s_rad ke_ll_peak_v_krpm kv_ll_peak_rpm_v kt_peak_nm_a kt_rms_nm_a kt_from_ke_nm_a
motor_constant_nm_sqrt_w pole_pairs cogging_peak_nm cogging_order cogging_amplitude_nm
j_rotor_kgm2 torque_coulomb_nm b_visc_nm_s_rad tau_elec_s tau_mech_s rth_winding_k_w
""")

CONTRACT_METADATA = _words("""
contract motor_id test motor_type lot station operator started_at winding pole_pairs slots
ambient_degc pair theta_elec_deg voltage_kind voltage_timing pwm_hz vdc_v u_rel_current
u_rel_voltage u_rel_torque u_temp_degc sha256_rows
""")

OWN_METADATA = _words("u_rel_clock pause_s")
"""Keys that the contract keeps as others, and this project reads."""

CONTRACT_TESTS = _words("""
resistance current_step lcr open_circuit hand_turn cogging torque_map spin_down heat_run
holding_current flux_map drive torque_table
""")

CONTRACT_CHECKS = _words("""
kt_vs_ke saliency_ratio resistance_temperature resistance_balance pole_pairs_nameplate
lcr_vs_step_inductance torque_equation cogging_order_vs_slots power_balance tau_elec_vs_l_over_r
""")

OWN_CHECKS = _words("time_base stated_constants")
"""Checks beyond those of the contract."""

# The longest suffixes first: `_v_s_rad` is no `_rad`.
UNITS = {
    "_nm_sqrt_w": "N·m/sqrt(W)",
    "_nm_s_rad": "N·m·s/rad",
    "_v_s_rad": "V·s/rad",
    "_v_krpm": "V/krpm",
    "_rpm_v": "rpm/V",
    "_rad_s": "rad/s",
    "_nm_a": "N·m/A",
    "_kgm2": "kg·m²",
    "_degc": "degC",
    "_1_k": "1/K",
    "_k_w": "K/W",
    "_ohm": "ohm",
    "_rad": "rad",
    "_deg": "deg",
    "_wb": "Wb",
    "_nm": "N·m",
    "_hz": "Hz",
    "_s": "s",
    "_v": "V",
    "_a": "A",
    "_h": "H",
}
UNITLESS = {"1", "text"}

ALL = [*COLUMNS.values(), *CONSTANTS.values(), *METADATA.values()]


@pytest.mark.parametrize(
    ("glossary", "contract"),
    [
        (COLUMNS, CONTRACT_COLUMNS + OWN_COLUMNS),
        (CONSTANTS, CONTRACT_CONSTANTS),
        (METADATA, CONTRACT_METADATA + OWN_METADATA),
        (TESTS, CONTRACT_TESTS),
    ],
    ids=["columns", "constants", "metadata", "tests"],
)
def test_names_are_those_of_the_contract(glossary: dict[str, object], contract: list[str]) -> None:
    assert sorted(glossary) == sorted(contract)


def test_transcription_against_the_contract_itself() -> None:
    """The lists above against the text they were copied from, where it is there."""
    if not CONTRACT.is_dir():
        pytest.skip("the contract's text is not beside this checkout")
    capture = (CONTRACT / "capture.md").read_text()
    outputs = (CONTRACT / "outputs.md").read_text()
    columns = _section(capture, "## Columns", "## MCAP")
    assert sorted(_first_cells(columns)) == sorted(CONTRACT_COLUMNS)
    assert sorted(_first_cells(_section(capture, "## Tests", None))) == sorted(CONTRACT_TESTS)
    metadata = _section(capture, "## Metadata", "## Columns")
    assert sorted(_first_cells(metadata)) == sorted(CONTRACT_METADATA)
    constants = _section(outputs, "Constants (names fixed):", "Checks (names fixed):")
    assert {*re.findall(r"`(\w+)`", constants)} == {*CONTRACT_CONSTANTS}
    checks = _section(outputs, "Checks (names fixed):", "A failing ratio")
    assert {*re.findall(r"`(\w+)`", checks)} == {*CONTRACT_CHECKS}


def _section(text: str, start: str, end: str | None) -> str:
    rest = text.split(start, 1)[1]
    return rest if end is None else rest.split(end, 1)[0]


def _first_cells(table: str) -> list[str]:
    body = table.split("| ---", 1)[1]
    rows = [line.split("|")[1] for line in body.splitlines() if line.startswith("| `")]
    return [
        name
        for cell in rows
        for quoted in re.findall(r"`([^`]+)`", cell)
        for name in quoted.split()
    ]


@pytest.mark.parametrize("term", ALL, ids=lambda t: f"{t.kind}:{t.name}")
def test_every_name_ends_in_its_unit(term: Term) -> None:
    """A name with a suffix has that unit; one without is a text, a ratio or a count."""
    suffix = next((s for s in UNITS if term.name.endswith(s)), None)
    if suffix is None:
        assert term.unit in UNITLESS
    else:
        assert term.unit == UNITS[suffix]
    assert term.words
    assert term.words[-1] != "."


@pytest.mark.parametrize("term", ALL, ids=lambda t: f"{t.kind}:{t.name}")
def test_every_number_has_a_range(term: Term) -> None:
    if term.unit == "text":
        assert (term.low, term.high) == (None, None)
    else:
        assert term.low is not None
        assert term.high is not None
        assert term.low < term.high


def test_a_suffix_of_another_unit_is_refused() -> None:
    with pytest.raises(ValueError, match="ends in the suffix of N·m"):
        Term("torque_shaft_nm", "mN·m", "wrong", "column")
    with pytest.raises(ValueError, match="nowhere"):
        Term("x_nm", "N·m", "a torque", "constant", 1.0, -1.0)


def _sources() -> Iterator[Path]:
    for path in sorted((ROOT / "pipeline").rglob("*.py")):
        if path.name != "glossary.py" and "simulator" not in path.parts:
            yield path


def _words_of_the_code() -> tuple[set[str], list[re.Pattern[str]]]:
    """Every string and attribute of the package, and every f-string as a pattern."""
    words: set[str] = set()
    patterns: list[re.Pattern[str]] = []
    for path in _sources():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                words.add(node.value)
            elif isinstance(node, (ast.Attribute, ast.keyword, ast.Name)):
                words.add(
                    getattr(node, "attr", None)
                    or getattr(node, "arg", None)
                    or getattr(node, "id", "")
                )
            elif isinstance(node, ast.JoinedStr):
                patterns += _pattern(node)
    return words, patterns


def _pattern(node: ast.JoinedStr) -> list[re.Pattern[str]]:
    """`f"v{pair}_v"` as the pattern v..?_v; formats that end in no unit do not name columns."""
    parts = [
        re.escape(p.value) if isinstance(p, ast.Constant) else "[a-z]{1,9}" for p in node.values
    ]
    text = "".join(parts)
    if isinstance(node.values[-1], ast.Constant) and re.fullmatch(r"[a-z_{},\[\]\-0-9]+", text):
        return [re.compile(text)]
    return []


def test_no_entry_is_unused() -> None:
    """Each name is spoken of somewhere in the package outside the glossary and the simulator."""
    words, patterns = _words_of_the_code()
    fields = set(CaptureMeta.__dataclass_fields__)
    unused = [
        term.name
        for term in ALL
        if term.name not in words
        and term.name not in fields
        and not any(pattern.fullmatch(term.name) for pattern in patterns)
    ]
    assert unused == []


def test_plug_ins_speak_of_known_names() -> None:
    """Estimators give and use constants, gates and estimators name tests, rules are published."""
    for estimator in estimators():
        own = {term.name for term in estimator.terms}
        assert set(estimator.gives) <= {*CONSTANTS, *own}, estimator.name
        assert set(estimator.tests) <= set(TESTS), estimator.name
        assert estimator.experiment, estimator.name
    known = {*CONSTANTS, *(t.name for e in estimators() for t in e.terms)}
    for estimator in estimators():
        assert set(estimator.uses) <= known, estimator.name
    assert {*CONTRACT_CHECKS, *OWN_CHECKS} == {rule.name for rule in rules()}
    for gate in gates():
        assert set(gate.tests) <= set(TESTS), gate.name


def test_plug_ins_have_names_of_their_own() -> None:
    for plug_ins in (estimators(), rules(), gates()):
        names = [plug.name for plug in plug_ins]
        assert len(names) == len(set(names))
        assert all(re.fullmatch(r"[a-z][a-z0-9_]*", name) for name in names)


def test_every_constant_has_an_estimator() -> None:
    """What the contract publishes, something gives."""
    given = {name for estimator in estimators() for name in estimator.gives}
    assert sorted(set(CONSTANTS) - given) == []


BOUNDED = [
    t for table in (COLUMNS, CONSTANTS, METADATA) for t in table.values() if t.unit != "text"
]


@pytest.mark.parametrize("term", BOUNDED, ids=lambda term: f"{term.kind}-{term.name}")
def test_bounds_are_orders_of_size_and_not_measurements(term: Term) -> None:
    """A bound has one significant digit; a signed quantity is bounded alike both ways.

    Temperatures and the link's voltage are the exceptions: they have no symmetry about zero.
    """
    assert term.low is not None
    assert term.high is not None
    assert term.low < term.high
    for bound in (term.low, term.high):
        assert float(f"{bound:.0e}") == bound
    if term.low < 0.0 and not term.name.endswith("_degc") and term.name not in LOPSIDED:
        assert term.low == -term.high


LOPSIDED = {
    "t_s": "a clock counts from 1970",
    "vdc_v": "a link dips below zero by a diode's drop",
    "b_visc_nm_s_rad": "a curve of friction may fall with speed a little",
}


def test_bounds_that_mathematics_sets() -> None:
    """Counts start at one; shares end at one; largest less smallest is twice the mean at most."""
    assert sorted((t.kind, t.name) for t in BOUNDED if t.integer) == [
        ("constant", "cogging_order"),
        ("constant", "pole_pairs"),
        ("metadata", "pole_pairs"),
        ("metadata", "slots"),
    ]
    whole = {t.name for t in BOUNDED if t.integer}
    assert all(t.low == 1 for t in BOUNDED if t.integer)
    shares = [METADATA[f"u_rel_{gain}"] for gain in ("current", "voltage", "torque", "clock")]
    assert {(t.low, t.high) for t in shares} == {(0, 1)}
    ratio, imbalance = CONSTANTS["saliency_ratio"], CONSTANTS["resistance_imbalance"]
    assert ratio.low * ratio.high == pytest.approx(1.0)
    assert (imbalance.low, imbalance.high) == (0, 2)
    # a phase has two thirds of a line's voltage at most; a line of two phases twice a phase's
    assert COLUMNS["vab_v"].high == 2 * COLUMNS["va_v"].high
    assert CONSTANTS["r_ll_ohm"].high == 2 * CONSTANTS["r_phase_ohm"].high
    counted = {"saliency_ratio", *whole}
    assert {t.low for t in CONSTANTS.values() if t.low >= 0.0 and t.name not in counted} == {
        0.0,
        1e-12,
    }
    assert CONSTANTS["cogging_order"].high == 5000


# Sizes of a drone's motor, a gimbal's, a servo's and a car's.
MOTORS = {
    "r_phase_ohm": (0.05, 5.6, 1.1, 0.005),
    "ld_h": (8e-6, 2.9e-3, 4e-3, 1e-4),
    "psi_pm_wb": (4e-4, 0.02, 0.1, 0.07),
    "pole_pairs": (6, 11, 4, 4),
    "j_rotor_kgm2": (5e-7, 8e-5, 3e-4, 0.03),
    "kv_ll_peak_rpm_v": (2300.0, 80.0, 30.0, 20.0),
    "cogging_order": (36, 132, 24, 48),
    "tau_elec_s": (2e-4, 5e-4, 4e-3, 0.02),
    "rth_winding_k_w": (20.0, 4.0, 0.8, 0.05),
}


@pytest.mark.parametrize("name", MOTORS)
def test_motors_that_exist_are_plausible(name: str) -> None:
    term = CONSTANTS[name]
    assert all(term.low <= value <= term.high for value in MOTORS[name])
