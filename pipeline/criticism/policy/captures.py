"""Constants of judgement of how captures are cut into segments."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.records.policy import calibrated, chosen, derived

COST = "a bound of the cost, which goes with them"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """Clocks, windows of logs, orders, and what a shaft's motion is made of."""

    window_s: float = chosen(
        0.02, "s", "length of a weak window", why="5 ms bias J, 80 ms and more blur what moves"
    )
    window_samples: int = chosen(
        40, "samples", "fewest samples of a window", why="a bump of fewer is none"
    )
    least_window: int = derived(
        8, "samples", "samples of a window of a short capture at the least",
        source="its test function vanishes at both ends",
    )  # fmt: skip
    step_window_s: float = chosen(
        0.002, "s", "length of a window of a current step",
        why="short: all that it shows is over after a few L/R",
    )  # fmt: skip
    windows: int = chosen(48, "windows", "windows of a capture at the most", why=COST)
    windows_drive: int = chosen(
        32, "windows", "windows of a drive's log at the most",
        why=f"{COST}; a programme has several logs",
    )  # fmt: skip
    windows_motion: int = chosen(
        160, "windows", "windows of a shaft's motion at the most", why=COST
    )
    motion_pad: int = derived(
        8, "samples", "samples kept at either side of a window of a shaft's motion at least",
        source="the angle's second difference, and a mean of its speed, need a few",
    )  # fmt: skip
    rough_windows: int = chosen(
        12, "windows", "windows of a segment in a rough fit",
        why="enough to meet a sound J to a tenth",
    )  # fmt: skip
    temperature_s: float = chosen(
        0.05, "s", "half of the time that a temperature is averaged over",
        why="windings warm in seconds",
    )  # fmt: skip
    speed_s: float = chosen(
        0.002, "s",
        "length of the mean that makes a speed, or the turn during a delay, of an angle",
        why="shorter, and the encoder's rounding is in drags and currents; longer, and a step of "
        "the speed is blurred",
    )  # fmt: skip
    voltage_orders: int = chosen(
        12, "1", "electrical orders that the angle of a voltage leaves to the voltage",
        why="those of back-EMF and of errors of the meter; motion has all others",
    )  # fmt: skip
    wave_samples: float = derived(
        5.0, "samples a cycle", "of a wave of an open winding's voltage that is examined",
        source="differences of eighth order miss a hundredth of the slope there",
    )  # fmt: skip
    reversal_u: float = chosen(
        6.0, "standard deviations of noise", "angle that a shaft must turn back by for a reversal",
        why="noise alone comes to five in a log of 1e6 samples",
    )  # fmt: skip
    motion_u: float = derived(
        2.0, "standard deviations of noise",
        "scatter of an angle about its parabola from which on the shaft itself moves",
        source="a rounding error is √3 of its standard deviation at the most",
    )  # fmt: skip
    narrowest: int = derived(
        5, "samples", "samples of the shortest parabola",
        source="the shortest that leaves less noise than there is",
    )  # fmt: skip
    jump_share: float = chosen(
        0.03, "1", "of the highest speed, by which a speed that jumps changes from row to row",
        why="what drove the shaft there is in no row; of one pump's log at 20 Hz, J was 42 % too "
        "small at 0.1 and is withheld at 0.03",
    )  # fmt: skip
    jump_times: float = derived(
        10.0, "1", "of the usual change of speed from row to row, below which one is no jump",
        source="the largest of 10,000 of a normal distribution are six times the median",
    )  # fmt: skip
    jump_rows: int = chosen(
        3, "rows", "rows beside a jump of the speed that are left out with it",
        why="of a loop of two rows' time constant, which settles there, current_delay was named "
        "with one row and with none left out",
    )  # fmt: skip
    least_wave: float = chosen(
        0.125, "waves", "part of a wave of the angle that a capture goes through for it to be one",
        why="a parabola leaves 3 per cent of that, and of less soon nothing",
    )  # fmt: skip
    held_s: float = chosen(
        1.0, "s", "time in which a speed that is held scatters no more than its noise, at the most",
        why="a level of a map is held for some seconds",
    )  # fmt: skip
    held_rows: int = chosen(
        8, "rows", "rows of that time, at the least", why="a mean of fewer shows no change"
    )
    change_u: float = chosen(
        8.0, "standard deviations of noise",
        "change of a terminal's voltage or current from which on it is a step",
        why="white noise comes to 6 in a log of 1e5 samples",
    )  # fmt: skip
    play_share: float = chosen(
        0.25, "1", "half of the play by which the past of a torque goes, of its largest size",
        why="loops of half of the range are seen, and steps of noise are not",
    )  # fmt: skip
    turning_rad: float = chosen(
        0.1, "rad", "travel of a shaft from which on it turns",
        why="a held shaft twists and its encoder is rounded by less",
    )  # fmt: skip
    slowest_share: float = chosen(
        0.01, "1", "of the highest speed, below which a shaft without a current on record may rest",
        why="as `shaft_rows.slowest_share` of the estimators, for the same logs",
    )  # fmt: skip
    driven_share: float = chosen(
        0.05, "1", "share of a coast from which on the time before it counts as driven",
        why="the moment of letting go is shorter",
    )  # fmt: skip
    rest_sigmas: float = derived(
        4.0, "σ of the angle", "from its place of rest, within which a shaft stands",
        source="one row in 16,000 of white noise; half an encoder's step is 1.7 of its rounding's",
    )  # fmt: skip
    steady_share: float = chosen(
        2e-3, "1", "change of speed within a window of an open-circuit spin that is none",
        why="a sample at a kink of the speed belongs to neither side of it",
    )  # fmt: skip
    steady_windows: int = chosen(
        8, "windows", "steady windows that are enough", why="fewer, and all count"
    )
    slow_samples: int = chosen(
        24, "samples", "samples of a slow turn that a wave of its highest order is averaged to",
        why="averages of a 24th take 0.3 % of a wave away",
    )  # fmt: skip
    clock_scatter: float = chosen(
        0.5, "periods", "scatter of stamps from which on a stamp does not number its sample",
        why="at half a period it may be its neighbour's",
    )  # fmt: skip
    clock_missing: float = chosen(
        1.6, "periods", "distance of two stamps from which on a sample may be missing between them",
        why="at 1 the scatter alone passes for missing samples, at 2 it hides half of them",
    )  # fmt: skip
    clock_ratio: float = chosen(
        2.0, "1", "ratio of roughnesses from which on samples came unevenly, and not only stamps",
        why="at 1 noise decides",
    )  # fmt: skip
    clock_even: float = chosen(
        1e-3, "periods", "scatter of a clock that is taken as even", why="a stamp's own digits"
    )
    clock_gap: float = chosen(
        1.5, "periods", "distance of two samples that nothing is interpolated across",
        why="one sample is missing there",
    )  # fmt: skip
    encoder_share: float = chosen(
        0.02, "1", "share by which two logs may differ on the encoder's step",
        why="the next encoder has half of it or twice",
    )  # fmt: skip
    highest_order: int = chosen(
        400, "1/turn", "highest order that a slow turn or a held rotor is searched for",
        why="slots and poles that meet more often cog next to nothing together",
    )  # fmt: skip
    harmonics: int = chosen(
        3, "1", "harmonics of the cogging order that are searched for", why="the next are smaller"
    )
    slower_share: float = chosen(
        0.75, "sample periods", "PWM period below which a log is slower than the PWM",
        why="a log of every second period is at a half, one of every period at 1",
    )  # fmt: skip
    held_turn_rad: float = derived(
        math.pi / 3.0, "rad", "electrical turn beyond which no voltage vector is held for a sample",
        source="six vectors a turn, the fewest of any inverter (six-step)",
    )  # fmt: skip
    saliency: float = chosen(
        5.0, "1", "ratio of the inductances at the most, in the ripple of the current",
        why="machines with magnets have less; of an axis without current it may come out near 0",
    )  # fmt: skip
    slowest_pwm_s: float = chosen(
        5e-4, "s", "longest PWM period of an inverter", why="large machines are switched at 2 kHz"
    )
    unstated_pwm_s: float = chosen(
        1e-4, "s", "PWM period of a log that is slower than a PWM that it does not state",
        why="drives of motors switch at 8 to 40 kHz; without one, eight of thirteen sound logs of "
        "a foreign bench had a delay as a name or were unknown",
    )  # fmt: skip
    one_zero_rad: float = chosen(
        0.3, "rad", "electrical angle between the zeros of a bench's encoder in two spins, beyond "
        "which it was switched on anew",
        why="a filter of 0.1 ms lags so at 3,000 rad/s; of zeros by chance a tenth are nearer",
    )  # fmt: skip
    instant_rad: float = chosen(
        0.2, "rad", "turn of the highest order in a coasting sample that is as good as an instant",
        why="its mean is off by 0.2 %",
    )  # fmt: skip
    least_parts: int = chosen(
        8, "1", "parts that a longer sample is averaged over at least",
        why="the steps that stand for the triangle are wrong by a third of a percent at most",
    )  # fmt: skip
    part_rad: float = chosen(3.0, "rad", "turn of the highest order in one part", why="half a wave")
    setup_share: float = chosen(
        0.2, "1", "difference of two files' decelerations, of their mean, above which they are of "
        "two set-ups",
        why="as the estimators have it: grease changes a coast by a tenth, a chain by more",
    )  # fmt: skip
    setup_top: float = chosen(
        0.95, "1", "of the lower top speed of two coasts, from which on they are compared",
        why="as the estimators have it: the first moments are of the driven shaft too",
    )  # fmt: skip
    setup_least: float = chosen(
        0.2, "1", "of the speed that two coasts have to have in common",
        why="as the estimators have it: the noise of a smoothed speed is a hundredth of that",
    )  # fmt: skip
    coast_parts: int = chosen(48, "1", "parts of a coasting shaft's sample at the most", why=COST)
    mean_points: int = chosen(
        8, "1", "points of a sample that a logged voltage is the mean of at the most", why=COST
    )
    log_parts: int = chosen(6, "1", "parts of a log's sample at the most", why=COST)
    load_window_s: float = calibrated(
        0.04, "s", "window in which a shaft's acceleration is held against its current",
        by="windows of 20 to 160 ms",
        on="free and loaded drives of three benches: at 20 ms a host's jitter looks like a load",
    )  # fmt: skip
    rest_rad: float = chosen(
        2e-3, "rad", "angle within which a shaft rests",
        why="bristles bend by a milliradian to either side",
    )  # fmt: skip
    load_samples: int = derived(
        12, "samples", "samples of such a window at the least", source="nine make a window"
    )
    unexplained_share: float = calibrated(
        0.02, "1",
        "power of the acceleration that follows neither current nor drags, over what the current "
        "makes, from which on something unrecorded turns the shaft",
        by="windows of 20 to 160 ms",
        on="free shafts, which leave 0.002 at most, and loads of a third of rated torque, which "
        "leave 0.09 to 2",
    )  # fmt: skip
    spring_shares: tuple[float, float] = derived(
        (0.03, 0.95), "1", "shares of the inertia behind a spring between which it is one",
        source="the negligible size and the bound of `compliance`",
    )  # fmt: skip
    load_windows: int = derived(
        2, "windows", "windows a column of that regression at the least",
        source="of two, one shares no sample with another",
    )  # fmt: skip
    load_rounding: float = derived(
        1e-9, "1", "share of the largest column below which one is rounding",
        source="squares of doubles end at 1e-16",
    )  # fmt: skip
    averaged_out: float = chosen(
        0.05, "1", "mean size of a wave's window means below which it does not matter there",
        why="it turns too often in a window",
    )  # fmt: skip
    drag_knots: tuple[float, ...] = chosen(
        (0.0, 0.01, 0.03, 0.06, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.78, 1.0),
        "highest speeds", "speeds between which drag is straight there",
        why="denser where friction bends",
    )  # fmt: skip
    audible_u: float = derived(
        20.0, "standard deviations of noise",
        "open-circuit voltage below which its own angle is not known",
        source="noise turns it by a twentieth of a radian",
    )  # fmt: skip
    angle_rounds: int = chosen(
        2, "1", "times that an angle error is looked up at the angle it gives",
        why="each round leaves of the error its own size times its order a turn",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Tables:
    """Tables without a clock: their levels and what they are known to; currents that hold."""

    lcr_hz: float = chosen(
        1000.0, "Hz", "frequency of an LCR meter that is not recorded",
        why="what bench meters begin with",
    )  # fmt: skip
    levels: int = chosen(
        4, "levels", "levels of current from which on they are held out one by one",
        why="the others show a curve, its slope and scatter",
    )  # fmt: skip
    level_rows: int = derived(
        3, "samples", "rows a level on the average",
        source="two make a straight line, a third its scatter",
    )  # fmt: skip
    level_widths: float = chosen(
        2.0, "1", "widths of the widest level that levels must be apart",
        why="at 1 noise parts a level",
    )  # fmt: skip
    parts: int = chosen(
        12, "1", "parts that a sweep of current is held out in",
        why="fewer leave little to fit, more are like their neighbours",
    )  # fmt: skip
    reading: float = chosen(
        1e-4, "1", "noise of a column at the least, of its largest reading",
        why="a few rows may lie on their curve exactly; a meter may read the same at every angle",
    )  # fmt: skip
    steady_reading: float = chosen(
        1e-5, "1", "the same of voltages at steady speeds", why="straight lines may fit exactly"
    )
    flux_share: float = chosen(
        1e-3, "1", "noise of a column of a flux map, of its range",
        why="a table does not state its own; such tables are good to 0.1 %",
    )  # fmt: skip
    other_axis: float = chosen(
        0.1, "1", "range of an axis of a flux map at the least, of the other axis's",
        why="an axis that stands still has none, and one instrument reads both",
    )  # fmt: skip
    cells: int = chosen(
        1024, "1/turn", "cells of angle that a holding current is averaged in",
        why="twelve a wave of the highest cogging orders of small machines (84), and still a few "
        "rows each of a log of some thousand holds",
    )  # fmt: skip
    sectors: int = chosen(
        24, "1/turn", "parts of a turn that are held out one by one, and fewest cells of a table",
        why="fewer leave little to fit, more are like their neighbours",
    )  # fmt: skip
    cell_rows: int = chosen(
        4, "samples", "rows that a cell must have for their scatter about a line to count",
        why="two make a line",
    )  # fmt: skip
    cell_share: float = chosen(
        0.5, "1", "share of the cells that must have them",
        why="where a pass turns round, and the rotor stays, it scatters otherwise than elsewhere",
    )  # fmt: skip
    rest_share: float = calibrated(
        0.3, "1", "friction of a rotor that a current holds over that of one that turns, less one",
        by="holds with 0.5, 0.8 and 1.3 of running friction, simulated, and with 0.8 to 1.2 of a "
        "foreign bench",
        on="four sound motors, of which none has a name; with 1/√3, as of anything up to twice as "
        "much, a holding current no longer shows friction over flux",
    )  # fmt: skip
    orders: int = chosen(12, "1", "orders of a holding current at the most", why=COST)
    order_u: float = chosen(
        3.0, "standard errors", "mean gain of the sectors by which an order must predict them",
        why="at 2, chance brings in one of some dozens that are offered",
    )  # fmt: skip
    order_sectors: int = chosen(
        6, "1", "fewest sectors by which orders are found", why="their scatter is known well enough"
    )
