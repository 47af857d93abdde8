"""Which further test or calibration would part two effects, and with what power.

Around a fit everything is linear. What an effect does is a vector d of weak samples over the
noise; what an alternative and all other constants can do is a plane. λ = |d|² (1 − cos²), the
part of d off the plane, is the noncentrality of the test that separates the two [1]. Another
capture adds its rows to both, a calibration adds a prior.

References: [1] Kay, Fundamentals of Statistical Signal Processing II (1998), section 6.5.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, chndtr

from pipeline.criticism.data.segment import (
    Instrument,
    Segment,
    Sensors,
    slow_orders,
)
from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.design import Design
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.linearise import linearise
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.candidates import Candidate, placed
from pipeline.numerics.projection import projection, window_starts
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


PLANNED = {
    "torque_map": "a torque map at {} of full speed, in both senses",
    "spin_down": "a spin_down from full speed to a tenth of it",
    "cogging": "a slow turn (cogging) in both directions",
}
_NOISE = {
    "id_a": ("noise_current", "current_a"),
    "iq_a": ("noise_current", "current_a"),
    "vd_v": ("noise_voltage", "voltage_v"),
    "vq_v": ("noise_voltage", "voltage_v"),
    "torque_shaft_nm": ("noise_torque", "torque_nm"),
}
"""Field of the policy with the noise of a sensor that the captures do not show, and its scale."""


def planned_words(test: str, policy: Design) -> str:
    """What one of the planned tests is, in words.

    Parameters
    ----------
    test
        A key of `PLANNED`.
    policy
        Its speeds.

    """
    speeds = (f"{100.0 * speed:g} %" for speed in policy.map_speeds if speed > 0.0)
    return PLANNED[test].format(" and ".join(speeds))


def planned(test: str, fit: Fit) -> tuple[Segment, ...]:
    """The segments that a planned test would give, without noise, at 25 °C.

    Parameters
    ----------
    test
        A key of `PLANNED`.
    fit
        The model that records it. Sensors are as noisy as in its captures, or as usual where they
        were not used there.

    """
    noise = _noise(fit)
    makers = {"torque_map": _torque_map, "spin_down": _spin_down, "cogging": _cogging}
    return tuple(_obeying(s, fit) for s in makers[test](fit, noise))


def _obeying(segment: Segment, fit: Fit) -> Segment:
    """The segment with its channels as the model predicts them."""
    residuals = residual(segment, fit.model, fit.values)
    recorded = dict(segment.recorded)
    for place, channel in enumerate(segment.channels):
        if channel in recorded:
            recorded[channel] = recorded[channel] - residuals[place]
    return replace(segment, recorded=recorded)


def _noise(fit: Fit) -> Mapping[str, float]:
    scales = fit.model.machine.scales
    policy = fit.policy.design
    noise = {n: getattr(policy, field) * scales[scale] for n, (field, scale) in _NOISE.items()}
    noise["theta_mech_rad"] = policy.noise_angle_rad
    for segment in fit.segments:
        for name in (*_NOISE, "theta_mech_rad"):
            if segment.sensors.noise.get(name, 0.0) > 0.0:
                noise[name] = segment.sensors.noise[name]
    return noise


def _torque_map(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    machine, policy = fit.model.machine, fit.policy.design
    period = machine.scales["period_s"]
    levels = [(d, q) for d in policy.map_id for q in policy.map_iq]
    i_d, i_q = (np.repeat([pair[k] for pair in levels], policy.map_samples) for k in (0, 1))
    current = machine.scales["current_a"]
    keep = np.tile(np.arange(policy.map_samples) > policy.map_samples // 4, len(levels))
    maps = []
    for speed in policy.map_speeds:
        theta = speed * machine.scales["speed_rad_s"] * period * np.arange(i_d.size, dtype=float)
        recorded = {
            "id_a": current * i_d,
            "iq_a": current * i_q,
            "vd_v": np.zeros(i_d.size),
            "vq_v": np.zeros(i_d.size),
            "theta_mech_rad": theta,
            "torque_shaft_nm": np.zeros(i_d.size),
        }
        window = policy.map_samples // 2
        weak = projection(theta, window_starts(keep, window), window, machine.electrical_orders)
        maps.append(
            Segment(
                capture=f"planned torque_map {speed:g}",
                test="torque_map",
                kind="dq",
                ts_s=period,
                recorded=recorded,
                channels=("vd_v", "vq_v", "torque_shaft_nm"),
                weak=weak,
                instrument=Instrument("drive", "instant", "gain_commanded"),
                sensors=Sensors(noise),
                fixed={"ambient_k": 0.0},
            )
        )
    return maps


def _shaft(
    name: str,
    test: str,
    period: float,
    recorded: Mapping[str, Array],
    noise: Mapping[str, float],
    orders: tuple[float, ...] = (),
) -> Segment:
    theta = recorded["theta_mech_rad"]
    slow = test == "cogging"
    channel = "torque_shaft_nm" if slow else "omega_mech_rad_s"
    window = theta.size - 2 if slow else 40
    keep = np.ones(theta.size - 2, dtype=bool)
    starts = 1 + window_starts(keep, window)
    cycles, margin = (0.9, 12.0) if slow else (3.0, 16.0)
    weak = projection(theta, starts, window, orders, cycles=cycles, margin=margin)
    return Segment(
        capture=name,
        test=test,
        kind="shaft",
        ts_s=period,
        recorded=recorded,
        channels=(channel,),
        weak=weak,
        instrument=Instrument("bench", "instant"),
        sensors=Sensors(noise),
        fixed={"ambient_k": 0.0},
    )


def _spin_down(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    """A coast from full speed under the model's own friction, b ω + T_c."""
    scales, values, policy = fit.model.machine.scales, fit.values, fit.policy.design
    top, b = scales["speed_rad_s"], max(values["b_nm_s_rad"], 1e-9)
    dry = max(values.get("coulomb_friction.torque_nm", 0.0), 0.0)
    tau = values["j_kgm2"] / b
    dry_rad_s = dry / b
    length = tau * math.log((top + dry_rad_s) / (0.1 * top + dry_rad_s))
    period = length / policy.coast_samples
    t = period * np.arange(policy.coast_samples)
    theta: Array = (top + dry_rad_s) * tau * (1.0 - np.exp(-t / tau)) - dry_rad_s * t
    return [
        _shaft(
            f"planned spin_down {sign}",
            "spin_down",
            period,
            {"theta_mech_rad": sign * theta},
            noise,
        )
        for sign in (1, -1)
    ]


def _cogging(fit: Fit, noise: Mapping[str, float]) -> list[Segment]:
    orders, policy = slow_orders(fit.model.machine), fit.policy.design
    n = policy.samples_an_order * max(orders)
    period = 2 * math.pi / policy.slow_rad_s / n
    theta = policy.slow_rad_s * period * np.arange(n + 3, dtype=float)
    return [
        _shaft(
            f"planned cogging {sign}",
            "cogging",
            period,
            {"theta_mech_rad": sign * theta, "torque_shaft_nm": np.zeros(theta.size)},
            noise,
            orders,
        )
        for sign in (1, -1)
    ]
