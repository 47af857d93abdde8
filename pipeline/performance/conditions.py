"""What a motor is operated at: as stated, else as its captures were taken."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import UsageError
from pipeline.records.performance import Operation

AMBIENT_DEGC, RISE_K = 40.0, 80.0
"""Reference ambient of IEC 60034-1, 6, and the rise that its 8.10 allows thermal class 130 (B), by
resistance: what is taken where no limit is stated."""
HIGH = 99.0
"""Percentile of a capture's samples that counts as its highest: one spike is none."""
STATED, SEEN = "stated", "the highest in the captures"
Stated = Mapping[str, float | None]


def operation_of(campaign: Campaign, stated: Stated) -> Operation | None:
    """The conditions of `operate=` keys, those that are not stated from the captures.

    Parameters
    ----------
    campaign : Campaign
        Whose highest voltage and current stand in for what is not stated.
    stated : mapping of str to float or None
        `vdc_v`, `current_a` (phase peak), `temp_winding_degc`, `temp_magnet_degc`,
        `temp_ambient_degc`, `temp_limit_degc`, `voltage_share`, `drop_v`, `on_ohm`.

    Returns
    -------
    Operation or None
        None where neither a key nor a capture gives a voltage and a current.

    Raises
    ------
    UsageError
        For a voltage, current or share that is not above 0, a share above 1.1, a negative drop, or
        a temperature limit that is not above the ambient.

    """
    known = check_stated(stated)
    usual = {
        "vdc_v": _bus_voltage(campaign),
        "current_a": _highest(campaign.captures, "id_a", "iq_a"),
    }
    conditions = {name: known.get(name, value) for name, value in usual.items()}
    if conditions["vdc_v"] is None or conditions["current_a"] is None:
        return None
    origin = {name: STATED if name in known else SEEN for name in conditions}
    defaults = {
        "temp_winding_degc": (25.0, "the reference of the constants"),
        "temp_magnet_degc": (25.0, "the reference of the constants"),
        "temp_ambient_degc": (AMBIENT_DEGC, "IEC 60034-1, clause 6"),
        "voltage_share": (1.0, "linear range of space-vector modulation"),
    }
    for name, (value, why) in defaults.items():
        conditions[name] = known.get(name, value)
        origin[name] = STATED if name in known else why
    ambient = known.get("temp_ambient_degc", AMBIENT_DEGC)
    conditions["temp_limit_degc"] = known.get("temp_limit_degc", ambient + RISE_K)
    origin["temp_limit_degc"] = (
        STATED if "temp_limit_degc" in known else "80 K: IEC 60034-1, 8.10, class 130 (B)"
    )
    drops = {name: known.get(name) for name in ("drop_v", "on_ohm")}
    return Operation(**conditions, **drops, origin=origin)  # type: ignore[arg-type]


def check_stated(stated: Stated) -> dict[str, float]:
    """The stated conditions as numbers.

    Parameters
    ----------
    stated
        By name; what is None is left out.

    Returns
    -------
    dict of float
        In the unit of each name.

    Raises
    ------
    UsageError
        A number is not finite, not above 0 where it must be, or is that of no motor or inverter.

    """
    known = {name: float(v) for name, v in stated.items() if v is not None}
    ambient = known.get("temp_ambient_degc", AMBIENT_DEGC)
    if not known.get("temp_limit_degc", math.inf) > ambient:
        raise UsageError("operate.temp_limit_degc is not above the ambient", "state a higher one")
    for name, value in known.items():
        if not math.isfinite(value):
            raise UsageError(f"operate.{name}={value} is no number", "state a finite one")
        if name in ("vdc_v", "current_a", "voltage_share") and value <= 0.0:
            raise UsageError(f"operate.{name}={value:g} is not above 0", "state a positive one")
        if name == "voltage_share" and value > 1.1:
            raise UsageError(
                f"operate.voltage_share={value:g} is more than an inverter gives",
                "1 is vdc/√3; six-step operation reaches 1.103",
            )
        if name in ("drop_v", "on_ohm") and value < 0.0:
            raise UsageError(f"operate.{name}={value:g} is negative", "state 0 or more")
        if name.endswith("_degc") and not -100.0 < value < 500.0:
            raise UsageError(f"operate.{name}={value:g} is no motor's", "state it in degC")
    return known


def _bus_voltage(campaign: Campaign) -> float | None:
    """The link's voltage: measured, else what the highest phase voltage needs, √3 times it [V]."""
    buses = [
        float(np.nanmedian(c.arrays("vdc_v")["vdc_v"])) for c in campaign.captures if c.has("vdc_v")
    ]
    highest = [volts for volts in buses if volts > 0.0]
    if highest:
        return _rounded(max(highest))
    phase = _highest(campaign.of("drive", "torque_map"), "vd_v", "vq_v")
    return None if phase is None else _rounded(math.sqrt(3.0) * phase)


def _highest(captures: Iterable[Capture], d: str, q: str) -> float | None:
    """The highest length of a dq vector in any capture."""
    currents = []
    for capture in captures:
        if capture.has(d, q):
            columns = capture.arrays(d, q)
            length = np.hypot(columns[d], columns[q])
            length = length[np.isfinite(length)]
            if length.size:
                currents.append(float(np.percentile(length, HIGH)))
    return _rounded(max(currents)) if currents and max(currents) > 0.0 else None


def _rounded(value: float) -> float:
    """To three digits: a condition, no measurement."""
    return float(f"{value:.3g}")
