"""Flat JSON of settings for ODrive, by property path.

Field names and units: ODrive's firmware interface, commit f9b5419 (`axis0.config.motor`). There is
one inductance, for which the mean of both axes stands; `torque_constant` is per peak ampere of q
current; resistance is that of a phase. `direction` and the current limits belong to the drive and
its wiring; limits are written where `options.current_max_a` states them.
"""

from __future__ import annotations

import json

from pipeline.export.protocol import Exporter, Options, Source, Values, number_option

PATH = "axis0.config.motor."
HEADROOM = 1.3


def render(source: Source, options: Options) -> str:
    """The settings as one JSON object with sorted keys."""
    kt = "kt_peak_nm_a" if source.optional("kt_peak_nm_a") else "kt_from_ke_nm_a"
    settings: dict[str, object] = {
        "pole_pairs": round(source.value("pole_pairs")),
        "phase_resistance": source.value("r_phase_ohm"),
        "phase_inductance": (source.value("ld_h") + source.value("lq_h")) / 2.0,
        "phase_resistance_valid": True,
        "phase_inductance_valid": True,
        "torque_constant": source.value(kt),
    }
    limit = number_option(options, "current_max_a")
    if limit is not None:
        settings |= {"current_soft_max": limit, "current_hard_max": HEADROOM * limit}
    flat = {PATH + name: value for name, value in settings.items()}
    return json.dumps(flat, indent=1, sort_keys=True) + "\n"


def read(text: str) -> Values:
    """The constants of such settings; both inductances are the one that is there."""
    settings = json.loads(text)
    inductance = float(settings[PATH + "phase_inductance"])
    return {
        "pole_pairs": float(settings[PATH + "pole_pairs"]),
        "r_phase_ohm": float(settings[PATH + "phase_resistance"]),
        "mean_inductance_h": inductance,
        "kt_peak_nm_a": float(settings[PATH + "torque_constant"]),
    }


EXPORTER = Exporter(
    "odrive",
    "json",
    "ODrive settings, flat JSON",
    render,
    read,
    {"current_max_a": "soft limit of the motor current, peak ampere"},
)
