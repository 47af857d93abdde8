"""What contradicts the law of a shaft's motion, as parts of the budgets of J, T_c and B."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.estimation.mechanical.drag_over_time import DragOverTime
from pipeline.estimation.policy import policy
from pipeline.estimation.uncertainty.regimes import Disagreement
from pipeline.records.uncertainty import BETWEEN, Contribution

SOURCE = "inertia"
"""Whose parts of a budget they are."""
DRAGS = ("j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad")


@dataclass(frozen=True, slots=True)
class Doubts:
    """What contradicts the law of motion.

    Attributes
    ----------
    share
        Of the square of the acceleration, that follows no torque [1].
    regimes
        Where regimes differ in J, T_c/J, B/J; each or None.
    over_time
        How drag changes with time; None where it does not.

    """

    share: float
    regimes: tuple[Disagreement | None, Disagreement | None, Disagreement | None]
    over_time: DragOverTime | None = None

    def reason(self, index: int) -> str:
        """Why T_c or B has no value: it still changed when the captures ended.

        Parameters
        ----------
        index
            Place in `DRAGS`.

        Returns
        -------
        str
            Empty where it has one.

        """
        changing = index > 0 and self.over_time is not None and self.over_time.is_open(index - 1)
        return self.over_time.words if changing and self.over_time is not None else ""

    def parts(self, index: int, value: float, inertia: float, logged: bool) -> list[Contribution]:
        """Contributions to J, T_c or B; T_c and B are scaled by J, and so by its doubts.

        Parameters
        ----------
        index
            Place in `DRAGS`.
        value
            The constant [its unit].
        inertia
            J [kg·m²].
        logged
            Whether every drive logs its load.

        Returns
        -------
        list of Contribution
            In the unit of the constant.

        """
        if logged:
            parts = [Contribution(f"{BETWEEN}{SOURCE}:unexplained", self.share * value, "B")]
        else:
            half = 0.5 * self.share * value / self.middle(logged)
            parts = [Contribution("assumed:free_shaft", half, "B")]
        for k in {0, index}:
            regime = self.regimes[k]
            if regime is not None:
                parts.append(regime.part(f"{SOURCE}:{DRAGS[k]}", value))
        if index > 0 and self.over_time is not None:
            source = f"{SOURCE}:{DRAGS[index]}:time"
            parts.append(self.over_time.part(index - 1, value, inertia, source))
        return parts

    def middle(self, logged: bool) -> float:
        """Middle of where the inertia may lie, over the one by which acceleration follows torque.

        With a load that nothing logged, J is that one where the current does not answer the load,
        and less by the unexplained share, as current follows acceleration, where a speed loop has
        the current hold against all of it. Between both it may be any.

        Parameters
        ----------
        logged
            Whether every drive logs its load.

        Returns
        -------
        float
            [1].

        References
        ----------
        Frisch, Statistical Confluence Analysis, 1934 (the two regressions are bounds).

        """
        return 1.0 if logged else 1.0 - 0.5 * self.share

    def words(self, logged: bool) -> list[str]:
        """What the regimes and the share say, where they say something.

        Parameters
        ----------
        logged
            Whether every drive logs its load.

        """
        names = ("the inertia", "Coulomb friction over inertia", "viscous friction over inertia")
        words = [d.words(n) for d, n in zip(self.regimes, names, strict=True) if d is not None]
        if self.over_time is not None:
            words.append(self.over_time.words)
        if self.share > policy().drag.unexplained_share:
            words.append(
                f"{100.0 * self.share:.2g} % of the square of the drives' acceleration follows "
                f"neither current nor load{'' if logged else ', which nothing logged'}"
            )
        return words
