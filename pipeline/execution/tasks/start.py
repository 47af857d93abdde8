"""Start constants of the criticism."""

from __future__ import annotations

from pipeline.criticism.data.machine_scale import counted_pole_pairs
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants


def starts_from_fits(campaign: Campaign) -> bool:
    """Whether criticism needs constants that estimators fit: neither nameplate nor spin gives the
    pole pairs.
    """
    return campaign.nameplate("pole_pairs") is None and counted_pole_pairs(campaign) is None


def start_constants(campaign: Campaign, fitted: Constants | None = None) -> Constants:
    """The constants from which criticism starts.

    Empty where the nameplate or a spin gives the pole pairs, else `fitted`, fitted now if None.

    Parameters
    ----------
    campaign
        The captures of one motor.
    fitted
        Constants that were fitted before; None to fit them now.

    """
    if not starts_from_fits(campaign):
        return Constants()
    if fitted is not None:
        return fitted
    from pipeline.estimation.registry import fit_all  # imports scipy, and most campaigns do without

    return fit_all(campaign, {})[0]
