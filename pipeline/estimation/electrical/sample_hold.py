"""How long an inverter held a voltage that a log holds."""

from __future__ import annotations

from pipeline.estimation.policy import policy
from pipeline.records.capture import CaptureMeta


def hold_s(meta: CaptureMeta, period_s: float, omega_elec_rad_s: float) -> float:
    """Time for which an inverter held a voltage vector still, of a log whose voltages are means.

    Parameters
    ----------
    meta
        Of the log: its PWM frequency, where stated.
    period_s
        Sampling period [s].
    omega_elec_rad_s
        Highest electrical speed [rad/s].

    Returns
    -------
    float
        The PWM period [s] of a log that is slower, which holds means in the rotor's frame; the
        sampling period of one as fast; zero where the rotor turns further in a row than under one
        vector of any inverter, in a log that states no PWM frequency.

    """
    inverter = policy().inverter
    if meta.pwm_hz:
        pwm_s = 1.0 / meta.pwm_hz
        return pwm_s if pwm_s < inverter.slower_share * period_s else period_s
    return period_s if abs(omega_elec_rad_s) * period_s < inverter.held_turn_rad else 0.0
