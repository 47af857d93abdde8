"""Whether Lq over Ld is one that this machine can have."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import not_evaluated, ratio_of
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check, CheckStatus
from pipeline.records.estimate import Estimate

NAME = "saliency_ratio"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Lq/Ld between 1 and `largest`, less than 1 only where the reluctance torque agrees.

    Notes
    -----
    The magnet lies in the d axis's path, so Ld ≤ Lq in all but flux-intensifying machines; in those
    the torque map's reluctance term 1.5 p (Ld − Lq) is positive. Ld > Lq with a negative reluctance
    term means that the axes were exchanged. A ratio within 2 u or a hundredth of 1 passes. The
    option `largest` [1] is a ratio that no machine has.

    """
    ld, lq = constants.best("ld_h"), constants.best("lq_h")
    if ld is None or lq is None:
        return not_evaluated(NAME, "needs current_step or lcr captures on both axes")
    ratio, u, _ = ratio_of(lq, ld)
    status, suspect = _status(ratio, u, options["largest"], constants.best("kt_reluctance_nm_a2"))
    words = (
        f"Lq over Ld is {ratio:.4f} ± {2.0 * u:.4f} (k=2); "
        f"1 with surface magnets, above 1 with interior magnets, at most {options['largest']:g}"
    )
    return Check(NAME, status, words, ratio, 1.0, "1", suspect)


def _status(
    ratio: float, u: float, largest: float, reluctance: Estimate | None
) -> tuple[CheckStatus, str | None]:
    if ratio > largest + 2.0 * u:
        return "fail", "one inductance is not of this motor: an open phase or a wrong pair"
    if ratio >= 1.0 - max(2.0 * u, 0.01):
        return "pass", None
    if reluctance is None or abs(reluctance.number) < 2.0 * reluctance.u:
        return "marginal", "d and q exchanged, unless the machine is flux-intensifying"
    if reluctance.number > 0.0:
        return "pass", None
    return "fail", "d and q exchanged: theta_elec_deg is a quarter period off"


RULE = Rule(
    NAME,
    check,
    {"largest": 10.0},
    tests=("current_step", "lcr"),
    quantities=("ld_h", "lq_h"),
)
