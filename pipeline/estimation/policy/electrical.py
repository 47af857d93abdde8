"""Numbers of judgement about voltages, steps and operating points."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.records.policy import calibrated, chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class BackEmf:
    """When a spinning rotor's voltage is a steady speed's."""

    least_cycles: int = chosen(
        3, "1", "fewest electrical cycles of a steady stretch",
        why="two ends and one between: fewer leave no speed beside its change",
    )  # fmt: skip
    least_share: float = chosen(
        0.2, "1", "least share of the spinning rows that steady stretches hold",
        why="below it the speed is taken as it comes, or a whole log would be thrown away",
    )  # fmt: skip
    widened: float = chosen(
        5.0, "1", "factor by which the change of speed is widened then",
        why="once before any change is taken",
    )  # fmt: skip
    standing_sigmas: float = derived(
        6.0, "1", "noise of the voltage below which the rotor counts as standing",
        source="a sample in 500 million of a normal deviate",
    )  # fmt: skip
    standing_share: float = chosen(
        0.02, "1", "of the largest voltage, below which the rotor counts as standing",
        why="at a fiftieth of the speed the signal is a fiftieth of the fastest one",
    )  # fmt: skip
    filter_level: float = derived(
        0.01, "1", "chance of a filter of the voltage that is none", source="one motor in a hundred"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """How a step on a locked rotor is read."""

    most_bins: int = chosen(
        3000, "1", "groups of samples that a step is averaged to",
        why="the time of the fit goes with it",
    )  # fmt: skip
    most_cells: int = chosen(
        1500, "1", "cells of a voltage that no supply describes",
        why="the time of the fit goes with it; the integral is kept",
    )  # fmt: skip
    most_edges: int = chosen(
        12, "1", "edges of a voltage that a supply makes",
        why="more are an inverter's, not a bench's",
    )  # fmt: skip
    edge_reach: float = chosen(
        4.0, "samples", "how far an edge may move in the fit",
        why="a scope's channels are apart by less than that",
    )  # fmt: skip
    spike_sigmas: float = derived(
        8.0, "1", "noise from the median of five beyond which a sample is a spike",
        source="never by chance: 1 in 10^15 of a normal deviate",
    )  # fmt: skip
    most_apart: float = chosen(
        100.0, "1", "most that saliency and iron part the inductances of one rotor",
        why="a clock or a current in another unit is off by a thousand",
    )  # fmt: skip
    unseen_share: float = chosen(
        0.1, "1", "of a channel's scatter, below which its rounding is left out",
        why="a tenth in quadrature is half a per cent of the scatter",
    )  # fmt: skip
    fine: float = chosen(
        24.0, "1", "steps of the integration in the first time constant after an edge",
        why="of an L that halves, the current is off by a part in ten thousand",
    )  # fmt: skip
    slower_in: float = chosen(
        3.0, "time constants", "time in which steps of the integration become e times as long",
        why="two thirds of the steps of 16 in each of eight, and half their error of the current",
    )  # fmt: skip
    drop_knee_share: float = chosen(
        0.02, "1", "of the largest current, below which an inverter's drop fades",
        why="a corner would break the integration; the drop is known no better there",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """When a dynamometer test is settled, and which of its points are alike."""

    whole_share: float = chosen(
        0.8, "1", "least share of a point's rows that whole turns may leave",
        why="whole turns, or cycles, are kept where they cost no more than a fifth of the rows",
    )  # fmt: skip
    fewest_rows: int = derived(
        3, "rows", "of a mean before and after a step of a slow log",
        source="two means and what is between them: the least that has a middle",
    )  # fmt: skip
    step_share: float = derived(
        0.03, "1", "of a signal's span, above which a change is a step",
        source="ten levels a side step by a twentieth of the span; less than this is ripple",
    )  # fmt: skip
    drift_share: float = chosen(
        0.02, "1", "of a signal's span that the halves of a point may differ by",
        why="below the least step, above what a loop leaves when it has settled",
    )  # fmt: skip
    drift_sigmas: float = derived(
        6.0, "1", "noise of the halves' means that they may differ by instead",
        source="a point in 500 million by chance",
    )  # fmt: skip
    same_speed: float = chosen(
        0.02, "1", "relative difference of speeds that share one drag",
        why="a speed loop holds better, and drag changes by less than itself times that",
    )  # fmt: skip
    still_turn: float = derived(
        0.01, "turn", "least travel within a point of a shaft that turns",
        source="a sensor's noise makes some thousandths of a turn of a held shaft",
    )  # fmt: skip
    still_capture_turn: float = derived(
        0.1, "turn", "least travel within a capture of a shaft that turns",
        source="less averages none of the ripple",
    )  # fmt: skip
    same_angle_turn: float = derived(
        0.001, "turn", "distance of angles at which cogging is one constant",
        source="a twelfth of a cogging period of 84 a turn",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class FluxPairs:
    """Which currents are alike."""

    same_current: float = derived(
        0.03, "1", "of the largest current, within which two currents are alike",
        source="ten levels a side are a tenth apart; a current loop holds to a hundredth",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfHeating:
    """How the rise of a winding's resistance under direct current is read."""

    parts: int = chosen(
        10, "1", "parts that a plateau is cut into",
        why="they show how the rise bends, and average the noise",
    )  # fmt: skip
    cooling_step: float = chosen(
        3.0, "1", "ratio of the cooling times that are tried, from a capture's length down",
        why="a rise that lies between two of them is found to a fifth",
    )  # fmt: skip
    cooling_times: int = chosen(
        3, "1", "how many cooling times are tried beside none",
        why="a winding that cools in less than a tenth of a capture is settled on its plateaus",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class PolePairs:
    """When voltages at speed contradict stated pole pairs."""

    inductance_share: float = chosen(
        0.12, "1", "standard uncertainty of an inductance at speed against that at standstill",
        why="iron in a small signal and eddy currents at a meter's frequency part them by a "
        "quarter at times",
    )  # fmt: skip
    least_own_share: float = chosen(
        0.05, "1", "part of a nuisance that no column before it holds, to count",
        why="below it the nuisance is known by noise alone, and so would be what it is beside",
    )  # fmt: skip
    one_reading_rad: float = chosen(
        1e-5, "rad", "rms of two angles apart beside a slope, below which they are one reading",
        why="an encoder of 18 bit has a step of 2e-5 rad, so that two sensors differ by more",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class AtSpeed:
    """An inductance by the voltage that it induces at speed."""

    share: float = calibrated(
        0.04, "1", "its standard uncertainty beside scatter and gains",
        by="`flux_slope` over the pole pairs, against the truth",
        on="138 drive logs of four foreign simulators with a scatter below 3 %, most with a hidden "
        "effect: 2.6 % rms, 95 % within 5.9 %, the largest 12 %",
    )  # fmt: skip
    behind_s2: float = chosen(
        1e-6, "s²", "angle by which a drive's frame is behind, over the acceleration of the shaft",
        why="the criticism's `priors.bend_angle_s2`: one over the square of a loop's bandwidth",
    )  # fmt: skip
    most_scatter: float = chosen(
        0.05, "1", "largest scatter of an inductance that is published",
        why="beyond it other effects of a log decide it",
    )  # fmt: skip
    unmodelled: float = calibrated(
        0.001, "1", "of the q voltage, rms, that unmodelled effects make in step with the d "
        "current at speed; over the share that L_d alone explains it is a relative uncertainty",
        by="`flux_slope` of the d axis over the pole pairs, against the truth",
        on="109 drive logs and torque maps of four foreign simulators with a scatter below 5 %, "
        "most with a hidden effect: errors are 1.9 % rms, 95 % within 4.2 %, the largest 11 %; "
        "with `share` beside it the largest error is 1.3 standard uncertainties",
    )  # fmt: skip
    most_unmodelled: float = chosen(
        0.1, "1", "largest such relative uncertainty of a d inductance that is published",
        why="logs whose d current hardly moves were wrong by factors with a small scatter; the one "
        "nearest to this limit has 26 %",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class MeterTable:
    """When an LCR meter's table over angle parts the axes."""

    most_condition: float = chosen(
        20.0, "1", "condition number beyond which the angles do not part the swing",
        why="errors of mean and swing would be twenty times the readings'",
    )  # fmt: skip
    exchanged_deg: float = chosen(
        35.0, "deg", "offset of the angle beyond which the axes may be exchanged",
        why="at 45 degrees d and q change places",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Inverter:
    """What an inverter does to a drive's voltage."""

    shortest_window_s: float = chosen(
        0.03, "s", "shortest window of the weak form of the voltage",
        why="some periods of a current loop",
    )  # fmt: skip
    longest_window_s: float = chosen(
        0.1, "s", "longest window of the weak form of the voltage",
        why="a slower log's are as long as ten of its samples",
    )  # fmt: skip
    latest_periods: float = derived(
        2.0, "samples", "latest that a drive's voltage is against its angle",
        source="a period of computing and half a one of holding (Bae and Sul, IEEE Trans. Ind. "
        "Appl. 39(3), 2003); the row of its log may be another half",
    )  # fmt: skip
    conduction_share: float = chosen(
        0.0025, "1",
        "standard uncertainty of the drop of switches and leads at the top current, of the link",
        why="an inverter that loses 1 or 2 % loses about half of it in them: some milliohm of a "
        "drive of 24 V and 12 A; no capture parts them from the winding",
    )  # fmt: skip
    most_drop: float = chosen(
        0.04, "1", "drop of an inverter's phase that its dead time makes, at most, of the link",
        why="2 us of a period of 50 us; a fit that gives more has mistaken a resistance for it",
    )  # fmt: skip
    free_share: float = chosen(
        0.1, "1", "share of a drive's current that its motion leaves open on a free shaft, at most",
        why="seven free drives of three simulators left 0.002 to 0.056, three drives under a load "
        "0.52 to 0.79",
    )  # fmt: skip
    least_apart_rows: float = chosen(
        0.1, "rows", "distance of currents from the motion that they make, to be in a note",
        why="less is in the uncertainty as well, and no reader would act on it",
    )  # fmt: skip
    slower_share: float = chosen(
        0.75, "sample periods", "PWM period below which a log is slower than the PWM",
        why="a log of every second period is at a half, one of every period at 1",
    )  # fmt: skip
    held_turn_rad: float = derived(
        1.0472, "rad", "electrical turn beyond which no voltage vector is held for a sample",
        source="six vectors a turn, the fewest of any inverter (six-step)",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned:
    """What torque shows of a current's delay."""

    least_d_share: float = chosen(
        0.1, "1", "of the span of q current that the d current moves by to count",
        why="below it reluctance torque is lost in saturation of the q current's",
    )  # fmt: skip
