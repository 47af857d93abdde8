"""Configuration lines for moteus, as its `conf set` takes them.

Field names and units: mjbots/moteus, commit db1a762, fw/bldc_servo_structs.h (struct
BldcServoMotor). `motor.poles` counts poles, twice the pairs; `motor.resistance_ohm` is from a phase
to the star point; `motor.Kv` is rpm per volt of line-line peak, so that the firmware's torque
constant is 8.27/Kv = 1.5 p psi.
"""

from __future__ import annotations

from pipeline.export.protocol import Exporter, Options, Source, Values

FIELDS = (
    ("motor.resistance_ohm", "r_phase_ohm", "phase to star point"),
    ("motor.inductance_d_H", "ld_h", "phase, d axis"),
    ("motor.inductance_q_H", "lq_h", "phase, q axis"),
    ("motor.Kv", "kv_ll_peak_rpm_v", "rpm per volt, line-line peak"),
)


def render(source: Source, options: Options) -> str:
    """One `conf set` line a field, conventions in comment lines before them."""
    del options
    lines = [f"# {line}" for line in source.heading()]
    lines += [f"# {field}: {words}" for field, _, words in FIELDS]
    lines.append("# motor.poles: poles, twice the pole pairs")
    lines.append(f"conf set motor.poles {2 * round(source.value('pole_pairs'))}")
    lines += [f"conf set {field} {source.value(name)!r}" for field, name, _ in FIELDS]
    return "\n".join([*lines, ""])


def read(text: str) -> Values:
    """The constants of such lines."""
    rows = (line.split() for line in text.splitlines() if line.startswith("conf set "))
    settings = {row[2]: float(row[3]) for row in rows}
    fields = {name: settings[field] for field, name, _ in FIELDS}
    return {**fields, "pole_pairs": settings["motor.poles"] / 2.0}


EXPORTER = Exporter("moteus", "cfg", "moteus `conf set` lines", render, read)
