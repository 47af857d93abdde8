"""Constants of judgement of how captures are cut into segments, and of a model's nuisances."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.conventions import UNLOGGED_D_SHARE, UNLOGGED_U_K
from pipeline.records.policy import chosen, derived

COST = "a bound of the cost, which goes with them"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cutting:
    """Windows of logs with a clock, and what a shaft's motion is made of."""

    window_s: float = chosen(
        0.02,
        unit="s",
        meaning="length of a weak window",
        why="5 ms bias J, 80 ms and more blur what moves",
    )
    window_samples: int = chosen(
        40, unit="samples", meaning="fewest samples of a window", why="a bump of fewer is none"
    )
    least_window: int = derived(
        8,
        unit="samples",
        meaning="samples of a window of a short capture at the least",
        source="its test function vanishes at both ends",
    )
    step_window_s: float = chosen(
        0.002,
        unit="s",
        meaning="length of a window of a current step",
        why="short: all that it shows is over after a few L/R",
    )
    windows: int = chosen(48, unit="windows", meaning="windows of a capture at the most", why=COST)
    windows_drive: int = chosen(
        32,
        unit="windows",
        meaning="windows of a drive's log at the most",
        why=f"{COST}; a programme has several logs",
    )
    windows_motion: int = chosen(
        160, unit="windows", meaning="windows of a shaft's motion at the most", why=COST
    )
    rough_windows: int = chosen(
        12,
        unit="windows",
        meaning="windows of a segment in a rough fit",
        why="enough to meet a sound J to a tenth",
    )
    temperature_s: float = chosen(
        0.05,
        unit="s",
        meaning="half of the time that a temperature is averaged over",
        why="windings warm in seconds",
    )
    speed_s: float = chosen(
        0.002,
        unit="s",
        meaning="length of the mean that makes a speed, or the turn during a delay, of an angle",
        why="shorter, and the encoder's rounding is in drags and currents; longer, and a step of "
        "the speed is blurred",
    )
    reversal_u: float = chosen(
        6.0,
        unit="standard deviations of noise",
        meaning="angle that a shaft must turn back by for a reversal",
        why="noise alone comes to five in a log of 1e6 samples",
    )
    motion_u: float = derived(
        2.0,
        unit="standard deviations of noise",
        meaning="scatter of an angle about its parabola from which on the shaft itself moves",
        source="a rounding error is √3 of its standard deviation at the most",
    )
    narrowest: int = derived(
        5,
        unit="samples",
        meaning="samples of the shortest parabola",
        source="the shortest that leaves less noise than there is",
    )
    change_u: float = chosen(
        8.0,
        unit="standard deviations of noise",
        meaning="change of a terminal's voltage or current from which on it is a step",
        why="white noise comes to 6 in a log of 1e5 samples",
    )
    turning_rad: float = chosen(
        0.1,
        unit="rad",
        meaning="travel of a shaft from which on it turns",
        why="a held shaft twists and its encoder is rounded by less",
    )
    driven_share: float = chosen(
        0.05,
        unit="1",
        meaning="share of a coast from which on the time before it counts as driven",
        why="the moment of letting go is shorter",
    )
    steady_share: float = chosen(
        2e-3,
        unit="1",
        meaning="change of speed within a window of an open-circuit spin that is none",
        why="a sample at a kink of the speed belongs to neither side of it",
    )
    steady_windows: int = chosen(
        8, unit="windows", meaning="steady windows that are enough", why="fewer, and all count"
    )
    slow_samples: int = chosen(
        24,
        unit="samples",
        meaning="samples of a slow turn that a wave of its highest order is averaged to",
        why="averages of a 24th take 0.3 % of a wave away",
    )
    slower_share: float = chosen(
        0.75,
        unit="sample periods",
        meaning="PWM period below which a log is slower than the PWM",
        why="a log of every second period is at a half, one of every period at 1",
    )
    instant_rad: float = chosen(
        0.2,
        unit="rad",
        meaning="turn of the highest order in a coasting sample that is as good as an instant",
        why="its mean is off by 0.2 %",
    )
    least_parts: int = chosen(
        8,
        unit="1",
        meaning="parts that a longer sample is averaged over at least",
        why="the steps that stand for the triangle are wrong by a third of a percent at most",
    )
    part_rad: float = chosen(
        3.0, unit="rad", meaning="turn of the highest order in one part", why="half a wave"
    )
    coast_parts: int = chosen(
        48, unit="1", meaning="parts of a coasting shaft's sample at the most", why=COST
    )
    log_parts: int = chosen(6, unit="1", meaning="parts of a log's sample at the most", why=COST)
    angle_rounds: int = chosen(
        2,
        unit="1",
        meaning="times that an angle error is looked up at the angle it gives",
        why="each round leaves of the error its own size times its order a turn",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Tables:
    """Tables without a clock: their levels and what they are known to; currents that hold."""

    levels: int = chosen(
        4,
        unit="levels",
        meaning="levels of current from which on they are held out one by one",
        why="the others show a curve, its slope and scatter",
    )
    parts: int = chosen(
        12,
        unit="1",
        meaning="parts that a sweep of current is held out in",
        why="fewer leave little to fit, more are like their neighbours",
    )
    reading: float = chosen(
        1e-4,
        unit="1",
        meaning="noise of a column at the least, of its largest reading",
        why="a few rows may lie on their curve exactly; a meter may read the same at every angle",
    )
    steady_reading: float = chosen(
        1e-5,
        unit="1",
        meaning="the same of voltages at steady speeds",
        why="straight lines may fit exactly",
    )
    flux_share: float = chosen(
        1e-3,
        unit="1",
        meaning="noise of a column of a flux map, of its range",
        why="a table does not state its own; such tables are good to 0.1 %",
    )
    other_axis: float = chosen(
        0.1,
        unit="1",
        meaning="range of an axis of a flux map at the least, of the other axis's",
        why="an axis that stands still has none, and one instrument reads both",
    )
    cells: int = chosen(
        1024,
        unit="1/turn",
        meaning="cells of angle that a holding current is averaged in",
        why="twelve a wave of the highest cogging orders of small machines (84), and still a few "
        "rows each of a log of some thousand holds",
    )
    sectors: int = chosen(
        24,
        unit="1/turn",
        meaning="parts of a turn that are held out one by one, and fewest cells of a table",
        why="fewer leave little to fit, more are like their neighbours",
    )
    cell_rows: int = chosen(
        4,
        unit="samples",
        meaning="rows that a cell must have for their scatter about a line to count",
        why="two make a line",
    )
    cell_share: float = chosen(
        0.5,
        unit="1",
        meaning="share of the cells that must have them",
        why="where a pass turns round, and the rotor stays, it scatters otherwise than elsewhere",
    )
    orders: int = chosen(12, unit="1", meaning="orders of a holding current at the most", why=COST)
    order_u: float = chosen(
        3.0,
        unit="standard errors",
        meaning="mean gain of the sectors by which an order must predict them",
        why="at 2, chance brings in one of some dozens that are offered",
    )
    order_sectors: int = chosen(
        6,
        unit="1",
        meaning="fewest sectors by which orders are found",
        why="their scatter is known well enough",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Standard uncertainties of nuisances, where the station states none of its own."""

    ripple_slope: float = chosen(
        0.3, unit="sample periods", meaning="shift of the mean current", why="a third of a sample"
    )
    ripple_mean: float = derived(
        0.04,
        unit="(ω_e T_s)² ψ/L",
        meaning="ripple of the current beside its centre, 0.02",
        source="from −1/24 to 1/12, as the log samples between two changes of voltage or at them",
    )
    ripple_edge: float = derived(
        0.08,
        unit="(ω_e T_s)² of the voltage",
        meaning="what a mean of the voltage misses",
        source="1/12, of a log that samples at the changes of the voltage",
    )
    ripple_shift: float = chosen(
        0.15, unit="T_s dω_e/dt ψ", meaning="angle against voltage", why="a sixth of a sample"
    )
    ripple_torque: float = chosen(
        0.3, unit="sample periods", meaning="current in the torque", why="a third of a sample"
    )
    ripple_held: float = derived(
        0.08,
        unit="(ω_e T_s)²",
        meaning="ripple in a held shaft's torque",
        source="as `priors.ripple_edge`",
    )
    lead_share: float = chosen(
        5e-3,
        unit="1",
        meaning="resistance of inverter and leads over the phase's",
        why="a few milliohm of switches and leads beside a winding of one ohm",
    )
    zero_a: float = derived(
        5e-4,
        unit="machine scales",
        meaning="offset of the shunts",
        source="half a step of a 12-bit converter of twice the current; what is beyond is an "
        "effect's to name",
    )
    zero_angle_rad: float = derived(
        1e-3,
        unit="rad",
        meaning="electrical zero of the drive's encoder",
        source="the negligible size of `angle_offset`, which names what is beyond",
    )
    gain: float = chosen(
        0.01, unit="1", meaning="gain of a sensor or instrument", why="an instrument of class 1"
    )
    gain_clock: float = chosen(
        1e-4, unit="1", meaning="gain of a clock", why="a crystal of 100 ppm, its temperature in it"
    )
    offset_temp_k: float = chosen(
        2.0, unit="K", meaning="offset of a thermometer", why="a thermocouple of class 2"
    )
    unlogged_d_share: float = derived(
        UNLOGGED_D_SHARE,
        unit="1",
        meaning="reluctance torque of an unlogged d current over the magnet's",
        source="a third of the current along d, its field a fifth of the magnet's, axes whose "
        "inductances differ by a third",
    )
    unlogged_k: float = chosen(
        UNLOGGED_U_K,
        unit="K",
        meaning="winding or magnet over ambient where its temperature was not recorded",
        why="most motors on a bench lie within twice that of their surroundings",
    )
