"""A constructor call for SimpleFOC, C++.

Arguments and units: simplefoc/Arduino-FOC, commit 7f9c45f, src/BLDCMotor.h:
`BLDCMotor(int pp, float R, float KV, float L_q, float L_d)`. Its documentation measures R between
two phases, twice the phase value; KV is rpm per volt of line-line peak; inductances are of a phase,
in henry, q before d.
"""

from __future__ import annotations

import re

from pipeline.export.protocol import Exporter, Options, Source, Values
from pipeline.physics.windings import line_from_phase, phase_from_line

CALL = re.compile(r"BLDCMotor\((\d+), ([^,]+), ([^,]+), ([^,]+), ([^)]+)\);")


def render(source: Source, options: Options) -> str:
    """The line of a sketch, conventions in comments before it."""
    del options
    numbers = (
        round(source.value("pole_pairs")),
        line_from_phase(source.value("r_phase_ohm")),
        source.value("kv_ll_peak_rpm_v"),
        source.value("lq_h"),
        source.value("ld_h"),
    )
    lines = [f"// {line}" for line in source.heading()]
    lines.append("// pole pairs, R between two phases [ohm], KV [rpm/V, line-line peak],")
    lines.append("// Lq and Ld of a phase [H]")
    lines.append(f"BLDCMotor motor = BLDCMotor({', '.join(repr(x) for x in numbers)});")
    return "\n".join([*lines, ""])


def read(text: str) -> Values:
    """The constants of such a call; raises ValueError where there is none."""
    call = CALL.search(text)
    if call is None:
        raise ValueError("no BLDCMotor(...) in the text")
    pairs, r, kv, lq, ld = (float(word) for word in call.groups())
    return {
        "pole_pairs": pairs,
        "r_phase_ohm": phase_from_line(r),
        "kv_ll_peak_rpm_v": kv,
        "lq_h": lq,
        "ld_h": ld,
    }


EXPORTER = Exporter("simplefoc", "h", "SimpleFOC constructor call, C++", render, read)
