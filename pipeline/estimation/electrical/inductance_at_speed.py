"""An inductance by the voltage that its current induces at speed in the other axis."""

from __future__ import annotations

from pipeline.estimation.electrical.flux_slope import (
    STANDSTILL,
    Slope,
    flux_slope,
    rows_of_slope,
    slope_budget,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Fit
from pipeline.estimation.uncertainty.instruments import unstated_note
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Contribution, propagate

TESTS = ("drive", "torque_map")


def inductance_at_speed(
    method: Method, axis: str, campaign: Campaign, known: Constants, experiment: str
) -> Fit:
    """L = (p L) / p, p L by `flux_slope` of the drives, else of the torque maps.

    A test at standstill knows it better; with one, nothing is published. A drive may turn its frame
    by a loop that is behind as the shaft gathers speed. Where the current makes that acceleration,
    on a free shaft, no regression separates the two: it is in the uncertainty.

    Parameters
    ----------
    method
        In whose name.
    axis
        `d` or `q`.
    campaign
        With drives or torque maps.
    known
        `ld_h` or `lq_h`, and `pole_pairs`, as far as known.
    experiment
        What to record where it is not determined.

    """
    name = f"l{axis}_h"
    pole_pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    if any(known.by(other, name) is not None for other in STANDSTILL):
        return method.nothing((name,), "a test at standstill gives it")
    if pole_pairs is None:
        return method.nothing((name,), f"state pole_pairs, or record an open_circuit; {experiment}")
    slopes = _slopes(campaign, axis, pole_pairs)
    doubts = [_doubt(slope, axis) for slope in slopes]
    slope = next((s for s, doubt in zip(slopes, doubts, strict=True) if not doubt), None)
    if slope is None:
        return method.nothing((name,), "; ".join([*doubts[:1], experiment]))
    value = slope.value_h / pole_pairs
    parts = propagate([(1.0 / pole_pairs, slope_budget(method, axis, slope))])
    limits = policy().at_speed
    iron = Contribution(f"assumed:{name}_at_speed", value * limits.share, "B")
    # p of the angle, and one over p of the inductance
    behind = Contribution(f"assumed:{name}_frame", limits.behind_s2 * slope.behind_h_s2, "B")
    captures = slope.rows.captures
    counted = known.best("pole_pairs") is not None
    rests = "" if counted else f"rests on the {pole_pairs} pole pairs that the captures state"
    notes = [rests, unstated_note(captures, ("voltage", "current"))]
    paths = [capture.path for capture in captures]
    return Fit((method.measured(name, value, [*parts, iron, behind], paths, None, notes),))


def _slopes(campaign: Campaign, axis: str, pole_pairs: int) -> list[Slope]:
    """Of the drives and of the torque maps, where a current of this axis changes."""
    slopes = []
    for test in TESTS:
        rows = rows_of_slope(campaign.of(test), pole_pairs)
        slope = flux_slope(rows, axis) if rows else None
        if slope is not None and slope.value_h > 0.0:
            slopes.append(slope)
    return slopes


def _doubt(slope: Slope, axis: str) -> str:
    """Why a slope does not determine the inductance; empty where it does."""
    limits, scatter = policy().at_speed, slope.u_h / slope.value_h
    if scatter > limits.most_scatter:
        return f"it scatters by {100.0 * scatter:.0f} % over the windows"
    if slope.unmodelled > limits.most_unmodelled:
        return (
            f"the {axis} current alone explains {100.0 * slope.share:.1g} % of the voltage, near "
            "what effects make that are not modelled: let it change more, at speed"
        )
    return ""
