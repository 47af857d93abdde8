"""Constants of judgement of `discovery`: what an unknown structure depends on, and its formula."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Discovery:
    """Bases, inputs, matching pursuit, and the description of what was found.

    Attributes
    ----------
    near_share : 1
        share of the best input's evidence that another may be short of and do as well
        chosen: at 0 noise chooses the variable, at 0.5 most inputs are named
    prior_size : machine scales
        standard deviation of a coefficient of an input's curve
        chosen: no curve is larger
    parts : 1
        parts that a capture without a second one is held out in
        chosen: as many as drive logs are held out in
    change_captures : 1
        fewest captures that hold a constant which changed between some of them
        chosen: of two that disagree either may be the odd one
    changed_share : 1
        change of a magnet or of friction from which on it is no sound motor
        chosen: a magnet that lost 1 % of its flux is a fault
    change_windows : windows
        fewest windows before and after a change within a capture
        chosen: what lasts for less is an event and no other value
    friction_scales : 1
        shortest and longest time constant of friction that is tried, of the longest capture
        chosen: what is over in a few windows is an event, what is slower is straight in them
    friction_trials : 1
        time constants of friction that are tried
        chosen: three apart: refining goes on from there
    friction_captures : 1
        fewest captures that tell friction over time from friction over speed
        derived: in one coast every time has one speed
    friction_u : 1
        standard uncertainty of the shares of a friction that changes with time, and of its time
        constant over the longest capture
        chosen: any: no friction is ten times what it comes to
    friction_powers : 1
        powers of speed in a friction of any form over speed
        chosen: windage and iron, of any exponent and knee
    friction_widths : 1
        widths of exponentials in it, of the highest speed
        chosen: Stribeck's excess of any width, 2.4 apart
    knot_exponent : 1
        exponent that crowds the knots of a curve near zero, where friction bends most
        chosen: at 1 they are even, at 3 the upper half of the range has two
    knots : 1
        knots of the smooth curve of one sign
        chosen: fewer miss a bump, each one more costs
    hats : 1
        narrow hats of one sign in which formulas are fitted
        chosen: wide hats round a formula off, and the cost goes with their number
    turn_hats : 1
        narrow hats of a turn, 7.5° each
        chosen: wide hats round a formula off, and the cost goes with their number
    warm_knots_k : K
        knots of a curve of a temperature, over 25 °C
        chosen: from a cold hall to a hot winding, closer where most recordings are
    orders : 1
        lowest orders a turn that are offered on every machine, from 1 on
        chosen: eccentricity and what couplings and few poles do
    most_groups : 1
        groups of terms of a formula at the most
        chosen: a longer formula is the curve once more, and says nothing
    least_gain : 1
        share of the whole gain that a group of terms must add
        chosen: a longer formula is the curve once more, and says nothing
    refined : 1
        groups whose scales are refined at each step
        chosen: each costs a search
    scales : 1
        trial scales of a shape, from a hundredth to twice the range
        chosen: a third apart: refining goes on from there
    centres : 1
        places a turn at which a bump is tried
        chosen: neighbours overlap
    widths_rad : rad
        widths of a bump of the angle that are tried
        chosen: neighbours overlap
    humps : 1
        places in its range at which a variable may have a hump
        chosen: a tenth of the range apart: refining goes on from there
    hump_widths : 1
        widths of a hump as shares of the range
        chosen: an octave apart: refining goes on from there
    refining_reach : 1
        logarithm of how far refining moves a scale [of an angle: rad]
        chosen: four trial scales to either side
    most_rounds : 1
        renewals of the weights at the most while a formula is fitted
        chosen: a bound of the cost: most end before, by `fit.settled`
    sure_u : standard uncertainties
        half width of the band about a reported curve
        derived: 95 % of a normal distribution
    parity_share : 1
        share of its size that a curve may miss its mirror image by to be odd or even
        chosen: it chooses words and nothing else
    jump_share : 1
        part of the range around zero in which parity is not judged
        chosen: friction jumps there
    inside_share : 1
        part of the range up to which a maximum lies inside it
        chosen: it chooses words and nothing else
    tail_share : 1
        last part of a range, in which a curve is level or still grows
        chosen: it chooses words and nothing else
    level_share : 1
        change over that part, as a share, that is none
        chosen: it chooses words and nothing else
    visited_share : 1
        share of the best visited hat's size from which on a place counts as visited
        chosen: a curve is not reported where captures hardly were
    bounds_factor : 1
        bounds of a parameter in the written effect, over the value found
        chosen: wide enough for a user's own form
    negligible_share : 1
        negligible size of a parameter in the written effect, over the value found
        chosen: a hundredth of a drag is negligible

    """

    near_share: float = 0.05
    prior_size: float = 1.0
    parts: int = 12
    change_captures: int = 3
    changed_share: float = 0.01
    change_windows: int = 4
    friction_scales: tuple[float, ...] = (0.05, 5.0)
    friction_trials: int = 5
    friction_captures: int = 2
    friction_u: float = 10.0
    friction_powers: tuple[float, ...] = (1.5, 2.0, 3.0, 4.0)
    friction_widths: tuple[float, ...] = (0.02, 0.05, 0.12, 0.3)
    knot_exponent: float = 1.6
    knots: int = 8
    hats: int = 40
    turn_hats: int = 48
    warm_knots_k: tuple[float, ...] = (-15.0, 0.0, 10.0, 20.0, 35.0, 55.0, 80.0, 110.0)
    orders: int = 8
    most_groups: int = 4
    least_gain: float = 0.01
    refined: int = 6
    scales: int = 18
    centres: int = 24
    widths_rad: tuple[float, ...] = (0.15, 0.3, 0.6, 1.2)
    humps: tuple[float, ...] = (0.1, 0.17, 0.25, 0.33, 0.42, 0.5, 0.6, 0.7, 0.8, 0.9)
    hump_widths: tuple[float, ...] = (0.03, 0.06, 0.12, 0.25)
    refining_reach: float = 1.2
    most_rounds: int = 12
    sure_u: float = 1.96
    parity_share: float = 0.1
    jump_share: float = 0.05
    inside_share: float = 0.97
    tail_share: float = 0.1
    level_share: float = 0.02
    visited_share: float = 1e-3
    bounds_factor: float = 30.0
    negligible_share: float = 0.01
