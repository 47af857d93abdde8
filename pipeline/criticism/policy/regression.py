"""Constants of judgement of `regression`: noise floors, goodness, what is identifiable, hum."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GaussNewton:
    """How a fit goes on and where it ends.

    Attributes
    ----------
    most_rounds : 1
        renewals of the weights of a linear fit at the most
        chosen: a bound of the cost: most end before, by `settled`
    settled : −2 log L
        change of deviance that ends the renewals of the weights
        derived: a fortieth of `selection.tie`
    iterations : 1
        steps of a fit at the most
        chosen: a bound of the cost: a fit ends by itself
    halvings : 1
        times that a step that does harm is shortened
        chosen: a bound of the cost: a fit ends by itself
    shortening : 1
        share of a step that does harm that is tried next
        chosen: three of them come to a fortieth
    converged : −2 log L
        fall of deviance that is not worth a step
        derived: a twelfth of `selection.tie`
    far_reach : 1
        reach of a far step over that of a usual one
        chosen: two orders of magnitude are what a start may be off by; without any bound, what
        captures do not know moves as well
    kept_share : 1
        share of its predicted fall that a step must reach for its columns to stay
        chosen: at 1 columns are made anew at every step; much lower, and stale ones gain little
    pinned : 1
        share of its standard uncertainty by which a stated constant may move at first
        chosen: all but fixed, until the other constants have left their orders of magnitude
    contradicted : standard uncertainties
        difference beyond which captures contradict a stated constant
        derived: the 99 % interval of a normal distribution
    least_reach : machine scales
        reach of a step of a constant at the least
        chosen: a constant that a rough fit left at nothing comes back (viscous friction did not)
    effect_reach : 1
        reach of a step of an amplitude, over its value or typical size
        chosen: effects are found at any size, and a tangent is good for a few of them
    shape_reach : 1
        reach of a step of a shape, over its value or typical size
        chosen: a step of a speed, an exponent or a delay by itself is as far as a tangent is good
        for; without one a Stribeck exponent ran to its bound and stayed there
    short_programme : segments
        programme that is begun from either side as well, at the most
        chosen: two fits more, which a long programme does not need
    silent : noise floors
        what an equation counts with while it is set aside
        chosen: it says nothing, and keeps constants that it alone knows
    stale_share : 1
        share of itself that a constant or an effect's parameter may move by before columns are
        computed anew
        chosen: a stale column costs steps and no accuracy
    inertia_step : 1
        share of the inertia beyond which a step that lowers it may be in 1/J
        chosen: the tangent in J reaches zero at twice the inertia that is sought
    least_constant : machine scales
        least inertia, and least flux of the magnet
        chosen: far below any motor's; at zero the equations of a coast and of a holding current
        divide by nothing, and a flux below zero would be a friction that drives
    walk_factor : 1
        factor by which parameters are moved along a direction without information
        chosen: everything in it is doubled or halved, or moves by as much of its size
    walk_rise : −2 log L
        change of deviance on such a walk that is still none
        chosen: a quarter of what two standard uncertainties make
    least_information : 1
        information over that of a prior below which rounding may have made it
        chosen: far above rounding, far below what would identify a parameter

    """

    most_rounds: int = 30
    settled: float = 0.3
    iterations: int = 12
    halvings: int = 3
    shortening: float = 0.3
    converged: float = 1.0
    far_reach: float = 100.0
    kept_share: float = 0.9
    pinned: float = 1e-3
    contradicted: float = 2.5758
    least_reach: float = 0.1
    effect_reach: float = 3.0
    shape_reach: float = 1.0
    short_programme: int = 8
    silent: float = 1e4
    stale_share: float = 0.05
    inertia_step: float = 0.5
    least_constant: float = 1e-3
    walk_factor: float = 2.0
    walk_rise: float = 1.0
    least_information: float = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFloors:
    """What no model of a bench gets right to: noise, reading errors, offsets, form.

    Attributes
    ----------
    replicates : 1
        times that noise is added at the least
        chosen: cost
    pooled : weak samples
        weak samples of a group that a floor is pooled over
        chosen: a floor is known to 6 %, the root of 1/(2·128); more cost time
    shifts : 1
        shifts at which a coarse signal is rounded anew, at the least
        chosen: all its rounding can do depends on the shift
    pace : steps a window
        how far off the pace of a smoothed motion may be where it is rounded anew, either way
        calibrated: `slopes of smoothed roundings over 107 samples less the true ones` on rms of
        0.0005 steps at an even pace, 0.04 where it hunts by 0.2 %, 0.1 to 0.2 where it accelerates;
        at 1 a spin of 4096 counts at an even speed left 1.3 to 1.45 noise floors
    few : 1
        times that noise and rounding are added where only a ratio is asked for
        chosen: the same noise is in both; four shifts of a rounding tell whether it matters
    unseen : 1
        variance of an angle's rounding over that of noise, to which all windows are taken to have
        the same
        chosen: it adds half a per cent to a floor, six where one window of twelve has all of it
    reading : 1
        error of a reading that no sensor is better than
        chosen: smaller, and structure of no concern names effects; larger, and effects hide
    model_drive : machine scales
        error that no equation of a drive is better than
        chosen: what happens between samples; half of the reference captures' floors are allowances
    model_bench : machine scales
        error that no equation of a bench is better than
        chosen: a bench has no inverter; larger, and small effects hide
    offset : standard deviations of noise
        prior of a sensor's offset in one capture
        chosen: larger lets offsets explain a drag; with none an offset passes for an effect
    terminal_offset : 1
        prior of a terminal voltage's offset, as a share of its largest reading
        chosen: with none, the zero of a bench's voltmeter passes for a drop
    transducer_offset : machine scales
        prior of a torque transducer's offset in one capture
        derived: the negligible size of `torque_offset`, which is what all captures share
    rough : machine scales
        what equations may be off by in a rough fit
        chosen: smaller, and equations far off are given up before the constants are near
    form : 1
        share of what an effect does that its formula may be wrong by
        chosen: smaller, and the tail of a wrong form is named as a further effect; larger, and
        small effects beside it are lost
    encoder_line : encoder steps
        amplitude of a harmonic of an encoder's rounding
        derived: the tenth of a saw-tooth: 1/(10 π)
    jump : standard deviations of noise
        bend of the voltage from which on it is a jump
        derived: white noise comes to 6 in a log of 1e5 samples
    pulses : R (T/L)² of the EMF
        mean of a pulsed current above its samples
        derived: 1/(96 √3): uniform from 0, of a log of means, to 1/96, at little voltage
    jump_periods : sample periods
        what a jump's instant is known to
        calibrated: `python -m tests.benchmark` on its twenty ties: with none seven were named
        wrong, with this two; 1/√12 = 0.29 for an instant that may be anywhere in between
    speed_periods : sample periods
        what a drive's own speed is late by
        derived: the difference of two angles is late by half a period and waits for the next row
    reversal_periods : sample periods
        what the instant of a reversal is known to
        derived: a sample's speed is the mean of the period before and the one behind
    rest_s : s
        time for which the speed must be that low
        chosen: a reversal on the way is no rest
    rest_passes : 1
        time of a rest over what the speed beside it needs to pass through zero
        chosen: a shaft that turns back at once takes one

    """

    replicates: int = 2
    pooled: int = 128
    shifts: int = 16
    pace: float = 0.2
    few: int = 4
    unseen: float = 0.01
    reading: float = 5e-5
    model_drive: float = 1e-4
    model_bench: float = 2e-5
    offset: float = 0.5
    terminal_offset: float = 2e-3
    transducer_offset: float = 5e-4
    rough: float = 0.05
    form: float = 0.02
    encoder_line: float = 0.03
    jump: float = 8.0
    pulses: float = 0.006
    jump_periods: float = 0.25
    speed_periods: float = 1.0
    reversal_periods: float = 0.5
    rest_s: float = 5e-3
    rest_passes: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """What is over its noise floor, by how much it must be, and what can be held out.

    Attributes
    ----------
    carried_growth : 1
        growth of a variance without a capture from which on it carries the constant
        chosen: without it the constant is known to less than half as well
    lost_share : 1
        share of a constant's information below which it is lost without a capture
        chosen: what is left is rounding and priors
    over : 1
        excess of χ²/n over one that is reported
        chosen: a floor from the recording itself is good to a factor of two in variance
    chance : standard deviations
        what chance alone may pass as seldom as, one side of a normal distribution
        chosen: 3e-7: thousands of groups are looked at
    material : machine scales
        error that matters
        chosen: a smaller one is negligible in use
    material_bench : 1
        error that matters of a bench meter, as a share of its largest reading
        chosen: a smaller one is negligible in use
    material_reading : 1
        error that matters of a log's voltage, as a share of its largest one
        chosen: at standstill the machine's own voltage is no measure: all of it is R times current

    """

    carried_growth: float = 5.0
    lost_share: float = 1e-5
    over: float = 1.0
    chance: float = 5.0
    material: float = 5e-4
    material_bench: float = 1e-2
    material_reading: float = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class MainsHum:
    """Lines of the mains in recordings.

    Attributes
    ----------
    cycles : cycles
        cycles of a line that a recording must have
        derived: bins are there at either side of it
    cycles_a_run : cycles
        cycles of 50 Hz that a run must hold for its own mean to be free of the line
        chosen: of less, a mean takes up the line
    stands_out : 1
        power over that beside it that makes a line
        derived: of white noise, one bin in e^14 has as much
    seen : 1
        median of that ratio over a signal's captures that makes it the signal's line
        chosen: less than what proves the mains: that they are there is known by then
    captures : 1
        captures that must have a line
        chosen: what one or two tests are like there is their own
    speed_share : 1
        share of its mean that a speed may vary by while orders of the turn are lines
        chosen: beyond it an order is smeared over many bins
    parts : 1
        parts of a recording that a line must be alike in
        chosen: of eight, chance gives one sine an eighth
    steady_share : 1
        share of the power of one sine that a line must have
        chosen: below, its phase or size changed on the way
    largest : machine scales
        rms of a line at the most
        chosen: more is no pick-up in a station that anybody would use
    even_share : 1
        share that the time between two steps of a test may vary by while they make lines
        chosen: beyond it the rate of the steps is smeared
    near_bins : bins
        distance of an order of the turn, or of a rate of steps, within which a line is not looked
        for
        chosen: half the width of a Hann window's peak
    highest_order : 1/turn
        highest order of the turn that may make a line
        chosen: beyond any tooth count here that has a size
    samples : samples a cycle
        samples that a recording must have of a line
        chosen: a tenth more than Nyquist

    """

    cycles: float = 8.0
    cycles_a_run: float = 2.0
    stands_out: float = 20.0
    seen: float = 4.0
    captures: int = 3
    speed_share: float = 0.03
    parts: int = 8
    steady_share: float = 0.5
    largest: float = 0.01
    even_share: float = 0.02
    near_bins: float = 2.0
    highest_order: float = 100.0
    samples: float = 2.2
