"""Motor configuration for VESC Tool, XML.

Field names and units: vedderb/bldc, commit b9d287b, datatypes.h (struct mc_configuration) and
confgenerator.c. `foc_motor_r` and `foc_motor_l` are of a phase, `foc_motor_l` the mean of both
axes, `foc_motor_ld_lq_diff` is Lq − Ld, `foc_motor_flux_linkage` the peak of a phase,
`si_motor_poles` twice the pole pairs. The firmware itself lowers the inductance for its observer;
what stands here is as measured. The tool refuses a file of another configuration version: name
yours in `options.config_version`. Gains of the current controller are written where
`options.current_bandwidth_rad_s` states its bandwidth: kp = L ω, ki = R ω.
"""

from __future__ import annotations

from xml.etree import ElementTree as Xml

from pipeline.export.protocol import Exporter, Options, Source, Values, number_option

FIRMWARE = "vedderb/bldc b9d287b"


def render(source: Source, options: Options) -> str:
    """The document; every number is of the shortest text that reads back the same."""
    r, ld, lq = (source.value(name) for name in ("r_phase_ohm", "ld_h", "lq_h"))
    mean = (ld + lq) / 2.0
    root = Xml.Element("MCConfiguration")
    for line in (*source.heading(), f"fields as in {FIRMWARE}; phase values, flux linkage peak"):
        root.append(Xml.Comment(f" {line} "))
    fields: dict[str, str] = {}
    version = number_option(options, "config_version")
    if version is not None:
        fields["ConfigVersion"] = str(round(version))
    fields |= {
        "foc_motor_r": repr(r),
        "foc_motor_l": repr(mean),
        "foc_motor_ld_lq_diff": repr(lq - ld),
        "foc_motor_flux_linkage": repr(source.value("psi_pm_wb")),
        "si_motor_poles": str(2 * round(source.value("pole_pairs"))),
    }
    bandwidth = number_option(options, "current_bandwidth_rad_s")
    if bandwidth is not None:
        fields |= {"foc_current_kp": repr(mean * bandwidth), "foc_current_ki": repr(r * bandwidth)}
    current = number_option(options, "current_max_a")
    if current is not None:
        fields["l_current_max"] = repr(current)
    for name, text in fields.items():
        Xml.SubElement(root, name).text = text
    Xml.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, "unicode") + "\n"


def read(text: str) -> Values:
    """The constants of such a document that we wrote."""
    root = Xml.fromstring(text)  # noqa: S314 (our own text)
    settings = {child.tag: float(child.text or "nan") for child in root}
    half = settings["foc_motor_ld_lq_diff"] / 2.0
    return {
        "r_phase_ohm": settings["foc_motor_r"],
        "ld_h": settings["foc_motor_l"] - half,
        "lq_h": settings["foc_motor_l"] + half,
        "psi_pm_wb": settings["foc_motor_flux_linkage"],
        "pole_pairs": settings["si_motor_poles"] / 2.0,
    }


EXPORTER = Exporter(
    "vesc",
    "xml",
    "VESC Tool motor configuration, XML",
    render,
    read,
    {
        "config_version": "of the tool's configuration, written as ConfigVersion",
        "current_bandwidth_rad_s": "of the current controller, for foc_current_kp and _ki",
        "current_max_a": "largest motor current, for l_current_max",
    },
)
