"""Numbers of judgement about voltages, steps and operating points."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class BackEmf:
    """When a spinning rotor's voltage is a steady speed's.

    Attributes
    ----------
    least_cycles : 1
        fewest electrical cycles of a steady stretch
        chosen: two ends and one between: fewer leave no speed beside its change
    least_share : 1
        least share of the spinning rows that steady stretches hold
        chosen: below it the speed is taken as it comes, or a whole log would be thrown away
    widened : 1
        factor by which the change of speed is widened then
        chosen: once before any change is taken
    standing_sigmas : 1
        noise of the voltage below which the rotor counts as standing
        derived: a sample in 500 million of a normal deviate
    standing_share : 1
        of the largest voltage, below which the rotor counts as standing
        chosen: at a fiftieth of the speed the signal is a fiftieth of the fastest one
    filter_level : 1
        chance of a filter of the voltage that is none
        derived: one motor in a hundred

    """

    least_cycles: int = 3
    least_share: float = 0.2
    widened: float = 5.0
    standing_sigmas: float = 6.0
    standing_share: float = 0.02
    filter_level: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """How a step on a locked rotor is read.

    Attributes
    ----------
    most_bins : 1
        groups of samples that a step is averaged to
        chosen: the time of the fit goes with it
    most_cells : 1
        cells of a voltage that no supply describes
        chosen: the time of the fit goes with it; the integral is kept
    most_edges : 1
        edges of a voltage that a supply makes
        chosen: more are an inverter's, not a bench's
    edge_reach : samples
        how far an edge may move in the fit
        chosen: a scope's channels are apart by less than that
    spike_sigmas : 1
        noise from the median of five beyond which a sample is a spike
        derived: never by chance: 1 in 10^15 of a normal deviate
    most_apart : 1
        most that saliency and iron part the inductances of one rotor
        chosen: a clock or a current in another unit is off by a thousand
    unseen_share : 1
        of a channel's scatter, below which its rounding is left out
        chosen: a tenth in quadrature is half a per cent of the scatter
    fine : 1
        steps of the integration in the first time constant after an edge
        chosen: of an L that halves, the current is off by a part in ten thousand
    slower_in : time constants
        time in which steps of the integration become e times as long
        chosen: two thirds of the steps of 16 in each of eight, and half their error of the current
    drop_knee_share : 1
        of the largest current, below which an inverter's drop fades
        chosen: a corner would break the integration; the drop is known no better there

    """

    most_bins: int = 3000
    most_cells: int = 1500
    most_edges: int = 12
    edge_reach: float = 4.0
    spike_sigmas: float = 8.0
    most_apart: float = 100.0
    unseen_share: float = 0.1
    fine: float = 24.0
    slower_in: float = 3.0
    drop_knee_share: float = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """When a dynamometer test is settled, and which of its points are alike.

    Attributes
    ----------
    whole_share : 1
        least share of a point's rows that whole turns may leave
        chosen: whole turns, or cycles, are kept where they cost no more than a fifth of the rows
    fewest_rows : rows
        of a mean before and after a step of a slow log
        derived: two means and what is between them: the least that has a middle
    step_share : 1
        of a signal's span, above which a change is a step
        derived: ten levels a side step by a twentieth of the span; less than this is ripple
    drift_share : 1
        of a signal's span that the halves of a point may differ by
        chosen: below the least step, above what a loop leaves when it has settled
    drift_sigmas : 1
        noise of the halves' means that they may differ by instead
        derived: a point in 500 million by chance
    same_speed : 1
        relative difference of speeds that share one drag
        chosen: a speed loop holds better, and drag changes by less than itself times that
    still_turn : turn
        least travel within a point of a shaft that turns
        derived: a sensor's noise makes some thousandths of a turn of a held shaft
    still_capture_turn : turn
        least travel within a capture of a shaft that turns
        derived: less averages none of the ripple
    same_angle_turn : turn
        distance of angles at which cogging is one constant
        derived: a twelfth of a cogging period of 84 a turn

    """

    whole_share: float = 0.8
    fewest_rows: int = 3
    step_share: float = 0.03
    drift_share: float = 0.02
    drift_sigmas: float = 6.0
    same_speed: float = 0.02
    still_turn: float = 0.01
    still_capture_turn: float = 0.1
    same_angle_turn: float = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class FluxPairs:
    """Which currents are alike.

    Attributes
    ----------
    same_current : 1
        of the largest current, within which two currents are alike
        derived: ten levels a side are a tenth apart; a current loop holds to a hundredth

    """

    same_current: float = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfHeating:
    """How the rise of a winding's resistance under direct current is read.

    Attributes
    ----------
    parts : 1
        parts that a plateau is cut into
        chosen: they show how the rise bends, and average the noise
    cooling_step : 1
        ratio of the cooling times that are tried, from a capture's length down
        chosen: a rise that lies between two of them is found to a fifth
    cooling_times : 1
        how many cooling times are tried beside none
        chosen: a winding that cools in less than a tenth of a capture is settled on its plateaus

    """

    parts: int = 10
    cooling_step: float = 3.0
    cooling_times: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class PolePairs:
    """When voltages at speed contradict stated pole pairs.

    Attributes
    ----------
    inductance_share : 1
        standard uncertainty of an inductance at speed against that at standstill
        chosen: iron in a small signal and eddy currents at a meter's frequency part them by a
        quarter at times
    least_own_share : 1
        part of a nuisance that no column before it holds, to count
        chosen: below it the nuisance is known by noise alone, and so would be what it is beside
    one_reading_rad : rad
        rms of two angles apart beside a slope, below which they are one reading
        chosen: an encoder of 18 bit has a step of 2e-5 rad, so that two sensors differ by more

    """

    inductance_share: float = 0.12
    least_own_share: float = 0.05
    one_reading_rad: float = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class AtSpeed:
    """An inductance by the voltage that it induces at speed.

    Attributes
    ----------
    share : 1
        its standard uncertainty beside scatter and gains
        calibrated: ``flux_slope` over the pole pairs, against the truth` on 138 drive logs of four
        foreign simulators with a scatter below 3 %, most with a hidden effect: 2.6 % rms, 95 %
        within 5.9 %, the largest 12 %
    behind_s2 : s²
        angle by which a drive's frame is behind, over the acceleration of the shaft
        chosen: the criticism's `priors.bend_angle_s2`: one over the square of a loop's bandwidth
    most_scatter : 1
        largest scatter of an inductance that is published
        chosen: beyond it other effects of a log decide it
    unmodelled : 1
        of the q voltage, rms, that unmodelled effects make in step with the d current at speed;
        over the share that L_d alone explains it is a relative uncertainty
        calibrated: ``flux_slope` of the d axis over the pole pairs, against the truth` on 109 drive
        logs and torque maps of four foreign simulators with a scatter below 5 %, most with a hidden
        effect: errors are 1.9 % rms, 95 % within 4.2 %, the largest 11 %; with `share` beside it
        the largest error is 1.3 standard uncertainties
    most_unmodelled : 1
        largest such relative uncertainty of a d inductance that is published
        chosen: logs whose d current hardly moves were wrong by factors with a small scatter; the
        one nearest to this limit has 26 %

    """

    share: float = 0.04
    behind_s2: float = 1e-6
    most_scatter: float = 0.05
    unmodelled: float = 0.001
    most_unmodelled: float = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class MeterTable:
    """When an LCR meter's table over angle parts the axes.

    Attributes
    ----------
    most_condition : 1
        condition number beyond which the angles do not part the swing
        chosen: errors of mean and swing would be twenty times the readings'
    exchanged_deg : deg
        offset of the angle beyond which the axes may be exchanged
        chosen: at 45 degrees d and q change places

    """

    most_condition: float = 20.0
    exchanged_deg: float = 35.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Inverter:
    """What an inverter does to a drive's voltage.

    Attributes
    ----------
    shortest_window_s : s
        shortest window of the weak form of the voltage
        chosen: some periods of a current loop
    longest_window_s : s
        longest window of the weak form of the voltage
        chosen: a slower log's are as long as ten of its samples
    latest_periods : samples
        latest that a drive's voltage is against its angle
        derived: a period of computing and half a one of holding (Bae and Sul, IEEE Trans. Ind.
        Appl. 39(3), 2003); the row of its log may be another half
    conduction_share : 1
        standard uncertainty of the drop of switches and leads at the top current, of the link
        chosen: an inverter that loses 1 or 2 % loses about half of it in them: some milliohm of a
        drive of 24 V and 12 A; no capture parts them from the winding
    most_drop : 1
        drop of an inverter's phase that its dead time makes, at most, of the link
        chosen: 2 us of a period of 50 us; a fit that gives more has mistaken a resistance for it
    free_share : 1
        share of a drive's current that its motion leaves open on a free shaft, at most
        chosen: seven free drives of three simulators left 0.002 to 0.056, three drives under a load
        0.52 to 0.79
    least_apart_rows : rows
        distance of currents from the motion that they make, to be in a note
        chosen: less is in the uncertainty as well, and no reader would act on it
    slower_share : sample periods
        PWM period below which a log is slower than the PWM
        chosen: a log of every second period is at a half, one of every period at 1
    held_turn_rad : rad
        electrical turn beyond which no voltage vector is held for a sample
        derived: six vectors a turn, the fewest of any inverter (six-step)

    """

    shortest_window_s: float = 0.03
    longest_window_s: float = 0.1
    latest_periods: float = 2.0
    conduction_share: float = 0.0025
    most_drop: float = 0.04
    free_share: float = 0.1
    least_apart_rows: float = 0.1
    slower_share: float = 0.75
    held_turn_rad: float = 1.0472


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned:
    """What torque shows of a current's delay.

    Attributes
    ----------
    least_d_share : 1
        of the span of the q current that is the least of twice a d current's size to count
        chosen: below it reluctance torque is lost in saturation of the q current's

    """

    least_d_share: float = 0.1
