"""Constants of judgement of `discovery`: what an unknown structure depends on, and its formula."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Discovery:
    """Bases, inputs, matching pursuit, and the description of what was found."""

    near_share: float = chosen(
        0.05, "1", "share of the best input's evidence that another may be short of and do as well",
        why="at 0 noise chooses the variable, at 0.5 most inputs are named",
    )  # fmt: skip
    prior_size: float = chosen(
        1.0, "machine scales", "standard deviation of a coefficient of an input's curve",
        why="no curve is larger",
    )  # fmt: skip
    parts: int = chosen(
        12, "1", "parts that a capture without a second one is held out in",
        why="as many as drive logs are held out in",
    )  # fmt: skip
    change_captures: int = chosen(
        3, "1", "fewest captures that hold a constant which changed between some of them",
        why="of two that disagree either may be the odd one",
    )  # fmt: skip
    changed_share: float = chosen(
        0.01, "1", "change of a magnet or of friction from which on it is no sound motor",
        why="a magnet that lost 1 % of its flux is a fault",
    )  # fmt: skip
    change_windows: int = chosen(
        4, "windows", "fewest windows before and after a change within a capture",
        why="what lasts for less is an event and no other value",
    )  # fmt: skip
    friction_scales: tuple[float, ...] = chosen(
        (0.05, 5.0), "1", "shortest and longest time constant of friction that is tried, of the "
        "longest capture",
        why="what is over in a few windows is an event, what is slower is straight in them",
    )  # fmt: skip
    friction_trials: int = chosen(
        5, "1", "time constants of friction that are tried",
        why="three apart: refining goes on from there",
    )  # fmt: skip
    friction_captures: int = derived(
        2, "1", "fewest captures that tell friction over time from friction over speed",
        source="in one coast every time has one speed",
    )  # fmt: skip
    friction_u: float = chosen(
        10.0, "1", "standard uncertainty of the shares of a friction that changes with time, and "
        "of its time constant over the longest capture",
        why="any: no friction is ten times what it comes to",
    )  # fmt: skip
    friction_powers: tuple[float, ...] = chosen(
        (1.5, 2.0, 3.0, 4.0), "1", "powers of speed in a friction of any form over speed",
        why="windage and iron, of any exponent and knee",
    )  # fmt: skip
    friction_widths: tuple[float, ...] = chosen(
        (0.02, 0.05, 0.12, 0.3), "1", "widths of exponentials in it, of the highest speed",
        why="Stribeck's excess of any width, 2.4 apart",
    )  # fmt: skip
    knot_exponent: float = chosen(
        1.6, "1", "exponent that crowds the knots of a curve near zero, where friction bends most",
        why="at 1 they are even, at 3 the upper half of the range has two",
    )  # fmt: skip
    knots: int = chosen(
        8, "1", "knots of the smooth curve of one sign",
        why="fewer miss a bump, each one more costs",
    )  # fmt: skip
    hats: int = chosen(
        40, "1", "narrow hats of one sign in which formulas are fitted",
        why="wide hats round a formula off, and the cost goes with their number",
    )  # fmt: skip
    turn_hats: int = chosen(
        48, "1", "narrow hats of a turn, 7.5° each",
        why="wide hats round a formula off, and the cost goes with their number",
    )  # fmt: skip
    warm_knots_k: tuple[float, ...] = chosen(
        (-15.0, 0.0, 10.0, 20.0, 35.0, 55.0, 80.0, 110.0), "K",
        "knots of a curve of a temperature, over 25 °C",
        why="from a cold hall to a hot winding, closer where most recordings are",
    )  # fmt: skip
    orders: int = chosen(
        8, "1", "lowest orders a turn that are offered on every machine, from 1 on",
        why="eccentricity and what couplings and few poles do",
    )  # fmt: skip
    most_groups: int = chosen(
        4, "1", "groups of terms of a formula at the most",
        why="a longer formula is the curve once more, and says nothing",
    )  # fmt: skip
    least_gain: float = chosen(
        0.01, "1", "share of the whole gain that a group of terms must add",
        why="a longer formula is the curve once more, and says nothing",
    )  # fmt: skip
    refined: int = chosen(
        6, "1", "groups whose scales are refined at each step", why="each costs a search"
    )
    scales: int = chosen(
        18, "1", "trial scales of a shape, from a hundredth to twice the range",
        why="a third apart: refining goes on from there",
    )  # fmt: skip
    centres: int = chosen(
        24, "1", "places a turn at which a bump is tried", why="neighbours overlap"
    )
    widths_rad: tuple[float, ...] = chosen(
        (0.15, 0.3, 0.6, 1.2), "rad", "widths of a bump of the angle that are tried",
        why="neighbours overlap",
    )  # fmt: skip
    humps: tuple[float, ...] = chosen(
        (0.1, 0.17, 0.25, 0.33, 0.42, 0.5, 0.6, 0.7, 0.8, 0.9), "1",
        "places in its range at which a variable may have a hump",
        why="a tenth of the range apart: refining goes on from there",
    )  # fmt: skip
    hump_widths: tuple[float, ...] = chosen(
        (0.03, 0.06, 0.12, 0.25), "1", "widths of a hump as shares of the range",
        why="an octave apart: refining goes on from there",
    )  # fmt: skip
    refining_reach: float = chosen(
        1.2, "1", "logarithm of how far refining moves a scale [of an angle: rad]",
        why="four trial scales to either side",
    )  # fmt: skip
    most_rounds: int = chosen(
        12, "1", "renewals of the weights at the most while a formula is fitted",
        why="a bound of the cost: most end before, by `fit.settled`",
    )  # fmt: skip
    sure_u: float = derived(
        1.96, "standard uncertainties", "half width of the band about a reported curve",
        source="95 % of a normal distribution",
    )  # fmt: skip
    parity_share: float = chosen(
        0.1, "1", "share of its size that a curve may miss its mirror image by to be odd or even",
        why="it chooses words and nothing else",
    )  # fmt: skip
    jump_share: float = chosen(
        0.05, "1", "part of the range around zero in which parity is not judged",
        why="friction jumps there",
    )  # fmt: skip
    inside_share: float = chosen(
        0.97, "1", "part of the range up to which a maximum lies inside it",
        why="it chooses words and nothing else",
    )  # fmt: skip
    tail_share: float = chosen(
        0.1, "1", "last part of a range, in which a curve is level or still grows",
        why="it chooses words and nothing else",
    )  # fmt: skip
    level_share: float = chosen(
        0.02, "1", "change over that part, as a share, that is none",
        why="it chooses words and nothing else",
    )  # fmt: skip
    visited_share: float = chosen(
        1e-3, "1", "share of the best visited hat's size from which on a place counts as visited",
        why="a curve is not reported where captures hardly were",
    )  # fmt: skip
    bounds_factor: float = chosen(
        30.0, "1", "bounds of a parameter in the written effect, over the value found",
        why="wide enough for a user's own form",
    )  # fmt: skip
    negligible_share: float = chosen(
        0.01, "1", "negligible size of a parameter in the written effect, over the value found",
        why="a hundredth of a drag is negligible",
    )  # fmt: skip
