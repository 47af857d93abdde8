"""Constants of judgement of what a bench usually has: standard uncertainties of nuisances."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.physics.unlogged import UNLOGGED_D_SHARE, UNLOGGED_U_K


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Standard uncertainties of nuisances, where the station states none of its own.

    Attributes
    ----------
    ripple_slope : sample periods
        shift of the mean current
        chosen: a third of a sample
    ripple_mean : (ω_e T_s)² ψ/L
        ripple of the current beside its centre, 0.02
        derived: from −1/24 to 1/12, as the log samples between two changes of voltage or at them
    ripple_edge : (ω_e T_s)² of the voltage
        what a mean of the voltage misses
        derived: 1/12, of a log that samples at the changes of the voltage
    ripple_shift : T_s dω_e/dt ψ
        angle against voltage
        chosen: a sixth of a sample
    frame_lag_s : s
        lag of the speed by which a drive turns its voltage ahead
        chosen: as `priors.late_speed_s`: it is the same observer
    command_lead : PWM periods
        from the command of a voltage to the middle of its hold
        derived: computed in one period and held in the next; firmware logs it at either
    ripple_torque : sample periods
        current in the torque
        chosen: a third of a sample
    ripple_held : (ω_e T_s)²
        ripple in a held shaft's torque
        derived: as `priors.ripple_edge`
    ripple_sampled : s
        where a drive samples a current's pulse, from where its mean is
        derived: the estimators' `sampling_u_s`: half of a dead time, and of what filters delay
    lead_ohm : ohm
        least resistance of inverter and leads, which a commanded voltage holds
        chosen: a few milliohm of leads and contacts, whatever the winding
    lead_share : voltage over current
        resistance of an inverter's switches, where it is more
        derived: the estimators' `conduction_share`, 0.0025 of the link at the top current; a phase
        has 1/√3 of the link
    zero_a : machine scales
        offset of the shunts
        derived: a step of a 12-bit converter of twice the current; what is beyond is an effect's to
        name
    zero_angle_rad : rad
        electrical zero of the drive's encoder
        derived: the negligible size of `angle_offset`, which names what is beyond
    late_angle_s : sample periods
        lateness of a drive's encoder behind its current sensors
        derived: the negligible size of `current_delay`, which names what is beyond: conversions,
        filters and serial encoders differ by some microseconds
    bend_angle_s2 : s²
        angle by which a drive's frame is behind, over the acceleration of the shaft
        chosen: a tracking loop of second order lags by the acceleration over its bandwidth squared:
        1000 rad/s is a usual default
    late_torque_s : sample periods
        lag of a torque transducer
        derived: half the negligible size of `torque_lag`, which names what is well beyond two of
        these: amplifiers filter at 1 kHz and above
    late_speed_s : s
        lateness of a speed that no angle is beside, and lag of the second order of that
        chosen: observers and filters of drives are 1 to 10 ms late
    bend_speed_s2 : s²
        second order of that lateness
        derived: half the square of `priors.late_speed_s`, as of a delay; an observer has half of
        that, a filter of first order none
    late_voltage_s : s
        by how much motion follows a voltage late, where no current is logged
        chosen: buses and filters of robots are up to 0.1 s late
    electrical_s : s
        L/R of a winding where no current is logged
        chosen: windings of small motors have 0.1 to 5 ms
    unsampled_share : 1
        change of flux within a row, as a sampled voltage shows it, over the true one
        derived: a sample before the current moves shows nothing; one at the jump of a loop that
        settles in a tenth of a row shows ten times the row's mean
    coast_dry_share : 1
        dry drags of coasts over those of other tests, less one
        chosen: seals and bearings that ran in between repeat to some percent
    coast_viscous_share : 1
        viscous drag of coasts over that of other tests, less one
        derived: a bearing that is 1 K warmer: its rolling friction goes by the 0.6th power of the
        viscosity (SKF, Rolling Bearings, 2018, ch. D), which falls by some 5 % a kelvin
    open_flux_share : 1
        magnet flux of open-circuit tests over that of other tests, less one
        derived: a magnet half a kelvin from where its thermometer is, at -0.1 % a kelvin
    gain : 1
        gain of a sensor or instrument
        chosen: an instrument of class 1
    gain_clock : 1
        gain of a clock
        chosen: a crystal of 100 ppm, its temperature in it
    offset_temp_k : K
        offset of a thermometer
        chosen: a thermocouple of class 2
    unlogged_d_share : 1
        reluctance torque of an unlogged d current over the magnet's
        derived: a third of the current along d, its field a fifth of the magnet's, axes whose
        inductances differ by a third
    unlogged_k : K
        winding or magnet over ambient where its temperature was not recorded, and what it rises by
        in a log under current
        chosen: most motors on a bench lie within twice that of their surroundings

    """

    ripple_slope: float = 0.3
    ripple_mean: float = 0.04
    ripple_edge: float = 0.08
    ripple_shift: float = 0.15
    frame_lag_s: float = 5e-3
    command_lead: float = 1.5
    ripple_torque: float = 0.3
    ripple_held: float = 0.08
    ripple_sampled: float = 0.5e-6
    lead_ohm: float = 5e-3
    lead_share: float = 4.3e-3
    zero_a: float = 1e-3
    zero_angle_rad: float = 1e-3
    late_angle_s: float = 0.02
    bend_angle_s2: float = 1e-6
    late_torque_s: float = 0.25
    late_speed_s: float = 5e-3
    bend_speed_s2: float = 1.25e-5
    late_voltage_s: float = 0.05
    electrical_s: float = 2e-3
    unsampled_share: float = 10.0
    coast_dry_share: float = 0.02
    coast_viscous_share: float = 0.03
    open_flux_share: float = 5e-4
    gain: float = 0.01
    gain_clock: float = 1e-4
    offset_temp_k: float = 2.0
    unlogged_d_share: float = UNLOGGED_D_SHARE
    unlogged_k: float = UNLOGGED_U_K
