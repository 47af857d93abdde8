"""Friction of coasting shafts, by an inertia that is stated."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import propagate

METHOD = Method("coast_friction")
COASTS = {"torque_coulomb_nm": "coast_coulomb_rad_s2", "b_visc_nm_s_rad": "coast_viscous_1_s"}
"""What a coast gives of each constant, over the inertia."""
EXPERIMENT = (
    "state j_rotor_kgm2 with its u_j_rotor_kgm2, or record a drive with iq_a and theta_mech_rad "
    "beside the spin_down"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """T_c and b by what coasts give of them over the inertia.

    Notes
    -----
    T_c = J (T_c/J) and b = J (b/J). Of an inertia that captures give, `inertia` has the friction by
    the same law: this is for one that is stated.

    References
    ----------
    JCGM 100:2008, 5.1.2.

    """
    inertia = known.best("j_rotor_kgm2")
    if inertia is None or inertia.status != "stated":
        return METHOD.nothing(tuple(COASTS), f"no inertia is stated; {EXPERIMENT}")
    return Fit(tuple(_one(name, inertia, known.best(of)) for name, of in COASTS.items()))


def _one(name: str, inertia: Estimate, coast: Estimate | None) -> Estimate:
    """One constant, of the stated inertia."""
    if coast is None:
        return METHOD.missing(name, f"no coast gives it; {EXPERIMENT}")
    parts = propagate([(coast.number, inertia.budget), (inertia.number, coast.budget)])
    words = f"rests on the stated j_rotor_kgm2 of {inertia.number:.4g} kg·m²"
    return METHOD.measured(
        name, inertia.number * coast.number, parts, coast.captures, coast.at, [words]
    )


ESTIMATOR = Estimator(
    METHOD.name,
    tuple(COASTS),
    ("spin_down",),
    EXPERIMENT,
    fit,
    uses=("j_rotor_kgm2", *COASTS.values()),
    rank=40,
)
