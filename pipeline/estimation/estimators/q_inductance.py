"""q inductance by the d voltage that the q current induces at speed."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.estimation.electrical.flux_slope import TESTS, inductance_at_speed
from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants

METHOD = Method("q_inductance")
EXPERIMENT = (
    "record current_step captures, which give ld_h and lq_h, or a drive with vd_v, vq_v, id_a, "
    "iq_a and theta_mech_rad in which the q current changes at speed"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """L_q by the drives, else by the torque maps.

    Notes
    -----
    v_d = R i_d + L_d di_d/dt - p L_q ω i_q: what the d voltage has of ω i_q. It is the inductance
    at small current, of the frequency at which the shaft turns. `speed_inductance` counts pole
    pairs by it where a test at standstill knows the inductance.

    References
    ----------
    IEEE Std 1812-2014 (dq equations).

    """
    return inductance_at_speed(METHOD, "q", campaign, known, EXPERIMENT)


ESTIMATOR = Estimator(
    METHOD.name,
    ("lq_h",),
    TESTS,
    EXPERIMENT,
    fit,
    uses=("lq_h", "pole_pairs"),
    rank=30,
    clock_powers={"lq_h": 1},
)
