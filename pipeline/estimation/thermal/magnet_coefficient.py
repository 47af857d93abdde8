"""The temperature coefficient of the magnets: as measured, or as magnets usually have it."""

from __future__ import annotations

from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Budget, type_b

SOURCE = "assumed:temp_coeff_magnet_1_k"
# Sintered NdFeB loses 0.09 to 0.12 % a kelvin, SmCo less than half of that, ferrite 0.2 %.
USUAL_1_K, U_USUAL_1_K = -0.0011, 4e-4


def magnet_coefficient(known: Constants) -> tuple[float, Budget]:
    """The coefficient of psi at 25 degC [1/K] and where its uncertainty comes from.

    What is assumed of one motor's magnets is one error in all that is brought to 25 degC by it.
    """
    found = known.best("temp_coeff_magnet_1_k")
    if found is None:
        return USUAL_1_K, type_b(SOURCE, U_USUAL_1_K)
    return found.number, found.budget
