"""A parameter set for simulators, SSV of the SSP standard.

Elements and attributes: Modelica Association, System Structure and Parameterization 1.0, schemas
SystemStructureParameterValues.xsd and SystemStructureCommon.xsd (modelica/ssp-standard):
`ssv:ParameterSet` with version and name, `ssv:Parameters`, `ssv:Parameter name`, `ssv:Real value
unit`, `ssv:Units`. Names and conventions are the glossary's; a unit that has no whole powers of SI
base units stands in the description alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as Xml

from pipeline.export.protocol import Exporter, Options, Source, Values, no_effect_omitted

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
# Powers of SI base units, as `ssc:BaseUnit` takes them.
UNITS: Mapping[str, Mapping[str, str]] = {
    "1": {},
    "ohm": {"kg": "1", "m": "2", "s": "-3", "A": "-2"},
    "H": {"kg": "1", "m": "2", "s": "-2", "A": "-2"},
    "Wb": {"kg": "1", "m": "2", "s": "-2", "A": "-1"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "A": {"A": "1"},
    "V·s/rad": {"kg": "1", "m": "2", "s": "-2", "A": "-1", "rad": "-1"},
    "N·m": {"kg": "1", "m": "2", "s": "-2"},
    "N·m/A": {"kg": "1", "m": "2", "s": "-2", "A": "-1"},
    "kg·m²": {"kg": "1", "m": "2"},
    "N·m·s/rad": {"kg": "1", "m": "2", "s": "-1", "rad": "-1"},
    "K/W": {"kg": "-1", "m": "-2", "s": "3", "K": "1"},
    "1/K": {"K": "-1"},
    "1/s": {"s": "-1"},
    "s": {"s": "1"},
    "rad": {"rad": "1"},
    "rad/s²": {"rad": "1", "s": "-2"},
}


def render(source: Source, options: Options) -> str:
    """The document, one parameter a constant, `ssv:Integer` for a whole one."""
    del options
    root = Xml.Element(
        "ssv:ParameterSet",
        {"xmlns:ssv": SSV, "xmlns:ssc": SSC, "version": "1.0", "name": "motor_datasheet"},
    )
    for line in source.heading():
        root.append(Xml.Comment(f" {line} "))
    parameters = Xml.SubElement(root, "ssv:Parameters")
    units = set()
    for estimate in source.all():
        term = source.terms[estimate.name]
        known = term.unit in UNITS
        words = term.words if known else f"{term.words} [{term.unit}]"
        own = {"name": estimate.name, "description": words}
        parameter = Xml.SubElement(parameters, "ssv:Parameter", own)
        if isinstance(estimate.value, int):
            Xml.SubElement(parameter, "ssv:Integer", {"value": repr(estimate.value)})
            continue
        real = {"value": repr(estimate.number)}
        if known:
            units.add(term.unit)
            real["unit"] = term.unit
        Xml.SubElement(parameter, "ssv:Real", real)
    for name, value, _, unit in source.effect_parameters():
        words = "of an effect" if unit in UNITS else f"of an effect [{unit}]"
        parameter = Xml.SubElement(
            parameters, "ssv:Parameter", {"name": name, "description": words}
        )
        known_unit = {"unit": unit} if unit in UNITS else {}
        units |= set(known_unit.values())
        Xml.SubElement(parameter, "ssv:Real", {"value": repr(value), **known_unit})
    declared = Xml.SubElement(root, "ssv:Units")
    for unit in sorted(units):
        own_unit = Xml.SubElement(declared, "ssc:Unit", {"name": unit})
        Xml.SubElement(own_unit, "ssc:BaseUnit", dict(UNITS[unit]))
    Xml.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "unicode") + "\n"


def read(text: str) -> Values:
    """The constants of such a document that we wrote."""
    root = Xml.fromstring(text)  # noqa: S314 (our own text)
    return {
        parameter.attrib["name"]: float(parameter[0].attrib["value"])
        for parameter in root.iter(f"{{{SSV}}}Parameter")
    }


EXPORTER = Exporter(
    "ssv",
    "ssv",
    "SSP parameter set for simulators, XML",
    render,
    read,
    omits=no_effect_omitted,
)
