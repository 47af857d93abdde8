"""Which further test or calibration would part two effects, and with what power.

Around a fit everything is linear. What an effect does is a vector d of weak samples over the
noise; what an alternative and all other constants can do is a plane. λ = |d|² (1 − cos²), the
part of d off the plane, is the noncentrality of the test that separates the two [1]. Another
capture adds its rows to both, a calibration adds a prior.

References: [1] Kay, Fundamentals of Statistical Signal Processing II (1998), section 6.5.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, chndtr

from pipeline.criticism.design.planned_tests import PLANNED, planned, planned_words
from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.design import Design
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.linearise import linearise
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.selection.candidates import Candidate, placed
from pipeline.records.diagnosis import Separation

_GAIN_WORDS = {
    "gain_current": "the drive's current sensors calibrated to {:g} %",
    "gain_current_rest_1": "the ammeter of the heat run calibrated to {:g} %",
    "gain_current_bench": "the bench's ammeter calibrated to {:g} %",
    "gain_voltage": "the bench's voltmeters calibrated to {:g} %",
    "gain_commanded": "the drive's voltage calibrated to {:g} %",
    "gain_torque": "the torque transducer calibrated to {:g} %",
}
_KNOWN_WORDS = {
    "r_ohm": "the phase resistance known to {:g} % (four-wire meter)",
    "psi_wb": "the magnet's flux known to {:g} % (back-EMF with a calibrated meter)",
}
_SEED = 20260303


@dataclass(frozen=True, slots=True)
class Plan:
    """A further experiment: what it adds to the normal matrix of [d, others...].

    Attributes
    ----------
    words
        What it is.
    normal
        What it adds to the normal matrix of the effect and the other columns.

    """

    words: str
    normal: Array


def separations(
    effect: Effect, wide: LinearSystem, offered: Sequence[Candidate], remedies: Mapping[str, str]
) -> tuple[Separation, ...]:
    """Experiments that would separate an effect from its alternatives, the best first.

    Parameters
    ----------
    effect
        The effect.
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    remedies
        What the effects declare to separate them, by alternative.

    Returns
    -------
    tuple of Separation
        With the power of a test at the 1 % level, from the captures and the experiment together.
        Where no experiment that can be predicted helps, the one of `remedies` without a power.

    """
    policy = wide.policy.design
    separations_found: list[Separation] = []
    for other, remedy in remedies.items():
        columns = _nearest(effect, other, wide, offered)
        if columns is None:
            continue
        now, places = _normal_matrix(effect, columns, wide)
        freedom = effect.dof(wide.fit.machine)
        base = _power(_noncentrality(now), freedom, policy)
        ranked = sorted(
            (
                (_power(_noncentrality(now + plan.normal), freedom, policy), plan.words)
                for plan in _plans(effect, places, wide)
            ),
            key=lambda one: (-one[0], one[1]),
        )
        better = [(power, label) for power, label in ranked if power > base + policy.least_power][
            : policy.most_experiments
        ]
        separations_found += [Separation(other, label, power) for power, label in better]
        if not better:
            separations_found.append(Separation(other, remedy, None))
    return tuple(separations_found)


def _power(noncentrality: float, freedom: int, policy: Design) -> float:
    """Probability that a χ² test at the 1 % level sees a noncentrality."""
    limit = float(chdtri(freedom, policy.false_alarm))
    return float(np.clip(1.0 - chndtr(limit, freedom, max(noncentrality, 0.0)), 0.0, 1.0))


def _nearest(
    effect: Effect, other: str, wide: LinearSystem, offered: Sequence[Candidate]
) -> Indices | None:
    """Places of the alternative's columns, of its trial shapes the one that is hardest to part."""
    best, least = None, np.inf
    for candidate, places in placed(wide, offered):
        if candidate.effect.name == other:
            undetected = _noncentrality(_normal_matrix(effect, places, wide)[0])
            if undetected < least:
                best, least = places, undetected
    return best


def _amplitudes(effect: Effect, wide: LinearSystem) -> Array:
    """The effect's fitted amplitudes [P], zero at every other column and at shapes."""
    named, values = effect.named(wide.fit.machine), wide.fit.values
    names = {name: values[name] for name, p in named.items() if p.amplitude}
    return np.array([names.get(column.name, 0.0) for column in wide.columns])


def _normal_matrix(
    effect: Effect, alternative: Indices, wide: LinearSystem
) -> tuple[Array, Indices]:
    """Normal matrix of [d, the model's other columns, the alternative's], and their places."""
    prefix = f"{effect.name}."
    fixed = np.array([n for n in wide.model_columns if not wide.columns[n].name.startswith(prefix)])
    places = np.concatenate([fixed, alternative]).astype(np.int64)
    weight = wide.weights(wide.reduced_chi2(wide.residual))
    matrix = _stacked(wide.matrix, _amplitudes(effect, wide), places)
    normal = (matrix * weight[:, None]).T @ matrix
    return normal + np.diag(np.concatenate([[0.0], wide.prior_precision[places]])), places


def _stacked(matrix: Array, amplitudes: Array, places: Indices) -> Array:
    return np.column_stack([matrix @ amplitudes, matrix[:, places]])


def _noncentrality(normal: Array) -> float:
    """|d|² (1 − cos²): what of the first column the others leave."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    balanced = normal / np.outer(size, size)
    inverse = np.linalg.pinv(balanced[1:, 1:], rcond=1e-11, hermitian=True)
    share = 1.0 - float(balanced[0, 1:] @ inverse @ balanced[1:, 0])
    # what rounding leaves of an exact tie is nothing
    return float(normal[0, 0]) * share if share > 1e-9 else 0.0


def _plans(effect: Effect, places: Indices, wide: LinearSystem) -> Iterator[Plan]:
    """Every experiment whose outcome can be predicted: repeats, tests not done, calibrations."""
    policy, amplitudes = wide.policy.design, _amplitudes(effect, wide)
    weight = wide.weights(wide.reduced_chi2(wide.residual))
    tests = [segment.test for segment in wide.segments]
    test = np.array(tests)[wide.segment]
    for name in sorted(set(tests)):
        rows = test == name
        matrix = _stacked(wide.matrix[rows], amplitudes, places)
        once = (matrix * weight[rows, None]).T @ matrix
        yield Plan(f"{name} recorded {policy.repeats} times", (policy.repeats - 1) * once)
    for name in PLANNED:
        if name not in tests:
            rows_of = _planned_rows(name, wide)
            if rows_of is not None:
                matrix = _stacked(rows_of, amplitudes, places)
                yield Plan(planned_words(name, policy), matrix.T @ matrix)
    yield from _calibrations(places, wide)


def _calibrations(places: Indices, wide: LinearSystem) -> Iterator[Plan]:
    policy = wide.policy.design
    for place, column in enumerate(places):
        name = wide.columns[column].name
        if name in _GAIN_WORDS:
            size, description = 1.0, _GAIN_WORDS[name]
        elif name in _KNOWN_WORDS:
            size, description = abs(wide.fit.values[name]), _KNOWN_WORDS[name]
        else:
            continue
        normal = np.zeros((places.size + 1, places.size + 1))
        normal[place + 1, place + 1] = (policy.calibrated_u * size) ** -2.0 if size > 0.0 else 0.0
        yield Plan(description.format(100.0 * policy.calibrated_u), normal)


def _planned_rows(test: str, wide: LinearSystem) -> Array | None:
    """Columns [R, P] over the noise of a test that was not done."""
    columns = []
    model, values = wide.fit.model, wide.fit.values
    for number, segment in enumerate(planned(test, wide.fit)):
        sigma = noise_floor(segment, model, values, _SEED + number)
        rows = linearise(segment, model, values, wide.columns, Floor(sigma, values))
        columns.append(rows.columns)
    return np.concatenate(columns) if columns else None
