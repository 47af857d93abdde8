"""The torque constant that a mechanical fit scales with: measured, or from the back-EMF."""

from __future__ import annotations

from pipeline.physics.coupling import coupling_as
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, derived

UNKNOWN = (
    "a torque constant is not known: state kt_peak_nm_a and u_kt_peak_nm_a (`constants=`, or the "
    "metadata), or record an open_circuit or a torque_map"
)
USES = ("kt_peak_nm_a", "kt_from_ke_nm_a", "ke_phase_peak_v_s_rad")


def torque_constant(known: Constants) -> Estimate | None:
    """Kt per peak q ampere: of the torque test, else 1.5 p psi, else 1.5 Ke; None without any.

    Kt_peak = 1.5 Ke_phase_peak in the amplitude-invariant frame, whatever the pole pairs.

    Parameters
    ----------
    known
        Constants found so far.

    Returns
    -------
    Estimate or None
        [N·m/A].

    """
    kt = known.best("kt_peak_nm_a") or known.best("kt_from_ke_nm_a")
    if kt is not None:
        return kt
    ke = known.best("ke_phase_peak_v_s_rad")
    if ke is None:
        return None
    value = coupling_as("kt_peak_nm_a", ke.number)
    return derived("kt_from_ke_nm_a", "N·m/A", value, [(value / ke.number, ke)], ke.method)
