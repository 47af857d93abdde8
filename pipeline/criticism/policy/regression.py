"""Constants of judgement of `regression`: noise floors, goodness, what is identifiable, hum."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import calibrated, chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewton:
    """How a fit goes on and where it ends."""

    most_rounds: int = chosen(
        30,
        unit="1",
        meaning="renewals of the weights of a linear fit at the most",
        why="a bound of the cost: most end before, by `settled`",
    )
    settled: float = derived(
        0.3,
        unit="−2 log L",
        meaning="change of deviance that ends the renewals of the weights",
        source="a fortieth of `selection.tie`",
    )
    iterations: int = chosen(
        12,
        unit="1",
        meaning="steps of a fit at the most",
        why="a bound of the cost: a fit ends by itself",
    )
    halvings: int = chosen(
        3,
        unit="1",
        meaning="times that a step that does harm is shortened",
        why="a bound of the cost: a fit ends by itself",
    )
    shortening: float = chosen(
        0.3,
        unit="1",
        meaning="share of a step that does harm that is tried next",
        why="three of them come to a fortieth",
    )
    converged: float = derived(
        1.0,
        unit="−2 log L",
        meaning="fall of deviance that is not worth a step",
        source="a twelfth of `selection.tie`",
    )
    kept_share: float = chosen(
        0.9,
        unit="1",
        meaning="share of its promise that a step must keep for its columns to stay",
        why="at 1 columns are made anew at every step; much lower, and stale ones gain little",
    )
    pinned: float = chosen(
        1e-3,
        unit="1",
        meaning="share of its standard uncertainty by which a stated constant may move at first",
        why="all but fixed, until the other constants have left their orders of magnitude",
    )
    contradicted: float = derived(
        2.5758,
        unit="standard uncertainties",
        meaning="difference beyond which captures contradict a stated constant",
        source="the 99 % interval of a normal distribution",
    )
    least_reach: float = chosen(
        0.1,
        unit="machine scales",
        meaning="reach of a step of a constant at the least",
        why="a constant that a rough fit left at nothing comes back (viscous friction did not)",
    )
    effect_reach: float = chosen(
        3.0,
        unit="1",
        meaning="reach of a step of an amplitude, over its value or typical size",
        why="effects are found at any size, and a tangent is good for a few of them",
    )
    short_programme: int = chosen(
        8,
        unit="segments",
        meaning="programme that is begun from either side as well, at the most",
        why="two fits more, which a long programme does not need",
    )
    silent: float = chosen(
        1e4,
        unit="noise floors",
        meaning="what an equation counts with while it is set aside",
        why="it says nothing, and keeps constants that it alone knows",
    )
    stale_share: float = chosen(
        0.05,
        unit="1",
        meaning="share of itself that a constant or an effect's parameter may move by before "
        "columns are computed anew",
        why="a stale column costs steps and no accuracy",
    )
    least_inertia: float = chosen(
        1e-3,
        unit="machine scales",
        meaning="least inertia",
        why="far below any motor's; at zero a coasting shaft's equation divides by nothing",
    )
    walk_factor: float = chosen(
        2.0,
        unit="1",
        meaning="factor by which parameters are moved along a direction without information",
        why="everything in it is doubled or halved, or moves by as much of its size",
    )
    walk_rise: float = chosen(
        1.0,
        unit="−2 log L",
        meaning="change of deviance on such a walk that is still none",
        why="a quarter of what two standard uncertainties make",
    )
    least_information: float = chosen(
        1e-3,
        unit="1",
        meaning="information over that of a prior below which rounding may have made it",
        why="far above rounding, far below what would identify a parameter",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFloors:
    """What no model of a bench gets right to: noise, reading errors, offsets, form."""

    replicates: int = chosen(
        2, unit="1", meaning="times that noise is added at the least", why="cost"
    )
    pooled: int = chosen(
        128,
        unit="weak samples",
        meaning="weak samples of a group that a floor is pooled over",
        why="a floor is known to 6 %, the root of 1/(2·128); more cost time",
    )
    shifts: int = chosen(
        16,
        unit="1",
        meaning="shifts at which a coarse signal is rounded anew, at the least",
        why="all its rounding can do depends on the shift",
    )
    reading: float = chosen(
        5e-5,
        unit="1",
        meaning="error of a reading that no sensor is better than",
        why="smaller, and structure of no concern names effects; larger, and effects hide",
    )
    model_drive: float = chosen(
        1e-4,
        unit="machine scales",
        meaning="error that no equation of a drive is better than",
        why="what happens between samples; half of the reference captures' floors are allowances",
    )
    model_bench: float = chosen(
        2e-5,
        unit="machine scales",
        meaning="error that no equation of a bench is better than",
        why="a bench has no inverter; larger, and small effects hide",
    )
    offset: float = chosen(
        0.5,
        unit="standard deviations of noise",
        meaning="prior of a sensor's offset in one capture",
        why="larger lets offsets explain a drag; with none an offset passes for an effect",
    )
    terminal_offset: float = chosen(
        2e-3,
        unit="1",
        meaning="prior of a terminal voltage's offset, as a share of its largest reading",
        why="with none, the zero of a bench's voltmeter passes for a drop",
    )
    rough: float = chosen(
        0.05,
        unit="machine scales",
        meaning="what equations may be off by in a rough fit",
        why="smaller, and equations far off are given up before the constants are near",
    )
    form: float = chosen(
        0.02,
        unit="1",
        meaning="share of what an effect does that its formula may be wrong by",
        why="smaller, and the tail of a wrong form is named as a further effect; larger, and "
        "small effects beside it are lost",
    )
    encoder_line: float = derived(
        0.03,
        unit="encoder steps",
        meaning="amplitude of a harmonic of an encoder's rounding",
        source="the tenth of a saw-tooth: 1/(10 π)",
    )
    jump: float = derived(
        8.0,
        unit="standard deviations of noise",
        meaning="bend of the voltage from which on it is a jump",
        source="white noise comes to 6 in a log of 1e5 samples",
    )
    jump_periods: float = calibrated(
        0.25,
        unit="sample periods",
        meaning="what a jump's instant is known to",
        by="python -m tests.benchmark",
        on="its twenty ties: with none seven were named wrong, with this two; 1/√12 = 0.29 for "
        "an instant that may be anywhere in between",
    )
    creep: float = chosen(
        1e-3,
        unit="machine scales",
        meaning="speed below which friction may hold the shaft",
        why="a resting shaft's recorded speed is noise of that size",
    )
    rest_s: float = chosen(
        5e-3,
        unit="s",
        meaning="time for which the speed must be that low",
        why="a reversal on the way is no rest",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """What is over its noise floor, by how much it must be, and what can be held out."""

    carried_growth: float = chosen(
        5.0,
        unit="1",
        meaning="growth of a variance without a capture from which on it carries the constant",
        why="without it the constant is known to less than half as well",
    )
    lost_share: float = chosen(
        1e-5,
        unit="1",
        meaning="share of a constant's information below which it is lost without a capture",
        why="what is left is rounding and priors",
    )
    over: float = chosen(
        1.0,
        unit="1",
        meaning="excess of χ²/n over one that is reported",
        why="a floor from the recording itself is good to a factor of two in variance",
    )
    chance: float = chosen(
        5.0,
        unit="standard deviations",
        meaning="what chance alone may pass as seldom as, one side of a normal distribution",
        why="3e-7: thousands of groups are looked at",
    )
    material: float = chosen(
        5e-4,
        unit="machine scales",
        meaning="error that matters",
        why="nobody acts on a smaller one",
    )
    material_bench: float = chosen(
        1e-2,
        unit="1",
        meaning="error that matters of a bench meter, as a share of its largest reading",
        why="nobody acts on a smaller one",
    )
    material_reading: float = chosen(
        5e-3,
        unit="1",
        meaning="error that matters of a log's voltage, as a share of its largest one",
        why="at standstill the machine's own voltage is no measure: all of it is R times current",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsHum:
    """Lines of the mains in recordings."""

    cycles: float = derived(
        8.0,
        unit="cycles",
        meaning="cycles of a line that a recording must have",
        source="bins are there at either side of it",
    )
    cycles_a_run: float = chosen(
        2.0,
        unit="cycles",
        meaning="cycles of 50 Hz that a run must hold for its own mean to be free of the line",
        why="of less, a mean takes up the line",
    )
    stands_out: float = derived(
        20.0,
        unit="1",
        meaning="power over that beside it that makes a line",
        source="of white noise, one bin in e^14 has as much",
    )
    seen: float = chosen(
        4.0,
        unit="1",
        meaning="median of that ratio over a signal's captures that makes it the signal's line",
        why="less than what proves the mains: that they are there is known by then",
    )
    captures: int = chosen(
        3,
        unit="1",
        meaning="captures that must have a line",
        why="what one or two tests are like there is their own",
    )
    speed_share: float = chosen(
        0.03,
        unit="1",
        meaning="share of its mean that a speed may vary by while orders of the turn are lines",
        why="beyond it an order is smeared over many bins",
    )
    parts: int = chosen(
        8,
        unit="1",
        meaning="parts of a recording that a line must be alike in",
        why="of eight, chance gives one sine an eighth",
    )
    steady_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of the power of one sine that a line must have",
        why="below, its phase or size changed on the way",
    )
    largest: float = chosen(
        0.01,
        unit="machine scales",
        meaning="rms of a line at the most",
        why="more is no pick-up in a station that anybody would use",
    )
    even_share: float = chosen(
        0.02,
        unit="1",
        meaning="share that the time between two steps of a test may vary by while they make lines",
        why="beyond it the rate of the steps is smeared",
    )
    near_bins: float = chosen(
        2.0,
        unit="bins",
        meaning="distance of an order of the turn, or of a rate of steps, within which a line is "
        "not looked for",
        why="half the width of a Hann window's peak",
    )
    highest_order: float = chosen(
        100.0,
        unit="1/turn",
        meaning="highest order of the turn that may make a line",
        why="beyond any tooth count here that has a size",
    )
    samples: float = chosen(
        2.2,
        unit="samples a cycle",
        meaning="samples that a recording must have of a line",
        why="a tenth more than Nyquist",
    )
