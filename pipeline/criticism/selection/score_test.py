"""What candidates would do for a fit, to first order.

References: [1] Rao, Math. Proc. Camb. Phil. Soc. 44 (1948), score test; [2] Schwarz, Ann. Stat.
6 (1978), the penalty of a parameter; [3] Chen & Chen, Biometrika 95 (2008),
doi:10.1093/biomet/asn034, penalty of a search over candidates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Flags, Indices
from pipeline.criticism.parameter import Machine, Parameter
from pipeline.criticism.policy.selection import Selection
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import Descent, NormalEquations
from pipeline.criticism.selection.candidates import Candidate, placed, searched
from pipeline.criticism.selection.improvement import FitQuality, clears, fall_below_floor, share_of


@dataclass(frozen=True, slots=True)
class Score:
    """What a candidate would do for a fit, to first order.

    Attributes
    ----------
    candidate
        The candidate.
    fall
        Fall of the deviance.
    penalty
        What its parameters and the search over candidates cost.
    step
        Its own parameters, by full name.
    moves
        Changes of the model's own parameters.
    share
        Part that it removes of the removable excess, of the channel that it helps most [1].
    size
        Largest of its amplitudes over its negligible size [1].
    below_floor
        Part of the fall in signals that have nothing over their floor.
    clears
        Whether it removes most of what would be reported as a remainder, and so matters at any
        size; never for a coupling, which noise of an encoder in a speed loop looks like.
    other_inertia
        Whether it asks for an inertia so far from the fit's that the noise floors, made with that
        one, do not tell its share; its refit does.
    confounder
        An effect that explains the same better, but is too small to matter.
    policy
        Constants of judgement.

    """

    candidate: Candidate
    fall: float
    penalty: float
    step: Mapping[str, float]
    moves: Mapping[str, float]
    share: float
    size: float
    below_floor: float = 0.0
    clears: bool = False
    other_inertia: bool = False
    confounder: str | None = None
    policy: Selection = field(kw_only=True)

    @property
    def matters(self) -> bool:
        """Whether it is large enough to matter in use, or what would be left without it is."""
        return self.size >= 1.0 or self.clears

    @property
    def passes(self) -> bool:
        """Whether it is worth its penalty, large enough to matter and helps enough.

        Below the floor only what the machine itself does is named. A sensor's error is a common
        factor of which any form that is a little wrong elsewhere asks for some; and an effect of a
        discriminator is not discriminated from noise of the angle's sensor, which runs through a
        drive's speed loop and so is in torque and angle alike.
        """
        return self._is_worth_it and self._helps

    @property
    def may_be_hidden(self) -> bool:
        """Whether it is worth its penalty and large enough, and helps too little in the fit alone.

        Nuisances may take there what captures show that are predicted from the others: zeros of a
        transducer, one a capture, took an offset that all of them have.
        """
        clear = self.fall > self.policy.below_floor_penalties * self.penalty
        uncoupled = self.candidate.effect.discriminator is None
        return clear and uncoupled and self._is_worth_it and not self._helps

    @property
    def _is_worth_it(self) -> bool:
        return self.fall > self.penalty and self.matters and self.confounder is None

    @property
    def _helps(self) -> bool:
        effect = self.candidate.effect
        below = self._below_floor and effect.hook != "sensor" and effect.discriminator is None
        return self.share >= self.policy.least_share or below or self.other_inertia

    @property
    def _below_floor(self) -> bool:
        return self.below_floor > self.policy.below_floor_penalties * self.penalty

    @property
    def shortfall(self) -> str:
        """What it lacks to be named; of one that passes, that a refit did not bear it out."""
        if self.fall <= self.penalty:
            return "not worth its parameters"
        if not self.matters:
            return f"seen, at {self.size:.2g} of the least size that matters"
        if self.confounder is not None:
            return f"{self.confounder} explains it as well, and is too small to matter"
        if self.passes:
            return "refitted, it is below the floor, not seen in captures held out, or may be zero"
        if self._below_floor:
            return "what it would explain lies below the noise floor"
        return "takes too small a share of what is over the noise floor"


def score_all(
    system: LinearSystem,
    offered: Sequence[Candidate],
    significant: Flags | None = None,
) -> tuple[Score, ...]:
    """The score of every candidate, of each effect its best shape.

    Parameters
    ----------
    system
        The fit with the columns of all candidates.
    offered
        The candidates.
    significant
        Groups [G] that would be reported as a remainder if nothing were added.

    Returns
    -------
    tuple of Score
        The largest fall first.

    """
    scoring, policy = _Scoring.of(system, significant), system.policy.selection
    searched_of = {c.effect.name: searched(offered, c.effect) for c in offered}
    best: dict[str, tuple[Score, Indices]] = {}
    for candidate, places in placed(system, offered):
        score = scoring.score(candidate, places, policy.quick)
        count = paid_for(candidate.effect, system.fit.machine, score)
        cost = count * math.log(system.informed(places))
        cost += searched_of[candidate.effect.name]
        if score is not None and score.fall > policy.quick_penalties * cost:
            score = scoring.score(candidate, places, policy.thorough)
        known = best.get(candidate.effect.name)
        if score is not None and (known is None or score.fall > known[0].fall):
            best[candidate.effect.name] = replace(score, penalty=cost), places
    scores = [replace(one, confounder=scoring.confounder(one, best)) for one, _ in best.values()]
    return ranked(scores)


def ranked(scores: Iterable[Score]) -> tuple[Score, ...]:
    """Scores, the largest fall first, of equal ones by the effect's name.

    Parameters
    ----------
    scores
        One an effect.

    """
    return tuple(sorted(scores, key=lambda s: (-s.fall, s.candidate.effect.name)))


def paid_for(effect: Effect, machine: Machine, score: Score | None) -> int:
    """How many parameters a score costs.

    Parameters
    ----------
    effect
        The effect.
    machine
        Determines which parameters there are.
    score
        Of optional terms those that its step uses are counted; None counts none. A shape with a
        prior is not: it stays at what is usual where captures do not show it.

    """
    used = {} if score is None else score.step
    return sum(
        not p.optional or bool(used.get(name))
        for name, p in effect.named(machine).items()
        if not p.choice and (p.amplitude or p.usual is None)
    )


@dataclass(frozen=True, slots=True)
class _Scoring:
    """What every candidate is held against: a system, the model's own columns in it and how these
    alone fit, groups [G] that are then reported as a remainder.
    """

    system: LinearSystem
    normal_equations: NormalEquations
    model_columns: Indices
    before: FitQuality
    significant: Flags

    @classmethod
    def of(cls, system: LinearSystem, significant: Flags | None) -> _Scoring:
        model_columns, normal_equations = system.model_columns, system.normal_equations()
        before = FitQuality.of(system, model_columns, normal_equations.only(model_columns).best())
        remaining = np.zeros(len(system.labels), dtype=bool) if significant is None else significant
        return cls(system, normal_equations, model_columns, before, remaining)

    def score(
        self,
        candidate: Candidate,
        places: Indices,
        effort: tuple[tuple[float, ...], int],
    ) -> Score | None:
        """Score of one candidate with parameters on the wrong side of a bound left at zero."""
        system, machine = self.system, self.system.fit.machine
        parameters = candidate.effect.named(machine)
        best = self._inside(places, parameters, effort)
        if best is None:
            return None
        live, end = best
        step = dict(
            zip(self._names(live), end.step[self.model_columns.size :].tolist(), strict=True)
        )
        sizes = [
            abs(value) / (parameters[name].negligible * machine.scale(parameters[name]))
            for name, value in step.items()
            if parameters[name].negligible > 0
        ]
        after = FitQuality.of(system, np.concatenate([self.model_columns, live]), end)
        moves = end.step[: self.model_columns.size].tolist()
        of_model = dict(zip(self._names(self.model_columns), moves, strict=True))
        inertia = system.fit.values["j_kgm2"]
        return Score(
            candidate,
            self.before.deviance - after.deviance,
            0.0,
            step,
            of_model,
            share_of(system, candidate.effect, self.before, after),
            max(sizes, default=math.inf),
            fall_below_floor(system, self.before.reduced_chi2, after.reduced_chi2),
            candidate.effect.discriminator is None
            and clears(system, self.significant, self.before.reduced_chi2, after.reduced_chi2),
            abs(of_model.get("j_kgm2", 0.0)) > system.policy.fit.inertia_step * inertia,
            policy=system.policy.selection,
        )

    def _names(self, places: Indices) -> list[str]:
        return [self.system.columns[n].name for n in places]

    def _inside(
        self,
        places: Indices,
        known: Mapping[str, Parameter],
        effort: tuple[tuple[float, ...], int],
    ) -> tuple[Indices, Descent] | None:
        """The places along which no parameter is on the wrong side of its bound, and the best fit
        along them and the model's own; None where there are none.
        """
        live = places
        while live.size:
            end = self.normal_equations.only(np.concatenate([self.model_columns, live])).best(
                *effort
            )
            steps = zip(
                self._names(live), end.step[self.model_columns.size :].tolist(), strict=True
            )
            keep = np.array([not _outside(step, known[name]) for name, step in steps])
            if keep.all():
                return live, end
            live = live[keep]
        return None

    def confounder(self, score: Score, best: Mapping[str, tuple[Score, Indices]]) -> str | None:
        """The clearest effect that explains as much as a candidate, its penalty paid, at a size too
        small to matter, and beside which the candidate is not worth its own.

        A loss that is too small to be reported must not be reported under a wrong name.
        """
        if not (score.passes or score.may_be_hidden):
            return None
        small = [
            (other, places)
            for other, places in best.values()
            if score.policy.absent_size < other.size
            and not other.matters
            and other.fall > other.penalty
            and other.fall - other.penalty > score.fall - score.penalty - score.policy.tie
            and other.candidate.effect.discriminator is None
        ]
        if not small:
            return None
        clearest, beside = max(small, key=lambda pair: pair[0].fall)
        thorough = self.system.policy.selection.thorough
        _, shrunk = best[score.candidate.effect.name]
        without = self.normal_equations.only(np.concatenate([self.model_columns, beside])).best(
            *thorough
        )
        with_both = self.normal_equations.only(
            np.concatenate([self.model_columns, beside, shrunk])
        ).best(*thorough)
        worth = without.deviance - with_both.deviance > score.penalty
        return None if worth else clearest.candidate.effect.name


def _outside(value: float, parameter: Parameter) -> bool:
    return (value < 0 <= parameter.low) or (value > 0 >= parameter.high)
