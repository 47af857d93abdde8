"""The temperature coefficient of the magnets: as measured, or as magnets usually have it."""

from __future__ import annotations

from pipeline.estimation.policy import policy
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Budget, type_b

SOURCE = "assumed:temp_coeff_magnet_1_k"


def magnet_coefficient(known: Constants) -> tuple[float, Budget]:
    """The coefficient of psi at 25 degC [1/K] and where its uncertainty comes from.

    What is assumed of one motor's magnets is one error in all that is brought to 25 degC by it.

    Parameters
    ----------
    known
        Constants found so far.

    Returns
    -------
    value : float
        [1/K].
    budget : Budget
        [1/K].

    """
    alpha = known.best("temp_coeff_magnet_1_k")
    if alpha is None:
        usual = policy().magnet
        return usual.coefficient_1_k, type_b(SOURCE, usual.u_coefficient_1_k)
    return alpha.number, alpha.budget
