"""d inductance by the q voltage that the d current induces at speed."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.estimation.electrical.flux_slope import TESTS, inductance_at_speed
from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants

METHOD = Method("d_inductance")
EXPERIMENT = (
    "record current_step captures, which give ld_h and lq_h, or a drive with vd_v, vq_v, id_a, "
    "iq_a and theta_mech_rad in which the d current changes at speed, as in field weakening"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """L_d by the drives, else by the torque maps.

    Notes
    -----
    v_q = R i_q + L_q di_q/dt + p ω (L_d i_d + ψ): what the q voltage has of ω i_d, beside a flux
    of the magnet that temperature and time change. Most of v_q is that flux's, so that effects
    which nothing here models count by the share of v_q that L_d alone explains.

    References
    ----------
    IEEE Std 1812-2014 (dq equations).

    """
    return inductance_at_speed(METHOD, "d", campaign, known, EXPERIMENT)


ESTIMATOR = Estimator(
    METHOD.name,
    ("ld_h",),
    TESTS,
    EXPERIMENT,
    fit,
    uses=("ld_h", "pole_pairs"),
    rank=30,
    clock_powers={"ld_h": 1},
)
