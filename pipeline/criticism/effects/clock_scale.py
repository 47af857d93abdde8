"""A time base that runs fast or slow by a factor."""

from __future__ import annotations

from pipeline.criticism.effect import RECORDERS, Effect, Parameter, Values, choice

_LOG, _OPEN, _SHAFT, _STEP = (2**n for n in range(len(RECORDERS)))
_TURNING = _LOG + _OPEN + _SHAFT


def _clock(recorder: str, q: Values) -> float:
    return q["gain"] if int(q["of"]) & 2 ** RECORDERS.index(recorder) else 0.0


EFFECT = Effect(
    name="clock_scale",
    words="recorded time = (1 + gain) true time",
    signature="every flux, inductance and friction rate off by one factor, the inertia by its "
    "square, and no resistance",
    tests=("torque_map", "open_circuit", "spin_down", "drive"),
    experiment="a speed known from another clock (a stroboscope, the mains), or the same test on a "
    "second recorder",
    headline="a recorder's clock off by {gain %}",
    reference="Allan, Ashby & Hodge, The Science of Timekeeping (1997), HP AN 1289: offset of a "
    "crystal's rate",
    parameters=(
        # a recorder without a crystal is good to some percent
        Parameter("gain", "1", 0.02, 0.002, low=-0.1, high=0.1),
        choice(
            "of",
            (_TURNING, _LOG, _OPEN, _SHAFT, _STEP, _OPEN + _SHAFT, _TURNING + _STEP),
            "whose clock, a sum: 1 logs under load, 2 open windings, 4 a shaft alone, "
            "8 steps of a locked rotor",
        ),
    ),
    signals=("t_s",),
    alternatives={
        "torque_scale": "steps of current with the rotor locked on the same clock",
        "voltage_scale": "resistance on the same voltmeter",
    },
    clock=_clock,
    rare=True,
)
