"""q inductance by the d voltage that the q current induces at speed."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.estimation.electrical.flux_slope import (
    STANDSTILL,
    Slope,
    flux_slope,
    slope_budget,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.electrical.voltage_rows import voltage_rows
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import unstated_note
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Contribution, propagate

METHOD = Method("q_inductance")
GIVES = ("lq_h",)
EXPERIMENT = (
    "record current_step captures, which give ld_h and lq_h, or a drive with vd_v, vq_v, id_a, "
    "iq_a and theta_mech_rad in which the q current changes at speed"
)
AT_SPEED = "assumed:inductance_at_speed"


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """L_q = (p L_q) / p, p L_q by `flux_slope` of the drives, else of the torque maps.

    Notes
    -----
    v_d = R i_d + L_d di_d/dt - p L_q ω i_q: what the d voltage has of ω i_q. It is the inductance
    at small current, of the frequency at which the shaft turns. A test at standstill knows it
    better; with one, nothing is published here. `speed_inductance` then counts pole pairs by it.

    References
    ----------
    IEEE Std 1812-2014 (dq equations).

    """
    del options
    pole_pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    if any(known.by(method, "lq_h") is not None for method in STANDSTILL):
        return METHOD.nothing(GIVES, "a test at standstill gives it")
    if pole_pairs is None:
        return METHOD.nothing(GIVES, f"state pole_pairs, or record an open_circuit; {EXPERIMENT}")
    slope = _best_slope(campaign, pole_pairs)
    if slope is None:
        return METHOD.nothing(GIVES, EXPERIMENT)
    if slope.u_h > policy().at_speed.most_scatter * slope.value_h:
        scatter = f"{100.0 * slope.u_h / slope.value_h:.0f} %"
        return METHOD.nothing(GIVES, f"it scatters by {scatter} over the windows; {EXPERIMENT}")
    value = slope.value_h / pole_pairs
    parts = propagate([(1.0 / pole_pairs, slope_budget(METHOD, "q", slope))])
    iron = Contribution(AT_SPEED, value * policy().at_speed.share, "B")
    captures = slope.rows.captures
    counted = known.best("pole_pairs") is not None
    rests = "" if counted else f"rests on the {pole_pairs} pole pairs that the captures state"
    notes = [rests, unstated_note(captures, ("voltage", "current"))]
    paths = [capture.path for capture in captures]
    return Fit((METHOD.measured("lq_h", value, [*parts, iron], paths, None, notes),))


def _best_slope(campaign: Campaign, pole_pairs: int) -> Slope | None:
    """Of the drives, else of the torque maps; None where no current of this axis changes."""
    for test in ("drive", "torque_map"):
        rows = voltage_rows([c for c in campaign.of(test) if c.has("vd_v", "id_a")], pole_pairs)
        slope = flux_slope(rows, "q") if rows else None
        if slope is not None and slope.value_h > 0.0:
            return slope
    return None


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("drive", "torque_map"),
    EXPERIMENT,
    fit,
    uses=("lq_h", "pole_pairs"),
    rank=30,
    clock_powers={"lq_h": 1},
)
