"""Whether the winding's resistance follows copper as it warms."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import Ratio, judge_ratio, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "resistance_temperature"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The coefficient found in the heat run over copper's at 25 degC (1/259.5 per kelvin).

    Notes
    -----
    The option `allowance` [1] covers a sensor that reads one spot of a winding with gradients.

    References
    ----------
    IEEE Std 112-2017, 5.4 (R of copper is proportional to 234.5 + T).

    """
    alpha = constants.best("temp_coeff_copper_1_k")
    if alpha is None or alpha.status == "assumed":
        return not_evaluated(NAME, _missing(constants))
    return judge_ratio(
        NAME,
        Ratio(
            alpha.number / COPPER_COEFFICIENT_25_1_K,
            alpha.u / COPPER_COEFFICIENT_25_1_K,
            alpha.dof,
        ),
        options["allowance"],
        "temperature coefficient of the resistance over copper's",
        "temperature_coefficient",
        otherwise="a thermometer that lags or sits off the winding, or a winding not of copper",
    )


def _missing(constants: Constants) -> str:
    """What is missing, with what a heat run that is there came to."""
    impossible = [e for e in constants.all_of("temp_coeff_copper_1_k") if e.impossible]
    if impossible:
        return f"the heat_run gives no coefficient: it {impossible[0].note}"
    return "needs a heat_run over some tens of kelvin"


RULE = Rule(
    NAME,
    check,
    {"allowance": 0.05},
    tests=("heat_run", "resistance"),
    quantities=("r_phase_ohm",),
)
