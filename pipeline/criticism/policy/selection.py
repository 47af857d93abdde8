"""Constants of judgement of `selection`: which effects are tried, named, kept and reported."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Score test, stepwise search, pruning, alternatives, truncation, drift and far starts.

    Attributes
    ----------
    tie : −2 log L
        difference of deviance below which captures do not discriminate two explanations
        chosen: 3.5 standard deviations of one parameter, passed by chance one time in 2,000
    absent_size : 1
        share of the least size that matters below which an effect is not there
        chosen: what explains a remainder is then a term that is none of its amplitudes, as the mean
        of all gains of the gain of one phase
    least_share : 1
        share of what is over the noise floor that an effect must take to be named
        chosen: what takes less leaves the cause of nearly all of it open
    excess : −2 log L
        excess over the noise floor that counts
        chosen: two and a half ties: below it any form that is a little wrong takes a share
    excess_a_sample : −2 log L a weak sample
        excess over the noise floor that counts where there are few samples
        chosen: χ²/n of 1.65 in every sample
    clears_share : 1
        share of the power that would be a remainder that may stay where an effect matters at any
        size
        chosen: most of it goes
    quick_starts : 1
        exponents of the weights that a quick score begins with
        chosen: every candidate is scored so: the cost of the search
    quick_rounds : 1
        renewals of the weights of a quick score
        chosen: cost
    thorough_starts : 1
        exponents of the weights that a thorough score begins with
        chosen: 1 keeps groups that the fit gave up given up, 0 takes all of them back
    thorough_rounds : 1
        renewals of the weights of a thorough score at the most
        chosen: a bound of the cost: most end before, by `fit.settled`
    quick_penalties : BIC penalties
        fall of deviance that a quick score must show for a thorough one
        chosen: a quick score ends early, and is too small
    below_floor_penalties : BIC penalties
        evidence below the noise floor that an effect needs to be named
        chosen: noise that is not white is down there too
    most_steps : 1
        steps of the ladder at the most, the model asked for included
        chosen: five effects: each step costs a search
    refits : 1
        candidates that are refitted at a time
        chosen: each costs a fit
    refit_rounds : 1
        times that the next candidates are refitted
        chosen: each costs fits
    close_share : 1
        share of the best fall of deviance that a candidate needs to be refitted too
        chosen: a score is to first order; each refit costs a fit
    shorter_steps : 1
        parts of the step that a score predicts, from which a refit begins until one is no worse
        than the score promised to be better
        chosen: from beyond the tangent's reach ten fits went to and fro for minutes
    held_out_penalties : BIC penalties
        fall of deviance that a candidate must show on captures held out
        chosen: held out, fewer captures carry each constant
    same_hook_penalties : BIC penalties
        the same below the noise floor, beside an effect of the same hook
        chosen: a form that is a little wrong leaves evidence of that size there
    form_error : 1
        share of an effect of the same hook that its form may be wrong by
        chosen: windage that only takes up what the formula of Stribeck friction leaves is not there
    informed_share : 1
        share of the information on an effect from which on a capture shows it
        chosen: what a capture adds to a hundred times as much is nothing
    least_u : standard uncertainties
        distance from zero that some amplitude of a named effect must have
        chosen: 95 %
    most_penalties : BIC penalties
        rise of deviance without an earlier effect from which on it is not refitted away
        chosen: the tangent is believed where it is that clear
    floor_ratio : 1
        ratio of some noise floor, new over old, that calls for a fit by the new ones
        chosen: a floor is known to some 6 %; one that is off by half moves what is over it
    inertia_ratio : 1
        ratio of a fit's inertia and a rough fit's from which on a fit begins anew
        chosen: most rough fits are a tenth off; a spoiled inertia came in tens of times
    tangent_penalties : BIC penalties
        rise of deviance from which on the tangent is believed that a term pays
        chosen: a term costs a fit to try
    choice_falls : 1
        times its fall of deviance to first order that another choice may reach
        chosen: refits fell by up to 1.8 times where that mattered, and a refit costs a fit
    alternative_share : 1
        share of what an effect explains that an alternative may lose to first order
        chosen: the tangent may be wrong, and each refit costs a fit
    most_alternatives : 1
        alternatives that are refitted at the most
        chosen: each costs a fit
    passed_over_share : 1
        share of an effect's fall of deviance that one passed over may have been short of
        chosen: a score is to first order
    unexplained_share : 1
        share of deviance and of the held-out error over the floor that effects may leave and still
        explain the captures
        chosen: most of it goes
    guess_share : 1
        share of the held-out error that a further step must take while any is left
        chosen: a tenth of heat in a winding looked like skin effect
    companion_share : 1
        share of the amplitude that one amplitude implies for another which that must have, or
        captures contradict both
        chosen: a form is right to far less than half
    drift_size : standard deviations of noise
        drift of a sensor at a capture's end
        chosen: larger, and slow effects pass for drift; smaller, and a drift is named as an effect
    drift_terms : 1
        sines that a drift is made of
        derived: they hold 97 % of a random walk's power
    drift_tests : 1
        tests in whose captures a drift must show
        chosen: a machine that warms up does so in its own test alone
    finer_starts : 1
        multiples of the best far start that are tried after it
        derived: far starts are an octave apart
    visible_u : standard deviations
        typical size of an effect from which on captures would show it
        chosen: three standard deviations, as is usual for detection

    """

    tie: float = 12.0
    absent_size: float = 0.02
    least_share: float = 0.1
    excess: float = 30.0
    excess_a_sample: float = 0.5
    clears_share: float = 0.5
    quick_starts: tuple[float, ...] = (1.0,)
    quick_rounds: int = 3
    thorough_starts: tuple[float, ...] = (1.0, 0.0)
    thorough_rounds: int = 20
    quick_penalties: float = 0.3
    below_floor_penalties: float = 1.5
    most_steps: int = 6
    refits: int = 3
    refit_rounds: int = 2
    close_share: float = 0.7
    shorter_steps: tuple[float, ...] = (1.0, 0.5, 0.25, 0.125)
    held_out_penalties: float = 0.5
    same_hook_penalties: float = 3.0
    form_error: float = 0.05
    informed_share: float = 0.01
    least_u: float = 2.0
    most_penalties: float = 4.0
    floor_ratio: float = 1.5
    inertia_ratio: float = 2.0
    tangent_penalties: float = 20.0
    choice_falls: float = 2.0
    alternative_share: float = 0.5
    most_alternatives: int = 6
    passed_over_share: float = 0.1
    unexplained_share: float = 0.5
    guess_share: float = 0.2
    companion_share: float = 0.5
    drift_size: float = 4.0
    drift_terms: int = 8
    drift_tests: int = 2
    finer_starts: tuple[float, ...] = (0.5**0.5, 0.5**0.25, 2.0**0.25, 2.0**0.5)
    visible_u: float = 3.0

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
    """Orders a turn that logs have and that no equation looks at.

    Attributes
    ----------
    lowest : 1/turn
        lowest order that is looked at
        chosen: below is what a drag leaves of itself
    highest : 1/turn
        highest order that is looked at
        chosen: beyond twice the tooth count of any machine here
    step : 1/turn
        distance of the orders that are looked at
        derived: a part of four turns resolves no finer ones
    turns : turns
        length of a part of a log
        chosen: longer parts are fewer, and noise is averaged over less of them
    least_turns : turns
        fewest turns of a part
        chosen: they resolve thirds of an order
    samples : samples a cycle
        samples that an order must have at the mean speed
        chosen: two and a half times Nyquist, as speed varies within a part
    beside : steps
        steps at either side that an order is held against
        chosen: three orders: enough for a median, near enough to have the same noise
    stands_out : 1
        power over the median beside an order from which on it is a line
        derived: of noise averaged over eight parts one in a million has four
    captures : 1
        captures that must have an order
        chosen: what only one has predicts no other
    most : 1
        orders of one log at the most
        chosen: each is another fit of the machine, and its harmonics follow the first
    whole_share : 1
        share of the best power near a whole order that the whole one needs to be it
        chosen: what the machine itself does comes back after a turn
    apart : 1/turn
        distance at which two captures may find one order
        chosen: less than half a step
    finer : 1
        orders tried on either side of a line within a step
        chosen: every hundredth, finer than logs tell
    oversampled : 1
        orders tried for every one that several logs together resolve
        chosen: no peak is missed between two of them

    """

    lowest: float = 1.5
    highest: float = 128.0
    step: float = 0.25
    turns: float = 4.0
    least_turns: float = 3.0
    samples: float = 5.0
    beside: int = 12
    stands_out: float = 20.0
    captures: int = 2
    most: int = 4
    whole_share: float = 0.9
    apart: float = 0.1
    finer: int = 25
    oversampled: float = 8.0
