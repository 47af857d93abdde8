"""Other names of a back-EMF constant that a log under current gave: flux, KV, Kt."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from pipeline.estimation.electrical.pole_pairs import pole_pairs_to_use
from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.physics.coupling import CouplingName, coupling_as
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, derived
from pipeline.records.pole_pairs import BY_VOLTAGE

METHOD = Method("back_emf_names")
KE = "ke_phase_peak_v_s_rad"
NAMES: dict[str, CouplingName] = {
    "ke_ll_peak_v_s_rad": "ke_ll_peak_v_s_rad",
    "ke_ll_rms_v_s_rad": "ke_ll_rms_v_s_rad",
    "ke_ll_peak_v_krpm": "ke_ll_peak_v_krpm",
    "kv_ll_peak_rpm_v": "kv_ll_peak_rpm_v",
    "kt_from_ke_nm_a": "kt_peak_nm_a",
}
GIVES = ("psi_pm_wb", *NAMES)
EXPERIMENT = (
    "record an open_circuit capture, or a drive with vq_v, iq_a and theta_mech_rad over a wide "
    "range of speed and current"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Flux, Ke of lines, KV and Kt by `coupling_as` from a Ke that was found under current.

    An open_circuit capture gives its own. The flux needs pole pairs, measured or of the nameplate.

    Notes
    -----
    psi = Ke/p; Kt = 1.5 Ke in the amplitude-invariant frame. Each is a power of Ke, 1 or -1.

    """
    ke = known.best(KE)
    spins = {capture.path for capture in campaign.of("open_circuit")}
    if ke is None or ke.status != "measured" or spins.issuperset(ke.captures):
        return METHOD.nothing(GIVES, EXPERIMENT)
    estimates = [
        _named(name, coupling_as(as_name, ke.number), ke) for name, as_name in NAMES.items()
    ]
    pairs, words = pole_pairs_to_use(known, campaign)
    if pairs is None:
        flux = METHOD.missing("psi_pm_wb", f"the flux is Ke over the pole pairs: {words}")
    else:
        flux = _named("psi_pm_wb", ke.number / pairs, ke, words)
    return Fit((flux, *estimates))


def _named(name: str, value: float, ke: Estimate, words: str = "") -> Estimate:
    power = -1.0 if name == "kv_ll_peak_rpm_v" else 1.0
    unit = METHOD.unit(name)
    terms = [(power * value / ke.number, ke)]
    named = derived(name, unit, value, terms, METHOD.name, ke.at)
    return replace(named, note="; ".join(w for w in (f"from Ke of {ke.method}", words) if w))


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("drive", "torque_map"),
    EXPERIMENT,
    fit,
    uses=(KE, "pole_pairs", BY_VOLTAGE),
    rank=40,
)
