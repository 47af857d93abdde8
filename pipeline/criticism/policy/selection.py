"""Constants of judgement of `selection`: which effects are tried, named, kept and reported."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Score test, stepwise search, pruning, alternatives, truncation, drift and far starts."""

    tie: float = chosen(
        12.0, "−2 log L",
        "difference of deviance below which captures do not discriminate two explanations",
        why="3.5 standard deviations of one parameter, passed by chance one time in 2,000",
    )  # fmt: skip
    absent_size: float = chosen(
        0.02, "1", "share of the least size that matters below which an effect is not there",
        why="what explains a remainder is then a term that is none of its amplitudes, as the mean "
        "of all gains of the gain of one phase",
    )  # fmt: skip
    least_share: float = chosen(
        0.1, "1", "share of what is over the noise floor that an effect must take to be named",
        why="what takes less leaves the cause of nearly all of it open",
    )  # fmt: skip
    excess: float = chosen(
        30.0, "−2 log L", "excess over the noise floor that counts",
        why="two and a half ties: below it any form that is a little wrong takes a share",
    )  # fmt: skip
    excess_a_sample: float = chosen(
        0.5, "−2 log L a weak sample",
        "excess over the noise floor that counts where there are few samples",
        why="χ²/n of 1.65 in every sample",
    )  # fmt: skip
    clears_share: float = chosen(
        0.5, "1",
        "share of the power that would be a remainder that may stay where an effect matters at "
        "any size",
        why="most of it goes",
    )  # fmt: skip
    quick_starts: tuple[float, ...] = chosen(
        (1.0,), "1", "exponents of the weights that a quick score begins with",
        why="every candidate is scored so: the cost of the search",
    )  # fmt: skip
    quick_rounds: int = chosen(3, "1", "renewals of the weights of a quick score", why="cost")
    thorough_starts: tuple[float, ...] = chosen(
        (1.0, 0.0), "1", "exponents of the weights that a thorough score begins with",
        why="1 keeps groups that the fit gave up given up, 0 takes all of them back",
    )  # fmt: skip
    thorough_rounds: int = chosen(
        20, "1", "renewals of the weights of a thorough score at the most",
        why="a bound of the cost: most end before, by `fit.settled`",
    )  # fmt: skip
    quick_penalties: float = chosen(
        0.3, "BIC penalties", "fall of deviance that a quick score must show for a thorough one",
        why="a quick score ends early, and is too small",
    )  # fmt: skip
    below_floor_penalties: float = chosen(
        1.5, "BIC penalties", "evidence below the noise floor that an effect needs to be named",
        why="noise that is not white is down there too",
    )  # fmt: skip
    most_steps: int = chosen(
        6, "1", "steps of the ladder at the most, the model asked for included",
        why="five effects: each step costs a search",
    )  # fmt: skip
    refits: int = chosen(3, "1", "candidates that are refitted at a time", why="each costs a fit")
    refit_rounds: int = chosen(
        2, "1", "times that the next candidates are refitted", why="each costs fits"
    )
    close_share: float = chosen(
        0.7, "1", "share of the best fall of deviance that a candidate needs to be refitted too",
        why="a score is to first order; each refit costs a fit",
    )  # fmt: skip
    shorter_steps: tuple[float, ...] = chosen(
        (1.0, 0.5, 0.25, 0.125), "1", "parts of the step that a score predicts, from which a refit "
        "begins until one is no worse than the score promised to be better",
        why="from beyond the tangent's reach ten fits went to and fro for minutes",
    )  # fmt: skip
    held_out_penalties: float = chosen(
        0.5, "BIC penalties", "fall of deviance that a candidate must show on captures held out",
        why="held out, fewer captures carry each constant",
    )  # fmt: skip
    same_hook_penalties: float = chosen(
        3.0, "BIC penalties", "the same below the noise floor, beside an effect of the same hook",
        why="a form that is a little wrong leaves evidence of that size there",
    )  # fmt: skip
    form_error: float = chosen(
        0.05, "1", "share of an effect of the same hook that its form may be wrong by",
        why="windage that only takes up what the formula of Stribeck friction leaves is not there",
    )  # fmt: skip
    least_u: float = chosen(
        2.0, "standard uncertainties",
        "distance from zero that some amplitude of a named effect must have",
        why="95 %",
    )  # fmt: skip
    most_penalties: float = chosen(
        4.0, "BIC penalties",
        "rise of deviance without an earlier effect from which on it is not refitted away",
        why="the tangent is believed where it is that clear",
    )  # fmt: skip
    floor_ratio: float = chosen(
        1.5, "1", "ratio of some noise floor, new over old, that calls for a fit by the new ones",
        why="a floor is known to some 6 %; one that is off by half moves what is over it",
    )  # fmt: skip
    coupling_floors: float = chosen(
        20.0, "noise floors",
        "miss of a torque from which on a soft coupling is fitted from a start of its own",
        why="a base that is a little wrong misses by a few; an inertia behind a soft shaft by tens",
    )  # fmt: skip
    inertia_ratio: float = chosen(
        2.0, "1", "ratio of a fit's inertia and a rough fit's from which on a fit begins anew",
        why="most rough fits are a tenth off; a spoiled inertia came in tens of times",
    )  # fmt: skip
    tangent_penalties: float = chosen(
        20.0, "BIC penalties",
        "rise of deviance from which on the tangent is believed that a term pays",
        why="a term costs a fit to try",
    )  # fmt: skip
    choice_falls: float = chosen(
        2.0, "1", "times its fall of deviance to first order that another choice may reach",
        why="refits fell by up to 1.8 times where that mattered, and a refit costs a fit",
    )  # fmt: skip
    alternative_share: float = chosen(
        0.5, "1", "share of what an effect explains that an alternative may lose to first order",
        why="the tangent may be wrong, and each refit costs a fit",
    )  # fmt: skip
    most_alternatives: int = chosen(
        6, "1", "alternatives that are refitted at the most", why="each costs a fit"
    )
    passed_over_share: float = chosen(
        0.1, "1",
        "share of an effect's fall of deviance that one passed over may have been short of",
        why="a score is to first order",
    )  # fmt: skip
    unexplained_share: float = chosen(
        0.5, "1",
        "share of deviance and of the held-out error over the floor that effects may leave and "
        "still explain the captures",
        why="most of it goes",
    )  # fmt: skip
    guess_share: float = chosen(
        0.2, "1", "share of the held-out error that a further step must take while any is left",
        why="a tenth of heat in a winding looked like skin effect",
    )  # fmt: skip
    companion_share: float = chosen(
        0.5, "1",
        "share of the amplitude that one amplitude implies for another which that must have, or "
        "captures contradict both",
        why="a form is right to far less than half",
    )  # fmt: skip
    drift_size: float = chosen(
        4.0, "standard deviations of noise", "drift of a sensor at a capture's end",
        why="larger, and slow effects pass for drift; smaller, and a drift is named as an effect",
    )  # fmt: skip
    drift_terms: int = derived(
        8, "1", "sines that a drift is made of", source="they hold 97 % of a random walk's power"
    )
    drift_tests: int = chosen(
        2, "1", "tests in whose captures a drift must show",
        why="a machine that warms up does so in its own test alone",
    )  # fmt: skip
    finer_starts: tuple[float, ...] = derived(
        (0.5**0.5, 0.5**0.25, 2.0**0.25, 2.0**0.5), "1",
        "multiples of the best far start that are tried after it",
        source="far starts are an octave apart",
    )  # fmt: skip
    visible_u: float = chosen(
        3.0, "standard deviations",
        "typical size of an effect from which on captures would show it",
        why="three standard deviations, as is usual for detection",
    )  # fmt: skip

    @property
    def quick(self) -> tuple[tuple[float, ...], int]:
        """Starts and rounds of a quick score."""
        return self.quick_starts, self.quick_rounds

    @property
    def thorough(self) -> tuple[tuple[float, ...], int]:
        """Starts and rounds of a thorough score."""
        return self.thorough_starts, self.thorough_rounds


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderScan:
    """Orders a turn that logs have and that no equation looks at."""

    lowest: float = chosen(
        1.5, "1/turn", "lowest order that is looked at", why="below is what a drag leaves of itself"
    )
    highest: float = chosen(
        128.0, "1/turn", "highest order that is looked at",
        why="beyond twice the tooth count of any machine here",
    )  # fmt: skip
    step: float = derived(
        0.25, "1/turn", "distance of the orders that are looked at",
        source="a part of four turns resolves no finer ones",
    )  # fmt: skip
    turns: float = chosen(
        4.0, "turns", "length of a part of a log",
        why="longer parts are fewer, and noise is averaged over less of them",
    )  # fmt: skip
    least_turns: float = chosen(
        3.0, "turns", "fewest turns of a part", why="they resolve thirds of an order"
    )
    samples: float = chosen(
        5.0, "samples a cycle", "samples that an order must have at the mean speed",
        why="two and a half times Nyquist, as speed varies within a part",
    )  # fmt: skip
    beside: int = chosen(
        12, "steps", "steps at either side that an order is held against",
        why="three orders: enough for a median, near enough to have the same noise",
    )  # fmt: skip
    stands_out: float = derived(
        20.0, "1", "power over the median beside an order from which on it is a line",
        source="of noise averaged over eight parts one in a million has four",
    )  # fmt: skip
    captures: int = chosen(
        2, "1", "captures that must have an order", why="what only one has predicts no other"
    )
    most: int = chosen(
        4, "1", "orders of one log at the most",
        why="each is another fit of the machine, and its harmonics follow the first",
    )  # fmt: skip
    whole_share: float = chosen(
        0.9, "1", "share of the best power near a whole order that the whole one needs to be it",
        why="what the machine itself does comes back after a turn",
    )  # fmt: skip
    apart: float = chosen(
        0.1, "1/turn", "distance at which two captures may find one order",
        why="less than half a step",
    )  # fmt: skip
    finer: int = chosen(
        25, "1", "orders tried on either side of a line within a step",
        why="every hundredth, finer than logs tell",
    )  # fmt: skip
    oversampled: float = chosen(
        8.0, "1", "orders tried for every one that several logs together resolve",
        why="no peak is missed between two of them",
    )  # fmt: skip
