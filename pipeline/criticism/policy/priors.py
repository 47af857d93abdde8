"""Constants of judgement of what a bench usually has: standard uncertainties of nuisances."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_D_SHARE, UNLOGGED_U_K
from pipeline.records.policy import chosen, derived


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Standard uncertainties of nuisances, where the station states none of its own."""

    ripple_slope: float = chosen(
        0.3, "sample periods", "shift of the mean current", why="a third of a sample"
    )
    ripple_mean: float = derived(
        0.04, "(ω_e T_s)² ψ/L", "ripple of the current beside its centre, 0.02",
        source="from −1/24 to 1/12, as the log samples between two changes of voltage or at them",
    )  # fmt: skip
    ripple_edge: float = derived(
        0.08, "(ω_e T_s)² of the voltage", "what a mean of the voltage misses",
        source="1/12, of a log that samples at the changes of the voltage",
    )  # fmt: skip
    ripple_shift: float = chosen(
        0.15, "T_s dω_e/dt ψ", "angle against voltage", why="a sixth of a sample"
    )
    frame_lag_s: float = chosen(
        5e-3, "s", "lag of the speed by which a drive turns its voltage ahead",
        why="as `priors.late_speed_s`: it is the same observer",
    )  # fmt: skip
    command_lead: float = derived(
        1.5, "PWM periods", "from the command of a voltage to the middle of its hold",
        source="computed in one period and held in the next; firmware logs it at either",
    )  # fmt: skip
    ripple_torque: float = chosen(
        0.3, "sample periods", "current in the torque", why="a third of a sample"
    )
    ripple_held: float = derived(
        0.08, "(ω_e T_s)²", "ripple in a held shaft's torque", source="as `priors.ripple_edge`"
    )
    ripple_sampled: float = derived(
        0.5e-6, "s", "where a drive samples a current's pulse, from where its mean is",
        source="the estimators' `sampling_u_s`: half of a dead time, and of what filters delay",
    )  # fmt: skip
    lead_ohm: float = chosen(
        5e-3, "ohm", "least resistance of inverter and leads, which a commanded voltage holds",
        why="a few milliohm of leads and contacts, whatever the winding",
    )  # fmt: skip
    lead_share: float = derived(
        4.3e-3, "voltage over current", "resistance of an inverter's switches, where it is more",
        source="the estimators' `conduction_share`, 0.0025 of the link at the top current; a phase "
        "has 1/√3 of the link",
    )  # fmt: skip
    zero_a: float = derived(
        1e-3, "machine scales", "offset of the shunts",
        source="a step of a 12-bit converter of twice the current; what is beyond is an effect's "
        "to name",
    )  # fmt: skip
    zero_angle_rad: float = derived(
        1e-3, "rad", "electrical zero of the drive's encoder",
        source="the negligible size of `angle_offset`, which names what is beyond",
    )  # fmt: skip
    late_angle_s: float = derived(
        0.02, "sample periods", "lateness of a drive's encoder behind its current sensors",
        source="the negligible size of `current_delay`, which names what is beyond: conversions, "
        "filters and serial encoders differ by some microseconds",
    )  # fmt: skip
    bend_angle_s2: float = chosen(
        1e-6, "s²", "angle by which a drive's frame is behind, over the acceleration of the shaft",
        why="a tracking loop of second order lags by the acceleration over its bandwidth squared: "
        "1000 rad/s is a usual default",
    )  # fmt: skip
    late_torque_s: float = derived(
        0.25, "sample periods", "lag of a torque transducer",
        source="half the negligible size of `torque_lag`, which names what is well beyond two of "
        "these: amplifiers filter at 1 kHz and above",
    )  # fmt: skip
    late_speed_s: float = chosen(
        5e-3, "s", "lateness of a speed that no angle is beside",
        why="observers and filters of drives are 1 to 10 ms late",
    )  # fmt: skip
    bend_speed_s2: float = derived(
        1.25e-5, "s²", "second order of that lateness",
        source="half the square of `priors.late_speed_s`, as of a delay; an observer has half of "
        "that, a filter of first order none",
    )  # fmt: skip
    late_voltage_s: float = chosen(
        0.05, "s", "by how much motion follows a voltage late, where no current is logged",
        why="buses and filters of robots are up to 0.1 s late",
    )  # fmt: skip
    electrical_s: float = chosen(
        2e-3, "s", "L/R of a winding where no current is logged",
        why="windings of small motors have 0.1 to 5 ms",
    )  # fmt: skip
    unsampled_share: float = derived(
        10.0, "1", "change of flux within a row, as a sampled voltage shows it, over the true one",
        source="a sample before the current moves shows nothing; one at the jump of a loop that "
        "settles in a tenth of a row shows ten times the row's mean",
    )  # fmt: skip
    coast_dry_share: float = chosen(
        0.02, "1", "dry drags of coasts over those of other tests, less one",
        why="seals and bearings that ran in between repeat to some percent",
    )  # fmt: skip
    coast_viscous_share: float = derived(
        0.03, "1", "viscous drag of coasts over that of other tests, less one",
        source="a bearing that is 1 K warmer: its rolling friction goes by the 0.6th power of the "
        "viscosity (SKF, Rolling Bearings, 2018, ch. D), which falls by some 5 % a kelvin",
    )  # fmt: skip
    open_flux_share: float = derived(
        5e-4, "1", "magnet flux of open-circuit tests over that of other tests, less one",
        source="a magnet half a kelvin from where its thermometer is, at -0.1 % a kelvin",
    )  # fmt: skip
    gain: float = chosen(
        0.01, "1", "gain of a sensor or instrument", why="an instrument of class 1"
    )
    gain_clock: float = chosen(
        1e-4, "1", "gain of a clock", why="a crystal of 100 ppm, its temperature in it"
    )
    offset_temp_k: float = chosen(
        2.0, "K", "offset of a thermometer", why="a thermocouple of class 2"
    )
    unlogged_d_share: float = derived(
        UNLOGGED_D_SHARE, "1", "reluctance torque of an unlogged d current over the magnet's",
        source="a third of the current along d, its field a fifth of the magnet's, axes whose "
        "inductances differ by a third",
    )  # fmt: skip
    unlogged_k: float = chosen(
        UNLOGGED_U_K, "K",
        "winding or magnet over ambient where its temperature was not recorded, and what it rises "
        "by in a log under current",
        why="most motors on a bench lie within twice that of their surroundings",
    )  # fmt: skip
