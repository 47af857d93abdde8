"""A MATLAB script of a motor's constants and tables for Simscape Electrical.

Blocks: PMSM (constants and, tabulated, flux linkage over i_d and i_q in webers and torque), and
PS Lookup Table (1D) with an ideal torque source for friction over speed and cogging over angle.
Blocks take phase values and peak currents, as the glossary has them. The script makes one struct
`motor`; every field is named as in the glossary, and a comment says which block's parameter it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.export.protocol import Exporter, Options, Source, Values, plain
from pipeline.records.effect_table import EffectTable

FIELD = re.compile(r"^motor\.([a-z0-9_]+) = ([-+.0-9eE]+);", re.MULTILINE)
BLOCKS = {
    "pole_pairs": "PMSM: Number of pole pairs",
    "r_phase_ohm": "PMSM: Stator resistance per phase",
    "ld_h": "PMSM: Stator d-axis inductance",
    "lq_h": "PMSM: Stator q-axis inductance",
    "psi_pm_wb": "PMSM: Permanent magnet flux linkage",
    "j_rotor_kgm2": "Inertia, or PMSM: Rotor inertia",
    "b_visc_nm_s_rad": "Rotational Friction: Viscous friction coefficient",
    "torque_coulomb_nm": "Rotational Friction: Coulomb friction torque",
    "rth_winding_k_w": "Thermal Resistance: winding to surroundings",
    "cth_winding_j_k": "Thermal Mass: of the winding",
    "temp_coeff_copper_1_k": "PMSM thermal port: Resistance temperature coefficient",
    "temp_coeff_magnet_1_k": "PMSM thermal port: Magnet flux temperature coefficient",
}
NEEDED = ("pole_pairs", "r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb")
_ROW = 8


def omits(source: Source) -> tuple[str, ...]:
    """Effects that the script has no table or delay for."""
    held = {one.effect for one in source.effects.tables} | {"sample_delay"}
    notes = [f"{one.effect}: {one.note} only" for one in source.effects.tables if one.note]
    return (*source.left_out(*held), *notes)


def render(source: Source, options: Options) -> str:
    """The script; constants first, then a table a quantity, the effects of one added up."""
    del options
    for name in NEEDED:
        source.value(name)
    lines = [f"% {line}" for line in source.heading()]
    lines += [f"% not in here: {plain(line)}" for line in omits(source)]
    lines += ["% Names as in the glossary: phase values, peak currents, SI units.", ""]
    for one in source.all():
        value = repr(one.value) if isinstance(one.value, int) else repr(one.number)
        block = BLOCKS.get(one.name, plain(source.terms[one.name].words))
        lines.append(f"motor.{one.name} = {value}; % [{one.unit}] u = {one.u:.3g}; {block}")
    lines += ["", *_flux(source), *_torque(source), *_delay(source)]
    return "\n".join([*lines, ""])


def _vector(name: str, values: Sequence[float]) -> list[str]:
    rows = [values[k : k + _ROW] for k in range(0, len(values), _ROW)]
    text = [" ".join(f"{value:.9g}" for value in row) for row in rows]
    return [f"motor.{name} = [ ...", *(f"  {row} ..." for row in text), "];"]


def _flux(source: Source) -> Iterator[str]:
    """Flux linkage of magnet, inductances and the effects that bend it, over both currents."""
    tables = source.tables("id_a")
    if not tables:
        return
    grid = np.array(tables[0].axes["id_a"])
    size, p = grid.size, source.value("pole_pairs")
    id_a, iq_a = np.meshgrid(grid, grid, indexing="ij")
    psi = {
        "psi_d_wb": source.value("psi_pm_wb") + source.value("ld_h") * id_a,
        "psi_q_wb": source.value("lq_h") * iq_a,
    }
    for table in tables:
        psi[table.quantity] = psi[table.quantity] + np.reshape(table.values, (size, size))
    psi["torque_table_nm"] = 1.5 * p * (psi["psi_d_wb"] * iq_a - psi["psi_q_wb"] * id_a)
    yield f"% with {', '.join(dict.fromkeys(t.effect for t in tables))}; rows i_d, columns i_q"
    for name in ("id_a", "iq_a"):
        yield from _vector(name, grid.tolist())
    for name, values in psi.items():
        yield from _vector(name, values.ravel().tolist())
        yield f"motor.{name} = reshape(motor.{name}, {size}, {size})';"


def _torque(source: Source) -> Iterator[str]:
    """Drag over speed and over the shaft's angle, beside viscous and Coulomb friction."""
    forms = {"omega_mech_rad_s": "friction", "theta_mech_rad": "cogging"}
    for variable, name in forms.items():
        tables = source.tables(variable)
        if not tables:
            continue
        yield f"% torque against rotation of {', '.join(t.effect for t in tables)}"
        finest = max(tables, key=lambda table: len(table.values))
        grid = finest.axes[variable]
        yield from _vector(f"{name}_{variable}", grid)
        yield from _vector(f"{name}_nm", _summed(tables, variable, np.array(grid)))


def _summed(tables: Sequence[EffectTable], variable: str, grid: np.ndarray) -> list[float]:
    turn = 2.0 * np.pi if variable == "theta_mech_rad" else None
    each = [np.interp(grid, t.axes[variable], t.values, period=turn) for t in tables]
    return np.sum(each, axis=0).tolist()


def _delay(source: Source) -> list[str]:
    """Lateness of the voltage, for a transport delay between controller and inverter."""
    delay_s = source.sizes().get("sample_delay", {}).get("delay_s")
    if delay_s is None or delay_s[0] is None:
        return []
    return [f"motor.voltage_delay_s = {delay_s[0]!r}; % Transport Delay: Time delay"]


def read(text: str) -> Values:
    """The constants of such a script."""
    return {name: float(value) for name, value in FIELD.findall(text)}


EXPORTER = Exporter(
    "simscape", "m", "Simscape constants and tables, MATLAB script", render, read, omits=omits
)
