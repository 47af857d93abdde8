"""One phase's current sensor with a gain of its own."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.effect import Complex, Effect, Parameter, Recorded, Values, alone, choice


def _current(r: Recorded, q: Values) -> Complex:
    if not r.by_drive(q):
        return r.i_a if r.phase is None else r.i_a / (1.0 + q["bench"] * _of_phase(r.phase, q))
    gamma = (q["cosine"] + 1j * q["sine"]) * np.exp(-2j * r.eps_rad)
    mean = 1.0 + q["mean"] + 1j * _turn(q)
    # recorded = mean i + gamma conj(i), solved for i
    size = abs(mean) ** 2 - np.abs(gamma) ** 2
    return (np.conj(mean) * r.i_a - gamma * np.conj(r.i_a)) / size


def _turn(q: Values) -> float:
    """Angle that two shunts turn the current by: the third line is less their sum, and has their
    gains in it. Of pair k it is half of γ along e^{j(30° + 240° k)}, k = 0 of a and b.
    """
    pair = q["shunts"] - 1.0
    if pair < 0.0:
        return 0.0
    along = np.exp(-1j * np.pi * (1.0 / 6.0 + 4.0 / 3.0 * pair))
    return float(0.5 * ((q["cosine"] + 1j * q["sine"]) * along).real)


def _of_phase(phase: int, q: Values) -> float:
    """Gain of phase k's sensor: mean + 2 Re(γ a^{−2k}), a = e^{j120°}."""
    turned = (q["cosine"] + 1j * q["sine"]) * np.exp(-4j * np.pi * phase / 3.0)
    return float(q["mean"] + 2.0 * turned.real)


EFFECT = Effect(
    name="current_gain",
    words="recorded i = (1 + mean) i + γ i* e^{−j2ε}; one phase k off by g: |γ| = mean = g/3; "
    "shunts: 0 of all three lines, or 1, 2, 3 of a and b, b and c, c and a alone, which turn i by "
    "|γ|/2 as well; bench: how far the bench's line currents come from the same sensors",
    signature="second electrical order in current, voltage and torque, proportional to current",
    tests=("torque_map",),
    of_phases=True,
    experiment="a torque map at two speeds",
    headline="phase current sensors that differ, by {cosine & sine %} of the current",
    reference="Chung & Sul, IEEE Trans. Ind. Appl. 34 (1998), current measurement errors",
    parameters=(
        Parameter("cosine", "1", 0.01, 0.001, low=-0.3, high=0.3),
        Parameter("sine", "1", 0.01, 0.001, low=-0.3, high=0.3),
        # of itself it would be the gain of all sensors alike, which are within some percent
        Parameter("mean", "1", 0.01, 0.0, low=-0.3, high=0.3, usual=(0.0, 0.03)),
        choice("shunts", (0.0, 1.0, 2.0, 3.0)),
        choice("bench", (0.0, 1.0)),
        alone(),
    ),
    signals=("id_a", "iq_a"),
    alternatives={"phase_imbalance": "resistance through all three terminal pairs"},
    current=_current,
)
