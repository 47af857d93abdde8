"""What a capture of each test holds at least, as data: the table of `contract/capture.md`.

A requirement is met when one of its alternatives is wholly there. `{pair}` stands for the
terminals of a two-terminal test; without them in the metadata any one pair will do.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

from pipeline.physics.glossary import TESTS_WITHOUT_CLOCK

PAIRS = ("ab", "bc", "ca")
LINE_VOLTAGES = tuple(f"v{pair}_v" for pair in PAIRS)
LINE_CURRENTS = ("ia_a", "ib_a", "ic_a")

Alternative = tuple[str, ...]
PHASE_VOLTAGES = ("va_v", "vb_v", "vc_v")
DQ = ("vd_v", "vq_v", "id_a", "iq_a")


@dataclass(frozen=True, slots=True)
class Requirement:
    """Columns that must be there together: the first alternative is the one asked for."""

    alternatives: tuple[Alternative, ...]
    words: str = ""

    def met_by(self, columns: frozenset[str]) -> bool:
        """Whether one alternative is wholly among some columns.

        Parameters
        ----------
        columns
            Columns that a capture holds.

        """
        return any(columns.issuperset(alternative) for alternative in self.alternatives)

    def text(self) -> str:
        """The alternatives in words: `ia_a or ib_a`, `vd_v, vq_v or vq_v alone`."""
        return self.words or " or ".join(" with ".join(group) for group in self.alternatives)


def _all(*columns: str) -> tuple[Requirement, ...]:
    return tuple(Requirement(((column,),)) for column in columns)


def _any(*columns: str) -> Requirement:
    return Requirement(tuple((column,) for column in columns))


def _terminals(pair: str) -> tuple[Alternative, ...]:
    """Voltage of a pair with the current of either of its two lines (the third is open)."""
    return tuple((f"v{pair}_v", f"i{phase}_a") for phase in pair)


TERMINAL_VOLTAGES = Requirement(
    (
        *combinations(LINE_VOLTAGES, 2),
        *((name,) for name in LINE_VOLTAGES),
        *combinations(PHASE_VOLTAGES, 2),
        *((name,) for name in PHASE_VOLTAGES),
    ),
    "vab_v or another voltage between two terminals or of a phase",
)

_FIXED: dict[str, tuple[Requirement, ...]] = {
    "resistance": (),
    "current_step": (),
    "lcr": _all("theta_elec_deg", "lab_h"),
    "open_circuit": (TERMINAL_VOLTAGES,),
    "hand_turn": (_any(*LINE_VOLTAGES),),
    "cogging": _all("theta_mech_rad", "torque_shaft_nm"),
    "torque_map": (
        Requirement(
            ((*DQ, "torque_shaft_nm"), ("iq_a", "torque_shaft_nm"), DQ, ("vq_v", "iq_a")),
            "iq_a, and torque_shaft_nm or vq_v",
        ),
        _any("omega_mech_rad_s", "theta_mech_rad", "theta_elec_rad"),
    ),
    "spin_down": (_any("omega_mech_rad_s", "theta_mech_rad"),),
    "heat_run": _all("temp_winding_degc"),
    "holding_current": _all("theta_mech_rad", "iq_a"),
    "flux_map": (
        *_all("id_a"),
        Requirement(
            (("iq_a", "psi_d_wb", "psi_q_wb"), ("vq_v", "omega_mech_rad_s")),
            "iq_a, psi_d_wb and psi_q_wb, or vq_v less the drop of iq_a at omega_mech_rad_s",
        ),
    ),
    "torque_table": _all("iq_a", "torque_shaft_nm"),
    "drive": (
        Requirement(
            (DQ, ("vq_v", "iq_a"), ("iq_a",), ("vq_v",), ("vdc_v", "idc_a", "torque_shaft_nm")),
            "iq_a, with id_a, vd_v, vq_v where there; or vq_v alone; or vdc_v, idc_a and "
            "torque_shaft_nm",
        ),
        _any("theta_mech_rad", "omega_mech_rad_s", "theta_elec_rad"),
    ),
}


def requirements(test: str, pair: str | None = None) -> tuple[Requirement, ...]:
    """All requirements of a test, those of its terminal pair and its clock included.

    Parameters
    ----------
    test
        Its name.
    pair
        `ab`, `bc` or `ca`; any of them where not stated.

    Returns
    -------
    tuple of Requirement
        A capture has to meet each.

    Raises
    ------
    KeyError
        The contract does not know the test.

    """
    fixed = _FIXED[test]
    pairs = (pair,) if pair in PAIRS else PAIRS
    terminals = tuple(group for one in pairs for group in _terminals(one))
    words = f"v{pair}_v and {' or '.join(f'i{p}_a' for p in pair)}" if pair in PAIRS else ""
    anywhere = words or "the voltage and the line current of one terminal pair"
    if test == "resistance":
        shown = tuple((f"r{one}_ohm",) for one in pairs)
        table = f"{anywhere}, or {' or '.join(name for (name,) in shown)} of an ohmmeter"
        timed = Requirement((("t_s",), *shown), "t_s")
        warmth = "temp_winding_degc"
        known = Requirement((("t_s",), (warmth,)), f"{warmth} beside an ohmmeter's")
        return timed, Requirement((*terminals, *shown), table), known
    if test == "current_step":
        fixed = (Requirement(terminals, anywhere), *fixed)
    if test == "heat_run":
        fixed = (Requirement((DQ, *terminals), f"vd_v, vq_v, id_a, iq_a or {anywhere}"), *fixed)
    clock = () if test in TESTS_WITHOUT_CLOCK else _all("t_s")
    return (*clock, *fixed)


def columns_required(test: str, pair: str | None, columns: frozenset[str]) -> tuple[str, ...]:
    """The columns that meet the requirements of a test: what its estimators rest on.

    Parameters
    ----------
    test
        Its name.
    pair
        `ab`, `bc` or `ca`; any of them where not stated.
    columns
        Those that the capture has.

    Returns
    -------
    tuple of str
        Sorted; of each requirement the first alternative that is there.

    Examples
    --------
    >>> columns_required("spin_down", None, frozenset({"t_s", "omega_mech_rad_s", "vdc_v"}))
    ('omega_mech_rad_s', 't_s')

    """
    used: set[str] = set()
    for requirement in requirements(test, pair):
        for alternative in requirement.alternatives:
            if columns.issuperset(alternative):
                used.update(alternative)
                break
    return tuple(sorted(used))
