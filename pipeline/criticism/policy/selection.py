"""Constants of judgement of `selection`: which effects are tried, named, kept and reported."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Score test, stepwise search, pruning, alternatives, truncation, drift and far starts."""

    tie: float = chosen(
        12.0,
        unit="−2 log L",
        meaning="difference of deviance below which captures do not discriminate two explanations",
        why="3.5 standard deviations of one parameter, passed by chance one time in 2,000",
    )
    least_share: float = chosen(
        0.1,
        unit="1",
        meaning="share of what is over the noise floor that an effect must take to be named",
        why="what takes less leaves the cause of nearly all of it open",
    )
    excess: float = chosen(
        30.0,
        unit="−2 log L",
        meaning="excess over the noise floor that counts",
        why="two and a half ties: below it any form that is a little wrong takes a share",
    )
    excess_a_sample: float = chosen(
        0.5,
        unit="−2 log L a weak sample",
        meaning="excess over the noise floor that counts where there are few samples",
        why="χ²/n of 1.65 in every sample",
    )
    clears_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of the power that would be a remainder that may stay where an effect "
        "matters at any size",
        why="most of it goes",
    )
    quick_starts: tuple[float, ...] = chosen(
        (1.0,),
        unit="1",
        meaning="exponents of the weights that a quick score begins with",
        why="every candidate is scored so: the cost of the search",
    )
    quick_rounds: int = chosen(
        3, unit="1", meaning="renewals of the weights of a quick score", why="cost"
    )
    thorough_starts: tuple[float, ...] = chosen(
        (1.0, 0.0),
        unit="1",
        meaning="exponents of the weights that a thorough score begins with",
        why="1 keeps groups that the fit gave up given up, 0 takes all of them back",
    )
    thorough_rounds: int = chosen(
        20,
        unit="1",
        meaning="renewals of the weights of a thorough score at the most",
        why="a bound of the cost: most end before, by `fit.settled`",
    )
    quick_penalties: float = chosen(
        0.3,
        unit="BIC penalties",
        meaning="fall of deviance that a quick score must show for a thorough one",
        why="a quick score ends early, and is too small",
    )
    below_floor_penalties: float = chosen(
        1.5,
        unit="BIC penalties",
        meaning="evidence below the noise floor that an effect needs to be named",
        why="noise that is not white is down there too",
    )
    most_steps: int = chosen(
        6,
        unit="1",
        meaning="steps of the ladder at the most, the model asked for included",
        why="five effects: each step costs a search",
    )
    refits: int = chosen(
        3, unit="1", meaning="candidates that are refitted at a time", why="each costs a fit"
    )
    refit_rounds: int = chosen(
        2, unit="1", meaning="times that the next candidates are refitted", why="each costs fits"
    )
    close_share: float = chosen(
        0.7,
        unit="1",
        meaning="share of the best fall of deviance that a candidate needs to be refitted too",
        why="a score is to first order; each refit costs a fit",
    )
    held_out_penalties: float = chosen(
        0.5,
        unit="BIC penalties",
        meaning="fall of deviance that a candidate must show on captures held out",
        why="held out, fewer captures carry each constant",
    )
    same_hook_penalties: float = chosen(
        3.0,
        unit="BIC penalties",
        meaning="the same below the noise floor, beside an effect of the same hook",
        why="a form that is a little wrong leaves evidence of that size there",
    )
    form_error: float = chosen(
        0.05,
        unit="1",
        meaning="share of an effect of the same hook that its form may be wrong by",
        why="windage that only takes up what the formula of Stribeck friction leaves is not there",
    )
    least_u: float = chosen(
        2.0,
        unit="standard uncertainties",
        meaning="distance from zero that some amplitude of a named effect must have",
        why="95 %",
    )
    most_penalties: float = chosen(
        4.0,
        unit="BIC penalties",
        meaning="rise of deviance without an earlier effect from which on it is not refitted away",
        why="the tangent is believed where it is that clear",
    )
    floor_ratio: float = chosen(
        1.5,
        unit="1",
        meaning="ratio of some noise floor, new over old, that calls for a fit by the new ones",
        why="a floor is known to some 6 %; one that is off by half moves what is over it",
    )
    coupling_floors: float = chosen(
        20.0,
        unit="noise floors",
        meaning="miss of a torque from which on a soft coupling is fitted from a start of its own",
        why="a base that is a little wrong misses by a few; an inertia behind a soft shaft by tens",
    )
    inertia_ratio: float = chosen(
        2.0,
        unit="1",
        meaning="ratio of a fit's inertia and a rough fit's from which on a fit begins anew",
        why="a rough fit is a tenth off at most; a spoiled inertia came in tens of times",
    )
    tangent_penalties: float = chosen(
        20.0,
        unit="BIC penalties",
        meaning="rise of deviance from which on the tangent is believed that a term pays",
        why="a term costs a fit to try",
    )
    alternative_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of what an effect explains that an alternative may lose to first order",
        why="the tangent may be wrong, and each refit costs a fit",
    )
    most_alternatives: int = chosen(
        6, unit="1", meaning="alternatives that are refitted at the most", why="each costs a fit"
    )
    passed_over_share: float = chosen(
        0.1,
        unit="1",
        meaning="share of an effect's fall of deviance that one passed over may have been short of",
        why="a score is to first order",
    )
    unexplained_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of deviance and held-out power over the floor that effects may leave and "
        "still explain the captures",
        why="most of it goes",
    )
    guess_share: float = chosen(
        0.2,
        unit="1",
        meaning="share of the held-out error that a trailing step must take beside an unknown",
        why="a tenth of heat in a winding looked like skin effect",
    )
    companion_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of the amplitude that one amplitude implies for another which that must "
        "have, or captures contradict both",
        why="a form is right to far less than half",
    )
    little_share: float = chosen(
        0.01,
        unit="1",
        meaning="share of the held-out error that a further effect must take while anything is "
        "left",
        why="a hundredth is nobody's concern",
    )
    drift_size: float = chosen(
        4.0,
        unit="standard deviations of noise",
        meaning="drift of a sensor at a capture's end",
        why="larger, and slow effects pass for drift; smaller, and a drift is named as an effect",
    )
    drift_terms: int = derived(
        8,
        unit="1",
        meaning="sines that a drift is made of",
        source="they hold 97 % of a random walk's power",
    )
    drift_tests: int = chosen(
        2,
        unit="1",
        meaning="tests in whose captures a drift must show",
        why="a machine that warms up does so in its own test alone",
    )
    finer_starts: tuple[float, ...] = derived(
        (0.5**0.5, 0.5**0.25, 2.0**0.25, 2.0**0.5),
        unit="1",
        meaning="multiples of the best far start that are tried after it",
        source="far starts are an octave apart",
    )
    visible_u: float = chosen(
        3.0,
        unit="standard deviations",
        meaning="typical size of an effect from which on captures would show it",
        why="three standard deviations, as is usual for detection",
    )

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
        1.5,
        unit="1/turn",
        meaning="lowest order that is looked at",
        why="below is what a drag leaves of itself",
    )
    highest: float = chosen(
        128.0,
        unit="1/turn",
        meaning="highest order that is looked at",
        why="beyond twice the tooth count of any machine here",
    )
    step: float = derived(
        0.25,
        unit="1/turn",
        meaning="distance of the orders that are looked at",
        source="a part of four turns resolves no finer ones",
    )
    turns: float = chosen(
        4.0,
        unit="turns",
        meaning="length of a part of a log",
        why="longer parts are fewer, and noise is averaged over less of them",
    )
    least_turns: float = chosen(
        3.0, unit="turns", meaning="fewest turns of a part", why="they resolve thirds of an order"
    )
    samples: float = chosen(
        5.0,
        unit="samples a cycle",
        meaning="samples that an order must have at the mean speed",
        why="two and a half times Nyquist, as speed varies within a part",
    )
    beside: int = chosen(
        12,
        unit="steps",
        meaning="steps at either side that an order is held against",
        why="three orders: enough for a median, near enough to have the same noise",
    )
    stands_out: float = derived(
        20.0,
        unit="1",
        meaning="power over the median beside an order from which on it is a line",
        source="of noise averaged over eight parts one in a million has four",
    )
    captures: int = chosen(
        2,
        unit="1",
        meaning="captures that must have an order",
        why="what only one has predicts no other",
    )
    most: int = chosen(
        4,
        unit="1",
        meaning="orders of one log at the most",
        why="each is another fit of the machine, and its harmonics follow the first",
    )
    whole_share: float = chosen(
        0.9,
        unit="1",
        meaning="share of the best power near a whole order that the whole one needs to be it",
        why="what the machine itself does comes back after a turn",
    )
    apart: float = chosen(
        0.1,
        unit="1/turn",
        meaning="distance at which two captures may find one order",
        why="less than half a step",
    )
    finer: int = chosen(
        25,
        unit="1",
        meaning="orders tried on either side of a line within a step",
        why="every hundredth, finer than logs tell",
    )
    oversampled: float = chosen(
        8.0,
        unit="1",
        meaning="orders tried for every one that several logs together resolve",
        why="no peak is missed between two of them",
    )
