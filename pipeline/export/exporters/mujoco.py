"""A motor on a hinge for MuJoCo: its `dcmotor` actuator, as MJCF.

Attributes: MuJoCo 4.0, XML reference, `actuator/dcmotor` and `body/joint`. `dcmotor` is one
winding, v = R i + L di/dt + K ω and T = K i. Its control is the q voltage v, phase peak: power
v i is 1.5 v_q i_q, so that the current is i = 1.5 i_q, R and L are those of a phase over 1.5 and
K = p ψ. The d current is zero there, and reluctance torque with it.

An actuator has one order of cogging: each further order is an actuator that has nothing else, after
the motor, so that the motor's control stays the first.

Friction is the joint's `frictionloss`, or the actuator's `lugre` where friction falls with speed or
builds up over a travel. Drag that grows with speed is a polynomial of the joint's `damping`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree import ElementTree as Xml

import numpy as np

from pipeline.export.curves import Bump, Wave, bump_of, drag_polynomial, waves
from pipeline.export.protocol import Exporter, Options, Source, Values, number_option
from pipeline.physics.notation import quantity
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array

PEAK_POWER = 1.5
"""Power of three phases over the product of peak voltage and current."""
RIGID_RAD = 1e-4
"""Travel over which friction builds up where none was found: far below what a bench sees."""
MASS_KG = 1e-3
STIFF = "0.9999 0.9999 0.001 0.5 2"
"""Impedance of dry friction; MuJoCo's default lets a shaft that reverses slip for 20 ms."""
_SMALL = 0.01


@dataclass(slots=True)
class _Shaft:
    """What of the effects the format holds: friction, drag and cogging."""

    bump: Bump | None = None
    travel_rad: float = 0.0
    drag: Array = field(default_factory=lambda: np.zeros(3))
    waves: list[Wave] = field(default_factory=list)
    held: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def _shaft(source: Source) -> _Shaft:
    """Sorts the effects' tables into what a hinge and `dcmotor` have."""
    shaft = _Shaft()
    for table in source.tables("omega_mech_rad_s"):
        bump = bump_of(table)
        polynomial = None if bump else drag_polynomial(table)
        if bump is not None and shaft.bump is None:
            shaft.bump, missed = bump, quantity(bump.miss_nm, "N·m", 2)
            shaft.notes.append(f"{table.effect}: lugre misses its curve by {missed}")
        elif polynomial is not None:
            shaft.drag += polynomial
        else:
            continue
        shaft.held.append(table.effect)
        shaft.notes += [f"{table.effect}: {table.note} only"] if table.note else []
    turned = source.tables("theta_mech_rad")
    shaft.waves = waves(turned)
    shaft.held += [table.effect for table in turned]
    travel = source.sizes().get("presliding", {}).get("travel_rad")
    if travel is not None and travel[0]:
        shaft.travel_rad = travel[0]
        shaft.held.append("presliding")
    return shaft


def omits(source: Source) -> tuple[str, ...]:
    """Effects that MuJoCo's motor cannot hold, and what it misses of the others.

    Parameters
    ----------
    source
        The datasheet.

    """
    shaft = _shaft(source)
    ld, lq = source.optional("ld_h"), source.optional("lq_h")
    salient: tuple[str, ...] = ()
    if ld is not None and lq is not None and abs(lq.number - ld.number) > _SMALL * lq.number:
        salient = ("reluctance torque: the motor has no d current",)
    return (*source.left_out(*shaft.held), *shaft.notes, *salient)


def render(source: Source, options: Options) -> str:
    """The document: a rotor that turns freely, and its motor."""
    shaft = _shaft(source)
    root = Xml.Element("mujoco", {"model": "motor"})
    for line in (*source.heading(), *(f"not in here: {line}" for line in omits(source))):
        root.append(Xml.Comment(f" {line.replace('--', ' ')} "))
    Xml.SubElement(root, "compiler", {"angle": "radian"})
    step = repr(_step_s(options))
    Xml.SubElement(root, "option", {"timestep": step, "integrator": "implicitfast"})
    custom = Xml.SubElement(root, "custom")
    pairs = str(round(source.value("pole_pairs")))
    Xml.SubElement(custom, "numeric", {"name": "pole_pairs", "data": pairs})
    _rotor(Xml.SubElement(root, "worldbody"), source, shaft, options)
    actuators = Xml.SubElement(root, "actuator")
    Xml.SubElement(actuators, "dcmotor", _motor(source, shaft, options))
    for wave in shaft.waves[1:]:
        Xml.SubElement(actuators, "dcmotor", _further(wave, source))
    Xml.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "unicode") + "\n"


def _step_s(options: Options) -> float:
    return number_option(options, "timestep_s") or 1e-4


def _rotor(world: Xml.Element, source: Source, shaft: _Shaft, options: Options) -> None:
    """A body without weight of its own; the inertia is the joint's armature."""
    body = Xml.SubElement(world, "body", {"name": "rotor", "gravcomp": "1"})
    drag = shaft.drag.copy()
    viscous = source.optional("b_visc_nm_s_rad")
    drag[0] += 0.0 if viscous is None else viscous.number
    used = np.flatnonzero(drag)
    joint = {"name": "shaft", "type": "hinge", "axis": "0 0 1"}
    joint["armature"] = repr(source.value("j_rotor_kgm2"))
    joint["damping"] = " ".join(repr(float(c)) for c in drag[: int(used.max(initial=0)) + 1])
    dry = source.optional("torque_coulomb_nm")
    if dry is not None and not _bristles(shaft):
        joint["frictionloss"] = repr(dry.number)
        joint["solreffriction"] = f"{2.0 * _step_s(options)!r} 1"
        joint["solimpfriction"] = STIFF
    Xml.SubElement(body, "joint", joint)
    light = repr(1e-6 * source.value("j_rotor_kgm2"))
    own = {"pos": "0 0 0", "mass": repr(MASS_KG), "diaginertia": f"{light} {light} {light}"}
    Xml.SubElement(body, "inertial", own)


def _bristles(shaft: _Shaft) -> bool:
    return shaft.bump is not None or shaft.travel_rad > 0.0


def _motor(source: Source, shaft: _Shaft, options: Options) -> dict[str, str]:
    """Attributes of the actuator."""
    constant = source.value("pole_pairs") * source.value("psi_pm_wb")
    entries = {
        "name": "motor",
        "joint": "shaft",
        "resistance": _resistance(source),
        "motorconst": f"{constant!r} {constant!r}",
        "inductance": f"{source.value('lq_h') / PEAK_POWER!r} 0",
    }
    names = ("rth_winding_k_w", "cth_winding_j_k", "temp_coeff_copper_1_k")
    heat = [source.optional(name) for name in names]
    if all(one is not None for one in heat):
        rth, cth, alpha = (one.number for one in heat if one is not None)
        ambient = number_option(options, "ambient_degc") or REFERENCE_DEGC
        entries["thermal"] = f"{rth!r} {cth!r} 0 {alpha!r} {REFERENCE_DEGC!r} {ambient!r}"
    if shaft.waves:
        entries["cogging"] = _cogging(shaft.waves[0])
    dry = source.optional("torque_coulomb_nm")
    if dry is not None and _bristles(shaft):
        bump = shaft.bump or Bump(0.0, 1.0, 0.0)
        stiff = dry.number / (shaft.travel_rad or RIGID_RAD)
        most = dry.number + bump.excess_nm
        entries["lugre"] = f"{stiff!r} 0 {dry.number!r} {most!r} {bump.speed_rad_s!r}"
    return entries


def _further(wave: Wave, source: Source) -> dict[str, str]:
    """Attributes of a motor without winding or input that has a further order of the cogging."""
    return {
        "name": f"cogging_{wave.order}",
        "joint": "shaft",
        "resistance": _resistance(source),
        "motorconst": "0 0",
        "input": "none",
        "cogging": _cogging(wave),
    }


def _resistance(source: Source) -> str:
    """Of the winding; a further actuator carries no current, but MuJoCo asks for one."""
    return repr(source.value("r_phase_ohm") / PEAK_POWER)


def _cogging(wave: Wave) -> str:
    return f"{wave.amplitude_nm!r} {wave.order} {wave.phase_rad!r}"


def read(text: str) -> Values:
    """The constants of such a document that we wrote; raises ValueError where there is no motor."""
    root = Xml.fromstring(text)  # noqa: S314 (our own text)
    motor, joint = root.find("actuator/dcmotor"), root.find("worldbody/body/joint")
    pairs = root.find("custom/numeric")
    if motor is None or joint is None or pairs is None:
        raise ValueError("no motor in the text")
    poles = float(pairs.attrib["data"])
    return {
        "pole_pairs": poles,
        "r_phase_ohm": PEAK_POWER * float(motor.attrib["resistance"]),
        "lq_h": PEAK_POWER * float(motor.attrib["inductance"].split()[0]),
        "psi_pm_wb": float(motor.attrib["motorconst"].split()[0]) / poles,
        "j_rotor_kgm2": float(joint.attrib["armature"]),
    }


EXPORTER = Exporter(
    "mujoco",
    "xml",
    "MuJoCo dcmotor actuator on a hinge, MJCF",
    render,
    read,
    {
        "timestep_s": "of the integrator [s], 1e-4 without it",
        "ambient_degc": "of the surroundings of the winding [°C], 25 without it",
    },
    omits,
)
