"""Names that columns go by, whole; for `inspect` only, never for `run`."""

from __future__ import annotations

from functools import cache

_NAMES: dict[str, str] = {
    "t_s": "t time times timestamp timesec seconds second sec xaxis mstoday source sequence",
    "theta_mech_rad": (
        "theta thetam thetamech position pos angle shaftangle rotorangle mechanicalangle "
        "mechangle encoder encoderposition shaftposition motorposition"
    ),
    "theta_elec_rad": "thetae thetael thetaelec electricalangle elecangle eangle phaseangle",
    "omega_mech_rad_s": (
        "omega omegam omegamech w wm speed velocity vel rpm motorspeed shaftspeed rotorspeed "
        "angularvelocity angularspeed mechanicalspeed n motorvelocity"
    ),
    "torque_shaft_nm": "torque tq trq shafttorque loadtorque torqueshaft mshaft dynotorque effort",
    "vdc_v": "vdc udc vbus ubus busvoltage dcvoltage inputvoltage supplyvoltage vin",
    "idc_a": "idc ibus busin dccurrent currentin inputcurrent buscurrent supplycurrent",
    "temp_winding_degc": (
        "tempwinding windingtemp windingtemperature tempmotor motortemp motortemperature "
        "tempcoil coiltemp twinding tw"
    ),
    "temp_magnet_degc": "tempmagnet magnettemp magnettemperature temprotor rotortemp tm tmagnet",
    "temp_case_degc": "tempcase casetemp casetemperature temphousing housingtemp tcase",
    "temp_ambient_degc": "tempambient ambienttemp ambienttemperature ambient tamb tambient",
    "theta_elec_deg": "thetaelecdeg lockedangle rotoranglee",
    "rab_ohm": "rab ruv rs esr resistance",
    "rbc_ohm": "rbc rvw",
    "rca_ohm": "rca rac rwu",
    "freq_hz": "freq frequency testfrequency f",
    "lab_h": "lab ls l inductance",
    "lbc_h": "lbc",
    "lca_h": "lca lac",
}
_PATTERNS: tuple[tuple[str, str, str], ...] = (
    ("i{axis}_a", "axis", "i{} {}current {}axiscurrent current{} i{}meas i{}measured"),
    ("v{axis}_v", "axis", "v{} u{} {}voltage {}axisvoltage voltage{} voltagedq{}"),
    ("psi_{axis}_wb", "axis", "psi{} flux{} lambda{} {}flux"),
    ("i{phase}_a", "phase", "i{} iphase{} phasecurrent{} current{} phase{}current"),
    ("v{phase}_v", "phase", "vphase{} phasevoltage{} voltage{} {}n v{}n u{}n"),
    ("v{pair}_v", "pair", "v{} u{} voltage{} line{}"),
)
"""Column, what varies in it, and the names it goes by."""
_VARIANTS: dict[str, dict[str, str]] = {
    "axis": {"d": "d", "q": "q"},
    "phase": {"a": "a u 1 l1", "b": "b v 2 l2", "c": "c w 3 l3"},
    "pair": {"ab": "ab uv 12", "bc": "bc vw 23", "ca": "ca wu 31"},
}


@cache
def _table() -> dict[str, str]:
    table = {name: column for column, names in _NAMES.items() for name in names.split()}
    for column, kind, stems in _PATTERNS:
        for value, letters in _VARIANTS[kind].items():
            names = (stem.format(letter) for stem in stems.split() for letter in letters.split())
            table |= dict.fromkeys(names, column.format(**{kind: value}))
    return table | {"va": "va_v", "vb": "vb_v", "vc": "vc_v"}


def alias(key: str) -> str | None:
    """The column that goes by a name.

    Parameters
    ----------
    key
        Small letters and digits, without the unit.

    Returns
    -------
    str or None
        A column of the glossary.

    """
    return _table().get(key)
