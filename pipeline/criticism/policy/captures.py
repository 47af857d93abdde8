"""Constants of judgement of how captures are cut into segments."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """Clocks, windows of logs, orders, and what a shaft's motion is made of.

    Attributes
    ----------
    window_s : s
        length of a weak window
        chosen: 5 ms bias J, 80 ms and more blur what moves
    window_samples : samples
        fewest samples of a window
        chosen: a bump of fewer is none
    least_window : samples
        samples of a window of a short capture at the least
        derived: its test function vanishes at both ends
    step_window_s : s
        length of a window of a current step
        chosen: short: all that it shows is over after a few L/R
    windows : windows
        windows of a capture at the most
        chosen: a bound of the cost, which goes with them
    windows_drive : windows
        windows of a drive's log at the most
        chosen: a bound of the cost, which goes with them; a programme has several logs
    windows_motion : windows
        windows of a shaft's motion at the most
        chosen: a bound of the cost, which goes with them
    motion_pad : samples
        samples kept at either side of a window of a shaft's motion at least
        derived: the angle's second difference, and a mean of its speed, need a few
    rough_windows : windows
        windows of a segment in a rough fit
        chosen: enough to meet a sound J to a tenth
    temperature_s : s
        half of the time that a temperature is averaged over
        chosen: windings warm in seconds
    speed_s : s
        length of the mean that makes a speed, or the turn during a delay, of an angle
        chosen: shorter, and the encoder's rounding is in drags and currents; longer, and a step of
        the speed is blurred
    voltage_orders : 1
        electrical orders that the angle of a voltage leaves to the voltage
        chosen: those of back-EMF and of errors of the meter; motion has all others
    wave_samples : samples a cycle
        of a wave of an open winding's voltage that is examined
        derived: differences of eighth order miss a hundredth of the slope there
    reversal_u : standard deviations of noise
        angle that a shaft must turn back by for a reversal
        chosen: noise alone comes to five in a log of 1e6 samples
    motion_u : standard deviations of noise
        scatter of an angle about its parabola from which on the shaft itself moves
        derived: a rounding error is √3 of its standard deviation at the most
    narrowest : samples
        samples of the shortest parabola
        derived: the shortest that leaves less noise than there is
    jump_share : 1
        of the highest speed, by which a speed that jumps changes from row to row
        chosen: what drove the shaft there is in no row; of one pump's log at 20 Hz, J was 42 % too
        small at 0.1 and is withheld at 0.03
    jump_times : 1
        of the usual change of speed from row to row, below which one is no jump
        derived: the largest of 10,000 of a normal distribution are six times the median
    jump_rows : rows
        rows beside a jump of the speed that are left out with it
        chosen: of a loop of two rows' time constant, which settles there, current_delay was named
        with one row and with none left out
    least_wave : waves
        part of a wave of the angle that a capture goes through for it to be one
        chosen: a parabola leaves 3 per cent of that, and of less soon nothing
    held_s : s
        time in which a speed that is held scatters no more than its noise, at the most
        chosen: a level of a map is held for some seconds
    held_rows : rows
        rows of that time, at the least
        chosen: a mean of fewer shows no change
    change_u : standard deviations of noise
        change of a terminal's voltage or current from which on it is a step
        chosen: white noise comes to 6 in a log of 1e5 samples
    play_share : 1
        half of the play by which the past of a torque goes, of its largest size
        chosen: loops of half of the range are seen, and steps of noise are not
    turning_rad : rad
        travel of a shaft from which on it turns
        chosen: a held shaft twists and its encoder is rounded by less
    slowest_share : 1
        of the highest speed, below which a shaft without a current on record may rest
        chosen: as `shaft_rows.slowest_share` of the estimators, for the same logs
    driven_share : 1
        share of a coast from which on the time before it counts as driven
        chosen: the moment of letting go is shorter
    rest_sigmas : σ of the angle
        from its place of rest, within which a shaft stands
        derived: one row in 16,000 of white noise; half an encoder's step is 1.7 of its rounding's
    steady_share : 1
        change of speed within a window of an open-circuit spin that is none
        chosen: a sample at a kink of the speed belongs to neither side of it
    steady_windows : windows
        steady windows that are enough
        chosen: fewer, and all count
    slow_samples : samples
        samples of a slow turn that a wave of its highest order is averaged to
        chosen: averages of a 24th take 0.3 % of a wave away
    clock_scatter : periods
        scatter of stamps from which on a stamp does not number its sample
        chosen: at half a period it may be its neighbour's
    clock_missing : periods
        distance of two stamps from which on a sample may be missing between them
        chosen: at 1 the scatter alone passes for missing samples, at 2 it hides half of them
    clock_ratio : 1
        ratio of roughnesses from which on samples came unevenly, and not only stamps
        chosen: at 1 noise decides
    clock_even : periods
        scatter of a clock that is taken as even
        chosen: a stamp's own digits
    clock_gap : periods
        distance of two samples that nothing is interpolated across
        chosen: one sample is missing there
    attenuated : 1
        power of what an acceleration is off by at a sample of a slower torque, over its own
        derived: an inertia comes out low by that share [Fuller, Measurement Error Models, ch. 1]
    encoder_share : 1
        share by which two logs may differ on the encoder's step
        chosen: the next encoder has half of it or twice
    highest_order : 1/turn
        highest order that a slow turn or a held rotor is searched for
        chosen: slots and poles that meet more often cog next to nothing together
    harmonics : 1
        harmonics of the cogging order that are searched for
        chosen: the next are smaller
    slower_share : sample periods
        PWM period below which a log is slower than the PWM
        chosen: a log of every second period is at a half, one of every period at 1
    held_turn_rad : rad
        electrical turn beyond which no voltage vector is held for a sample
        derived: six vectors a turn, the fewest of any inverter (six-step)
    saliency : 1
        ratio of the inductances at the most, in the ripple of the current
        chosen: machines with magnets have less; of an axis without current it may come out near 0
    slowest_pwm_s : s
        longest PWM period of an inverter
        chosen: large machines are switched at 2 kHz
    unstated_pwm_s : s
        PWM period of a log that is slower than a PWM that it does not state
        chosen: drives of motors switch at 8 to 40 kHz; without one, eight of thirteen sound logs of
        a foreign bench had a delay as a name or were unknown
    one_zero_rad : rad
        electrical angle between the zeros of a bench's encoder in two spins, beyond which it was
        switched on anew
        chosen: a filter of 0.1 ms lags so at 3,000 rad/s; of zeros by chance a tenth are nearer
    instant_rad : rad
        turn of the highest order in a coasting sample that is as good as an instant
        chosen: its mean is off by 0.2 %
    least_parts : 1
        parts that a longer sample is averaged over at least
        chosen: the steps that stand for the triangle are wrong by a third of a percent at most
    part_rad : rad
        turn of the highest order in one part
        chosen: half a wave
    setup_share : 1
        difference of two files' decelerations, of their mean, above which they are of two set-ups
        chosen: as the estimators have it: grease changes a coast by a tenth, a chain by more
    setup_top : 1
        of the lower top speed of two coasts, from which on they are compared
        chosen: as the estimators have it: the first moments are of the driven shaft too
    setup_least : 1
        of the speed that two coasts have to have in common
        chosen: as the estimators have it: the noise of a smoothed speed is a hundredth of that
    coast_parts : 1
        parts of a coasting shaft's sample at the most
        chosen: a bound of the cost, which goes with them
    mean_points : 1
        points of a sample that a logged voltage is the mean of at the most
        chosen: a bound of the cost, which goes with them
    log_parts : 1
        parts of a log's sample at the most
        chosen: a bound of the cost, which goes with them
    load_window_s : s
        window in which a shaft's acceleration is held against its current
        calibrated: `windows of 20 to 160 ms` on free and loaded drives of three benches: at 20 ms a
        host's jitter looks like a load
    rest_rad : rad
        angle within which a shaft rests
        chosen: bristles bend by a milliradian to either side
    load_samples : samples
        samples of such a window at the least
        derived: nine make a window
    unexplained_share : 1
        power of the acceleration that follows neither current nor drags, over what the current
        makes, from which on something unrecorded turns the shaft
        calibrated: `windows of 20 to 160 ms` on free shafts, which leave 0.002 at most, and loads
        of a third of rated torque, which leave 0.09 to 2
    spring_shares : 1
        shares of the inertia behind a spring between which it is one
        derived: the negligible size and the bound of `compliance`
    load_windows : windows
        windows a column of that regression at the least
        derived: of two, one shares no sample with another
    load_rounding : 1
        share of the largest column below which one is rounding
        derived: squares of doubles end at 1e-16
    averaged_out : 1
        mean size of a wave's window means below which it does not matter there
        chosen: it turns too often in a window
    drag_knots : highest speeds
        speeds between which drag is straight there
        chosen: denser where friction bends
    audible_u : standard deviations of noise
        open-circuit voltage below which its own angle is not known
        derived: noise turns it by a twentieth of a radian
    angle_rounds : 1
        times that an angle error is looked up at the angle it gives
        chosen: each round leaves of the error its own size times its order a turn

    """

    window_s: float = 0.02
    window_samples: int = 40
    least_window: int = 8
    step_window_s: float = 0.002
    windows: int = 48
    windows_drive: int = 32
    windows_motion: int = 160
    motion_pad: int = 8
    rough_windows: int = 12
    temperature_s: float = 0.05
    speed_s: float = 0.002
    voltage_orders: int = 12
    wave_samples: float = 5.0
    reversal_u: float = 6.0
    motion_u: float = 2.0
    narrowest: int = 5
    jump_share: float = 0.03
    jump_times: float = 10.0
    jump_rows: int = 3
    least_wave: float = 0.125
    held_s: float = 1.0
    held_rows: int = 8
    change_u: float = 8.0
    play_share: float = 0.25
    turning_rad: float = 0.1
    slowest_share: float = 0.01
    driven_share: float = 0.05
    rest_sigmas: float = 4.0
    steady_share: float = 2e-3
    steady_windows: int = 8
    slow_samples: int = 24
    clock_scatter: float = 0.5
    clock_missing: float = 1.6
    clock_ratio: float = 2.0
    clock_even: float = 1e-3
    clock_gap: float = 1.5
    attenuated: float = 0.01
    encoder_share: float = 0.02
    highest_order: int = 400
    harmonics: int = 3
    slower_share: float = 0.75
    held_turn_rad: float = math.pi / 3.0
    saliency: float = 5.0
    slowest_pwm_s: float = 5e-4
    unstated_pwm_s: float = 1e-4
    one_zero_rad: float = 0.3
    instant_rad: float = 0.2
    least_parts: int = 8
    part_rad: float = 3.0
    setup_share: float = 0.2
    setup_top: float = 0.95
    setup_least: float = 0.2
    coast_parts: int = 48
    mean_points: int = 8
    log_parts: int = 6
    load_window_s: float = 0.04
    rest_rad: float = 2e-3
    load_samples: int = 12
    unexplained_share: float = 0.02
    spring_shares: tuple[float, float] = (0.03, 0.95)
    load_windows: int = 2
    load_rounding: float = 1e-9
    averaged_out: float = 0.05
    drag_knots: tuple[float, ...] = (
        0.0, 0.01, 0.03, 0.06, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.78, 1.0,
    )  # fmt: skip
    audible_u: float = 20.0
    angle_rounds: int = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Tables:
    """Tables without a clock: their levels and what they are known to; currents that hold.

    Attributes
    ----------
    lcr_hz : Hz
        frequency of an LCR meter that is not recorded
        chosen: what bench meters begin with
    levels : levels
        levels of current from which on they are held out one by one
        chosen: the others show a curve, its slope and scatter
    level_rows : samples
        rows a level on the average
        derived: two make a straight line, a third its scatter
    level_widths : 1
        widths of the widest level that levels must be apart
        chosen: at 1 noise parts a level
    parts : 1
        parts that a sweep of current is held out in
        chosen: fewer leave little to fit, more are like their neighbours
    reading : 1
        noise of a column at the least, of its largest reading
        chosen: a few rows may lie on their curve exactly; a meter may read the same at every angle
    steady_reading : 1
        the same of voltages at steady speeds
        chosen: straight lines may fit exactly
    flux_share : 1
        noise of a column of a flux map, of its range
        chosen: a table does not state its own; such tables are good to 0.1 %
    other_axis : 1
        range of an axis of a flux map at the least, of the other axis's
        chosen: an axis that stands still has none, and one instrument reads both
    cells : 1/turn
        cells of angle that a holding current is averaged in
        chosen: twelve a wave of the highest cogging orders of small machines (84), and still a few
        rows each of a log of some thousand holds
    sectors : 1/turn
        parts of a turn that are held out one by one, and fewest cells of a table
        chosen: fewer leave little to fit, more are like their neighbours
    cell_rows : samples
        rows that a cell must have for their scatter about a line to count
        chosen: two make a line
    cell_share : 1
        share of the cells that must have them
        chosen: where a pass turns round, and the rotor stays, it scatters otherwise than elsewhere
    rest_share : 1
        friction of a rotor that a current holds over that of one that turns, less one
        calibrated: `holds with 0.5, 0.8 and 1.3 of running friction, simulated, and with 0.8 to 1.2
        of a foreign bench` on four sound motors, of which none has a name; with 1/√3, as of
        anything up to twice as much, a holding current no longer shows friction over flux
    orders : 1
        orders of a holding current at the most
        chosen: a bound of the cost, which goes with them
    order_u : standard errors
        mean gain of the sectors by which an order must predict them
        chosen: at 2, chance brings in one of some dozens that are offered
    order_sectors : 1
        fewest sectors by which orders are found
        chosen: their scatter is known well enough
    turn_points : 1
        angles of a turn by which a row of a turning shaft's table is predicted
        chosen: what has an order of the shaft's turn is in its mean by a tenth at the most, and has
        another phase in each row

    """

    lcr_hz: float = 1000.0
    levels: int = 4
    level_rows: int = 3
    level_widths: float = 2.0
    parts: int = 12
    reading: float = 1e-4
    steady_reading: float = 1e-5
    flux_share: float = 1e-3
    other_axis: float = 0.1
    cells: int = 1024
    sectors: int = 24
    cell_rows: int = 4
    cell_share: float = 0.5
    rest_share: float = 0.3
    orders: int = 12
    order_u: float = 3.0
    order_sectors: int = 6
    turn_points: int = 16
