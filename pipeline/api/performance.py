"""What a motor does at stated conditions, from its datasheet."""

from __future__ import annotations

from pipeline.performance.conditions import operation_of
from pipeline.performance.derive import performance_of
from pipeline.records.capture import Campaign
from pipeline.records.datasheet import Datasheet
from pipeline.records.performance import Performance


def operate(sheet: Datasheet, *, vdc_v: float, current_a: float, **others: float) -> Performance:
    """Torque against speed, ratings and efficiency of a motor at stated conditions.

    Parameters
    ----------
    sheet : Datasheet
        From `check` or `load`.
    vdc_v : float, V
        DC bus voltage.
    current_a : float, A
        Current limit, phase peak.
    **others : float
        `temp_winding_degc`, `temp_magnet_degc`, `temp_ambient_degc`, `temp_limit_degc` [degC],
        `voltage_share` [1], `drop_v` [V], `on_ohm` [ohm]; docs/performance.md has the defaults.

    Returns
    -------
    Performance
        Numbers, curves and the efficiency map, each with its 95 % interval, and what is blank.

    Raises
    ------
    UsageError
        For conditions that no motor is operated at.
    TypeError
        For a condition that there is not, or anything but one datasheet.

    Examples
    --------
    >>> import pipeline
    >>> recordings = pipeline.read("data/demo", motor="G52-0601")
    >>> sheet = pipeline.check(pipeline.fit(recordings), model=None)["G52-0601"]
    >>> found = pipeline.operate(sheet, vdc_v=24.0, current_a=9.0)
    >>> peak = found.number("torque_peak_nm")
    >>> print(f"{peak.value:.3f} N·m, {peak.low:.3f} to {peak.high:.3f}")
    0.663 N·m, 0.662 to 0.664

    """
    if not isinstance(sheet, Datasheet):
        raise TypeError(
            f"operate takes one datasheet, sheets[motor_id], not {type(sheet).__name__}"
        )
    unknown = sorted(set(others) - CONDITIONS)
    if unknown:
        raise TypeError(
            f"operate() has no condition {unknown[0]!r}: {', '.join(sorted(CONDITIONS))}"
        )
    stated = {"vdc_v": vdc_v, "current_a": current_a, **others}
    return performance_of(sheet, operation_of(Campaign(sheet.motor_id, ()), stated))


CONDITIONS = frozenset(
    {
        "temp_winding_degc",
        "temp_magnet_degc",
        "temp_ambient_degc",
        "temp_limit_degc",
        "voltage_share",
        "drop_v",
        "on_ohm",
    }
)
"""Conditions beside voltage and current."""
