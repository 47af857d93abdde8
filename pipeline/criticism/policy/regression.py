"""Constants of judgement of `regression`: noise floors, goodness, what is identifiable, hum."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import calibrated, chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewton:
    """How a fit goes on and where it ends."""

    most_rounds: int = chosen(
        30, "1", "renewals of the weights of a linear fit at the most",
        why="a bound of the cost: most end before, by `settled`",
    )  # fmt: skip
    settled: float = derived(
        0.3, "−2 log L", "change of deviance that ends the renewals of the weights",
        source="a fortieth of `selection.tie`",
    )  # fmt: skip
    iterations: int = chosen(
        12, "1", "steps of a fit at the most", why="a bound of the cost: a fit ends by itself"
    )
    halvings: int = chosen(
        3, "1", "times that a step that does harm is shortened",
        why="a bound of the cost: a fit ends by itself",
    )  # fmt: skip
    shortening: float = chosen(
        0.3, "1", "share of a step that does harm that is tried next",
        why="three of them come to a fortieth",
    )  # fmt: skip
    converged: float = derived(
        1.0, "−2 log L", "fall of deviance that is not worth a step",
        source="a twelfth of `selection.tie`",
    )  # fmt: skip
    kept_share: float = chosen(
        0.9, "1", "share of its predicted fall that a step must reach for its columns to stay",
        why="at 1 columns are made anew at every step; much lower, and stale ones gain little",
    )  # fmt: skip
    pinned: float = chosen(
        1e-3, "1", "share of its standard uncertainty by which a stated constant may move at first",
        why="all but fixed, until the other constants have left their orders of magnitude",
    )  # fmt: skip
    contradicted: float = derived(
        2.5758, "standard uncertainties",
        "difference beyond which captures contradict a stated constant",
        source="the 99 % interval of a normal distribution",
    )  # fmt: skip
    least_reach: float = chosen(
        0.1, "machine scales", "reach of a step of a constant at the least",
        why="a constant that a rough fit left at nothing comes back (viscous friction did not)",
    )  # fmt: skip
    effect_reach: float = chosen(
        3.0, "1", "reach of a step of an amplitude, over its value or typical size",
        why="effects are found at any size, and a tangent is good for a few of them",
    )  # fmt: skip
    shape_reach: float = chosen(
        1.0, "1", "reach of a step of a shape, over its value or typical size",
        why="a step of a speed, an exponent or a delay by itself is as far as a tangent is good "
        "for; without one a Stribeck exponent ran to its bound and stayed there",
    )  # fmt: skip
    short_programme: int = chosen(
        8, "segments", "programme that is begun from either side as well, at the most",
        why="two fits more, which a long programme does not need",
    )  # fmt: skip
    silent: float = chosen(
        1e4, "noise floors", "what an equation counts with while it is set aside",
        why="it says nothing, and keeps constants that it alone knows",
    )  # fmt: skip
    stale_share: float = chosen(
        0.05, "1",
        "share of itself that a constant or an effect's parameter may move by before columns are "
        "computed anew",
        why="a stale column costs steps and no accuracy",
    )  # fmt: skip
    inertia_step: float = chosen(
        0.5, "1", "share of the inertia beyond which a step that lowers it may be in 1/J",
        why="the tangent in J reaches zero at twice the inertia that is sought",
    )  # fmt: skip
    least_constant: float = chosen(
        1e-3, "machine scales", "least inertia, and least flux of the magnet",
        why="far below any motor's; at zero the equations of a coast and of a holding current "
        "divide by nothing, and a flux below zero would be a friction that drives",
    )  # fmt: skip
    walk_factor: float = chosen(
        2.0, "1", "factor by which parameters are moved along a direction without information",
        why="everything in it is doubled or halved, or moves by as much of its size",
    )  # fmt: skip
    walk_rise: float = chosen(
        1.0, "−2 log L", "change of deviance on such a walk that is still none",
        why="a quarter of what two standard uncertainties make",
    )  # fmt: skip
    least_information: float = chosen(
        1e-3, "1", "information over that of a prior below which rounding may have made it",
        why="far above rounding, far below what would identify a parameter",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFloors:
    """What no model of a bench gets right to: noise, reading errors, offsets, form."""

    replicates: int = chosen(2, "1", "times that noise is added at the least", why="cost")
    pooled: int = chosen(
        128, "weak samples", "weak samples of a group that a floor is pooled over",
        why="a floor is known to 6 %, the root of 1/(2·128); more cost time",
    )  # fmt: skip
    shifts: int = chosen(
        16, "1", "shifts at which a coarse signal is rounded anew, at the least",
        why="all its rounding can do depends on the shift",
    )  # fmt: skip
    pace: float = calibrated(
        0.2, "steps a window", "how far off the pace of a smoothed motion may be where it is "
        "rounded anew, either way",
        by="slopes of smoothed roundings over 107 samples less the true ones",
        on="rms of 0.0005 steps at an even pace, 0.04 where it hunts by 0.2 %, 0.1 to 0.2 where it "
        "accelerates; at 1 a spin of 4096 counts at an even speed left 1.3 to 1.45 noise floors",
    )  # fmt: skip
    few: int = chosen(
        4, "1", "times that noise and rounding are added where only a ratio is asked for",
        why="the same noise is in both; four shifts of a rounding tell whether it matters",
    )  # fmt: skip
    unseen: float = chosen(
        0.01, "1", "variance of an angle's rounding over that of noise, to which all windows are "
        "taken to have the same",
        why="it adds half a per cent to a floor, six where one window of twelve has all of it",
    )  # fmt: skip
    reading: float = chosen(
        5e-5, "1", "error of a reading that no sensor is better than",
        why="smaller, and structure of no concern names effects; larger, and effects hide",
    )  # fmt: skip
    model_drive: float = chosen(
        1e-4, "machine scales", "error that no equation of a drive is better than",
        why="what happens between samples; half of the reference captures' floors are allowances",
    )  # fmt: skip
    model_bench: float = chosen(
        2e-5, "machine scales", "error that no equation of a bench is better than",
        why="a bench has no inverter; larger, and small effects hide",
    )  # fmt: skip
    offset: float = chosen(
        0.5, "standard deviations of noise", "prior of a sensor's offset in one capture",
        why="larger lets offsets explain a drag; with none an offset passes for an effect",
    )  # fmt: skip
    terminal_offset: float = chosen(
        2e-3, "1", "prior of a terminal voltage's offset, as a share of its largest reading",
        why="with none, the zero of a bench's voltmeter passes for a drop",
    )  # fmt: skip
    transducer_offset: float = derived(
        5e-4, "machine scales", "prior of a torque transducer's offset in one capture",
        source="the negligible size of `torque_offset`, which is what all captures share",
    )  # fmt: skip
    rough: float = chosen(
        0.05, "machine scales", "what equations may be off by in a rough fit",
        why="smaller, and equations far off are given up before the constants are near",
    )  # fmt: skip
    form: float = chosen(
        0.02, "1", "share of what an effect does that its formula may be wrong by",
        why="smaller, and the tail of a wrong form is named as a further effect; larger, and "
        "small effects beside it are lost",
    )  # fmt: skip
    encoder_line: float = derived(
        0.03, "encoder steps", "amplitude of a harmonic of an encoder's rounding",
        source="the tenth of a saw-tooth: 1/(10 π)",
    )  # fmt: skip
    jump: float = derived(
        8.0, "standard deviations of noise", "bend of the voltage from which on it is a jump",
        source="white noise comes to 6 in a log of 1e5 samples",
    )  # fmt: skip
    pulses: float = derived(
        0.006, "R (T/L)² of the EMF", "mean of a pulsed current above its samples",
        source="1/(96 √3): uniform from 0, of a log of means, to 1/96, at little voltage",
    )  # fmt: skip
    jump_periods: float = calibrated(
        0.25, "sample periods", "what a jump's instant is known to",
        by="python -m tests.benchmark",
        on="its twenty ties: with none seven were named wrong, with this two; 1/√12 = 0.29 for an "
        "instant that may be anywhere in between",
    )  # fmt: skip
    speed_periods: float = derived(
        1.0, "sample periods", "what a drive's own speed is late by",
        source="the difference of two angles is late by half a period and waits for the next row",
    )  # fmt: skip
    reversal_periods: float = derived(
        0.5, "sample periods", "what the instant of a reversal is known to",
        source="a sample's speed is the mean of the period before and the one behind",
    )  # fmt: skip
    rest_s: float = chosen(
        5e-3, "s", "time for which the speed must be that low",
        why="a reversal on the way is no rest",
    )  # fmt: skip
    rest_passes: float = chosen(
        2.0, "1", "time of a rest over what the speed beside it needs to pass through zero",
        why="a shaft that turns back at once takes one",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """What is over its noise floor, by how much it must be, and what can be held out."""

    carried_growth: float = chosen(
        5.0, "1", "growth of a variance without a capture from which on it carries the constant",
        why="without it the constant is known to less than half as well",
    )  # fmt: skip
    lost_share: float = chosen(
        1e-5, "1", "share of a constant's information below which it is lost without a capture",
        why="what is left is rounding and priors",
    )  # fmt: skip
    over: float = chosen(
        1.0, "1", "excess of χ²/n over one that is reported",
        why="a floor from the recording itself is good to a factor of two in variance",
    )  # fmt: skip
    chance: float = chosen(
        5.0, "standard deviations",
        "what chance alone may pass as seldom as, one side of a normal distribution",
        why="3e-7: thousands of groups are looked at",
    )  # fmt: skip
    material: float = chosen(
        5e-4, "machine scales", "error that matters", why="a smaller one is negligible in use"
    )
    material_bench: float = chosen(
        1e-2, "1", "error that matters of a bench meter, as a share of its largest reading",
        why="a smaller one is negligible in use",
    )  # fmt: skip
    material_reading: float = chosen(
        5e-3, "1", "error that matters of a log's voltage, as a share of its largest one",
        why="at standstill the machine's own voltage is no measure: all of it is R times current",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsHum:
    """Lines of the mains in recordings."""

    cycles: float = derived(
        8.0, "cycles", "cycles of a line that a recording must have",
        source="bins are there at either side of it",
    )  # fmt: skip
    cycles_a_run: float = chosen(
        2.0, "cycles",
        "cycles of 50 Hz that a run must hold for its own mean to be free of the line",
        why="of less, a mean takes up the line",
    )  # fmt: skip
    stands_out: float = derived(
        20.0, "1", "power over that beside it that makes a line",
        source="of white noise, one bin in e^14 has as much",
    )  # fmt: skip
    seen: float = chosen(
        4.0, "1", "median of that ratio over a signal's captures that makes it the signal's line",
        why="less than what proves the mains: that they are there is known by then",
    )  # fmt: skip
    captures: int = chosen(
        3, "1", "captures that must have a line",
        why="what one or two tests are like there is their own",
    )  # fmt: skip
    speed_share: float = chosen(
        0.03, "1", "share of its mean that a speed may vary by while orders of the turn are lines",
        why="beyond it an order is smeared over many bins",
    )  # fmt: skip
    parts: int = chosen(
        8, "1", "parts of a recording that a line must be alike in",
        why="of eight, chance gives one sine an eighth",
    )  # fmt: skip
    steady_share: float = chosen(
        0.5, "1", "share of the power of one sine that a line must have",
        why="below, its phase or size changed on the way",
    )  # fmt: skip
    largest: float = chosen(
        0.01, "machine scales", "rms of a line at the most",
        why="more is no pick-up in a station that anybody would use",
    )  # fmt: skip
    even_share: float = chosen(
        0.02, "1",
        "share that the time between two steps of a test may vary by while they make lines",
        why="beyond it the rate of the steps is smeared",
    )  # fmt: skip
    near_bins: float = chosen(
        2.0, "bins",
        "distance of an order of the turn, or of a rate of steps, within which a line is not "
        "looked for",
        why="half the width of a Hann window's peak",
    )  # fmt: skip
    highest_order: float = chosen(
        100.0, "1/turn", "highest order of the turn that may make a line",
        why="beyond any tooth count here that has a size",
    )  # fmt: skip
    samples: float = chosen(
        2.2, "samples a cycle", "samples that a recording must have of a line",
        why="a tenth more than Nyquist",
    )  # fmt: skip
