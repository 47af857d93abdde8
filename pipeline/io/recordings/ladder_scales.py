"""What all rungs of a ladder share: which signals are drawn, over what, and in which unit."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.physics.notation import Scale, scale_for
from pipeline.records.diagnosis import Diagnosis, LadderRung

RUNG = "rung"
SPEED, CURRENT = "omega_mech_rad_s", "iq_a"


def shown_signals(result: Diagnosis) -> tuple[str, ...]:
    """Signals with an error on every rung, the one farthest over its noise floor first."""
    if not result.ladder:
        return ()
    first = result.ladder[0].errors
    everywhere = [name for name in first if all(name in rung.errors for rung in result.ladder)]

    def over(name: str) -> float:
        return first[name].rmse / max(first[name].noise_floor, 1e-300)

    mapped = [n for n in everywhere if result.ladder[0].map_of(n, SPEED, CURRENT) is not None]
    rest = [name for name in everywhere if name not in mapped]
    return (*sorted(mapped, key=lambda n: (-over(n), n)), *sorted(rest, key=lambda n: -over(n)))


def angle_of(signal: str) -> str:
    """The angle that a signal's error is drawn over: torque ripples with the shaft."""
    return "theta_mech_rad" if signal == "torque_shaft_nm" else "theta_elec_rad"


def common_reach(ladder: Sequence[LadderRung], signal: str) -> float:
    """Full colour of a signal's maps on all rungs [unit]: no more than the first rung's largest."""
    flat = [rung.map_of(signal, SPEED, CURRENT) for rung in ladder]
    return max((one.reach for one in flat if one is not None), default=0.0)


def error_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which a signal's errors are drawn on all rungs: mV where volts would be small."""
    errors = [rung.errors[signal] for rung in result.ladder]
    return scale_for(max(e.rmse for e in errors), errors[0].unit)


def angle_reach(result: Diagnosis, signal: str) -> float:
    """The largest mean error over the angle on any rung [unit]."""
    turns = [rung.map_of(signal, angle_of(signal)) for rung in result.ladder]
    return max((one.reach for one in turns if one is not None), default=0.0)


def angle_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which a signal's error is drawn over the angle on all rungs."""
    return scale_for(angle_reach(result, signal), result.ladder[0].errors[signal].unit)
