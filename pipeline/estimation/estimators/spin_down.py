"""Friction over inertia from coast-downs: what deceleration says without any torque known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pipeline.estimation.mechanical.coasts_over_time import by_time
from pipeline.estimation.mechanical.drag_forms import DRAG_FORMS, STRIBECK
from pipeline.estimation.mechanical.setups import setups_of
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.numerics.coast_setups import REMEDY, setup_words
from pipeline.numerics.coasting import coast_down, coasting_rows
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import (
    NonlinearFit,
    autocorrelation_time,
    central_jacobian,
    gauss_newton,
)
from pipeline.numerics.plateaus import block_means, white_noise_sigma
from pipeline.numerics.quantisation import resolution
from pipeline.numerics.selection import needed_columns
from pipeline.numerics.weak_rows import LEAST_SAMPLES, smooth_speed
from pipeline.physics.glossary import Term
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution, propagate

TERMS = (
    Term("coast_coulomb_rad_s2", "rad/s²", "Coulomb friction over inertia, from coasting",
         "constant", 0.0, 1e7),
    Term("coast_viscous_1_s", "1/s", "viscous friction over inertia, from coasting", "constant",
         -1e3, 1e6),
)  # fmt: skip
METHOD = Method("spin_down", TERMS)
GIVES = tuple(term.name for term in TERMS)
EXPERIMENT = (
    "record a spin_down: terminals open, let the shaft coast from full speed to rest with "
    "theta_mech_rad logged, once in each sense"
)
SHARED = ("coulomb", "viscous")
EXTRAS = ("windage", *STRIBECK[::3])
RIPPLES = ("cos", "sin", "cos 2", "sin 2")


@dataclass(frozen=True, slots=True)
class Coast:
    """One coast: time from its start [n], angle travelled or speed [n], absolute angle [n]."""

    path: str
    start_s: float
    t_s: Array
    measured: Array
    theta_rad: Array
    sense: int
    speed_rad_s: float
    of_angle: bool
    sigma: float


def deceleration(
    omega_rad_s: Array, drag: Array, extras: Sequence[str], fastest_rad_s: float
) -> Array:
    """Deceleration of a shaft that coasts [rad/s²].

    Parameters
    ----------
    omega_rad_s : array [n], rad/s
        Speed in the sense of rotation.
    drag : array [2 + k]
        T_c/J [rad/s²], B/J [1/s], then what each of `extras` adds at its full height [rad/s²].
    extras : k names of `DRAG_FORMS`
        Windage or Stribeck's excess, as functions of ω/ω_max.
    fastest_rad_s
        ω_max.

    Notes
    -----
    -dω/dt = T_c/J + (B/J) ω + Σ a_k f_k(ω/ω_max). The derivatives by T_c/J, B/J and a_k are 1, ω
    and f_k; those of the angle follow by integration, and are taken by central differences.

    References
    ----------
    IEEE Std 115-2019, 4.4 (retardation test).

    """
    total: Array = drag[0] + drag[1] * omega_rad_s
    for value, name in zip(drag[2:], extras, strict=True):
        if value:
            total = total + value * DRAG_FORMS[name](omega_rad_s / fastest_rad_s)
    return total


@dataclass(frozen=True, slots=True)
class Motion:
    """The parameters: shared drag first, then start angle, speed and ripple of each coast."""

    extras: tuple[str, ...]
    ripples: tuple[str, ...]
    fastest_rad_s: float

    def of_coast(self, index: int, parameters: Array) -> tuple[Array, Array]:
        """Drag parameters and those of one coast."""
        shared = len(SHARED) + len(self.extras)
        size = 2 + len(self.ripples)
        return parameters[:shared], parameters[shared + index * size : shared + (index + 1) * size]

    def predict(self, index: int, coast: Coast, parameters: Array) -> Array:
        """What the encoder (or tachometer) should read [n]."""
        drag, of_coast = self.of_coast(index, parameters)
        fast = self.fastest_rad_s
        slowing = partial(deceleration, drag=drag, extras=self.extras, fastest_rad_s=fast)
        theta, speed = coast_down(coast.t_s, max(float(of_coast[1]), 1e-6 * fast), slowing)
        # A tachometer's zero error looks as T_c/B does, so it is taken as none.
        out = of_coast[0] + theta if coast.of_angle else speed
        for value, name in zip(of_coast[2:], self.ripples, strict=True):
            out = out + value * _ripple(name, coast.theta_rad)
        return out

    def jacobian(self, coasts: Sequence[Coast], parameters: Array, width: Array) -> Array:
        """Derivatives [n, k] of what all coasts should read; `width` [k] as `_widths` gives it."""
        rows = [self._rows(i, coast, parameters, width) for i, coast in enumerate(coasts)]
        return np.concatenate(rows)

    def _rows(self, index: int, coast: Coast, parameters: Array, width: Array) -> Array:
        """Derivatives [n, k] of one coast, which moves with the shared drag and what is its own.

        Start angle and ripple are linear; drag and start speed take central differences.
        """
        shared = len(SHARED) + len(self.extras)
        first = shared + index * (2 + len(self.ripples))
        integrated = [*range(shared), first + 1]

        def moved(values: Array) -> Array:
            changed = parameters.copy()
            changed[integrated] = values
            return self.predict(index, coast, changed)

        rows = np.zeros((coast.t_s.size, parameters.size))
        rows[:, integrated] = central_jacobian(moved, parameters[integrated], width[integrated])
        rows[:, first] = float(coast.of_angle)
        for place, name in enumerate(self.ripples, first + 2):
            rows[:, place] = _ripple(name, coast.theta_rad)
        return rows


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """T_c/J and B/J by `deceleration`, fitted to the angle itself.

    The trajectory is integrated, the record never differentiated; windage, Stribeck's bump and an
    eccentric encoder join where the residuals demand them. J is not in it: that needs a known
    torque (estimator inertia). Where no one drag explains both senses and one of each does, their
    mean is given, which is the part that is odd in speed. Coasts of several set-ups
    (`coast_setups`) have no common value; what each gives is in the note.
    """
    captures = campaign.of("spin_down")
    setups = setups_of(captures)
    if len(setups) > 1:
        each = (_brief(_fit(setup.captures, options)) for setup in setups)
        note = f"{setup_words(setups)}; in this order {' | '.join(each)}; {REMEDY}"
        return METHOD.nothing(GIVES, note)
    return _fit(captures, options)


def _brief(solution: Fit) -> str:
    """Both constants of one set-up, in words."""
    if not all(e.known for e in solution.estimates):
        return "nothing by itself"
    words = (f"{e.name} {e.number:.5g} ± {e.u:.2g} {e.unit}" for e in solution.estimates)
    return ", ".join(words)


def _fit(captures: Sequence[Capture], options: Mapping[str, float]) -> Fit:
    """T_c/J and B/J of coasts of one set-up."""
    coasts = [c for capture in captures for c in _coasts(capture)]
    if not coasts:
        return METHOD.nothing(
            GIVES, f"no coast-down of {LEAST_SAMPLES} samples or more; {EXPERIMENT}"
        )
    motion, solution = _solved(coasts, options["level"])
    by_speed = _of_speed(coasts, motion, solution, options["level"])
    return by_time(METHOD, by_speed, captures, motion.extras, options["level"])


def _of_speed(coasts: Sequence[Coast], motion: Motion, solution: NonlinearFit, level: float) -> Fit:
    """T_c/J and B/J by a drag that goes by speed, and perhaps by sense."""
    senses = [[c for c in coasts if c.sense == sense] for sense in (1, -1)]
    if all(senses) and _residual(solution) > policy().coast_down.unexplained:
        each = [(of_sense, *_solved(of_sense, level)) for of_sense in senses]
        if all(_residual(one[2]) <= policy().coast_down.unexplained for one in each):
            return _of_both_senses(each)
    if not np.isfinite([solution.u(0), solution.u(1)]).all():
        return METHOD.nothing(
            GIVES, f"the coasts do not part dry from viscous friction; {EXPERIMENT}"
        )
    return Fit(_estimates(motion, coasts, solution), _evidence(motion, coasts, solution))


def _solved(coasts: Sequence[Coast], level: float) -> tuple[Motion, NonlinearFit]:
    """One drag of all coasts, with what the residuals demand."""
    fastest = max(c.speed_rad_s for c in coasts)
    motion = Motion((), (), fastest)
    solution = _solve(motion, coasts, None)
    for _ in range(2):
        wider = _wider(motion, coasts, solution, level)
        if wider == motion:
            break
        solution = _solve(
            wider, coasts, _transferred(motion, wider, solution.parameters, len(coasts))
        )
        motion = wider
    return motion, solution


def _residual(fit: NonlinearFit) -> float:
    """What a fit leaves [1], in the encoder's own noise."""
    free = fit.residuals.size - fit.parameters.size
    return float(np.sqrt(fit.residuals @ fit.residuals / free))


def _of_both_senses(each: Sequence[tuple[list[Coast], Motion, NonlinearFit]]) -> Fit:
    """The mean of both senses' drags, where no one drag explains what one each does."""
    pairs = zip(*(_estimates(motion, of, fit) for of, motion, fit in each), strict=True)
    estimates = []
    for one, other in pairs:
        drags = f"{one.number:.5g} forward, {other.number:.5g} backward"
        note = f"no one drag explains both senses, this is the mean of {drags}; {one.note}"
        budget = propagate([(0.5, one.budget), (0.5, other.budget)])
        value, paths = 0.5 * (one.number + other.number), sorted({*one.captures, *other.captures})
        estimates.append(METHOD.measured(one.name, value, budget, paths, one.at, note))
    plots = [plot for of, motion, fit in each for plot in _evidence(motion, of, fit)]
    return Fit(tuple(estimates), tuple(plots))


def _coasts(capture: Capture) -> list[Coast]:
    """The stretches from the highest speed down to (nearly) rest, thinned by block means."""
    of_angle = capture.has("theta_mech_rad")
    column = "theta_mech_rad" if of_angle else "omega_mech_rad_s"
    if not capture.has("t_s", column):
        return []
    t, y = capture.finite("t_s", column).values()
    if t.size < LEAST_SAMPLES:
        return []
    angle, limits = y if of_angle else trapezoid(t, y), policy().coast_down
    try:
        width = min(max(t.size / limits.smoothed_part, limits.least_smoothed), limits.most_smoothed)
        speed = smooth_speed(t, angle, max(0.01, width * float(np.median(np.diff(t)))))
    except ValueError:
        return []
    return [
        _coast(capture.path, t[rows], y[rows], sense, sense * speed[rows], of_angle)
        for rows, sense in coasting_rows(speed)
        # a swing of less than a turn may be a pendulum's
        if rows.stop - rows.start >= LEAST_SAMPLES * (1 if np.ptp(angle[rows]) > math.tau else 3)
    ]


def _coast(path: str, t: Array, y: Array, sense: int, speed: Array, of_angle: bool) -> Coast:
    block = -(-t.size // policy().coast_down.most_samples)
    sigma = max(white_noise_sigma(y), resolution(y) / math.sqrt(12.0)) / math.sqrt(block)
    start = float(t[0])
    t, y = block_means(t - start, block), block_means(y, block)
    travelled = (y - y[0]) * sense if of_angle else y * sense
    theta = y if of_angle else np.cumsum(np.gradient(t) * y)
    least = float(np.ptp(travelled) * np.finfo(np.float32).eps)
    noise = max(float(sigma), least)
    return Coast(path, start, t, travelled, theta, sense, float(speed[0]), of_angle, noise)


def _ripple(name: str, theta: Array) -> Array:
    order = 2.0 if name.endswith("2") else 1.0
    return np.cos(order * theta) if name.startswith("cos") else np.sin(order * theta)


def _weights(coasts: Sequence[Coast]) -> Array:
    return np.concatenate([np.full(c.t_s.size, 1.0 / max(c.sigma, 1e-300)) for c in coasts])


def _solve(motion: Motion, coasts: Sequence[Coast], start: Array | None) -> NonlinearFit:
    measured = np.concatenate([c.measured for c in coasts])
    weights = _weights(coasts)
    if start is None:
        start = _initial_values(motion, coasts)

    def predict(parameters: Array) -> Array:
        return np.concatenate([motion.predict(i, c, parameters) for i, c in enumerate(coasts)])

    width = _widths(motion, coasts, start)

    def model(parameters: Array) -> tuple[Array, Array]:
        jacobian = motion.jacobian(coasts, parameters, width)
        return (predict(parameters) - measured) * weights, jacobian * weights[:, None]

    return gauss_newton(model, start, iterations=15)


def _initial_values(motion: Motion, coasts: Sequence[Coast]) -> Array:
    span = max(float(c.t_s[-1]) for c in coasts)
    parts = [np.array([0.5 * motion.fastest_rad_s / span, 0.5 / span])]
    parts += [np.array([0.0, c.speed_rad_s]) for c in coasts]
    return np.concatenate(parts)


def _widths(motion: Motion, coasts: Sequence[Coast], start: Array) -> Array:
    """Steps of the finite differences: a ten-thousandth of what matters over the record."""
    drag = 1e-4 * max(abs(start[0]), abs(start[1]) * motion.fastest_rad_s)
    shared = [drag, drag / motion.fastest_rad_s, *([drag] * len(motion.extras))]
    of_coast = [1e-3, 1e-5 * motion.fastest_rad_s, *([1e-3] * len(motion.ripples))]
    return np.array(shared + of_coast * len(coasts))


def _wider(motion: Motion, coasts: Sequence[Coast], fit: NonlinearFit, level: float) -> Motion:
    """The motion with the additions that the residuals demand."""
    extras = tuple(n for n in EXTRAS if n not in motion.extras)
    of_angle = all(c.of_angle for c in coasts)
    ripples = tuple(n for n in RIPPLES if n not in motion.ripples) if of_angle else ()
    sigma = np.ones(fit.residuals.size)
    tau = autocorrelation_time(fit.residuals)
    trial = Motion(motion.extras + extras, motion.ripples, motion.fastest_rad_s)
    start = _transferred(motion, trial, fit.parameters, len(coasts))
    weights = _weights(coasts)
    jacobian = trial.jacobian(coasts, start, _widths(trial, coasts, start)) * weights[:, None]
    at = len(SHARED) + len(motion.extras)
    candidates = {name: jacobian[:, at + k] for k, name in enumerate(extras)}
    theta = np.concatenate([c.theta_rad for c in coasts])
    candidates |= {name: _ripple(name, theta) * weights for name in ripples}
    chosen = needed_columns(
        fit.jacobian,
        candidates,
        -fit.residuals,
        sigma,
        level,
        policy().coast_down.most_additions,
        min(tau, 50.0),
    )
    return Motion(
        motion.extras + tuple(n for n in extras if n in chosen),
        motion.ripples + tuple(n for n in ripples if n in chosen),
        motion.fastest_rad_s,
    )


def _transferred(old: Motion, new: Motion, parameters: Array, coasts: int) -> Array:
    """Parameters of the old motion in the places of the new one, additions at zero."""
    drag = parameters[: len(SHARED) + len(old.extras)]
    parts = [drag, np.zeros(len(new.extras) - len(old.extras))]
    for index in range(coasts):
        of_coast = old.of_coast(index, parameters)[1]
        parts += [of_coast, np.zeros(len(new.ripples) - len(old.ripples))]
    return np.concatenate(parts)


def _estimates(motion: Motion, coasts: Sequence[Coast], fit: NonlinearFit) -> tuple[Estimate, ...]:
    free, spread = fit.residuals.size - fit.parameters.size, _residual(fit) ** 2
    tau = autocorrelation_time(fit.residuals)
    joint = fit.covariance[:2, :2] * spread * tau
    scale = np.sqrt(np.diag(joint))
    lower = np.linalg.cholesky(joint / np.outer(scale, scale) + 1e-12 * np.eye(2)) * scale[:, None]
    paths = sorted({c.path for c in coasts})
    added = [*motion.extras, *motion.ripples]
    note = f"{len(coasts)} coasts; residual {np.sqrt(spread):.2g} times the encoder's own noise"
    note += f"; {allowed_for(added)}" if added else ""
    form = np.zeros(2)
    if np.sqrt(spread) > policy().coast_down.unexplained:
        form = _form(motion, coasts, fit)
        note += "; drag has another form: allowance from the fast and the slow half apart"
    dof = max(free / tau, 1.0)
    estimates = []
    for i, name in enumerate(GIVES):
        parts = [METHOD.scatter(f"{k}", float(lower[i, k]), dof) for k in (0, 1)]
        parts.append(Contribution("assumed:drag_form", float(form[i]), "B"))
        value, at = float(fit.parameters[i]), {"omega_mech_rad_s": motion.fastest_rad_s}
        estimates.append(METHOD.measured(name, value, parts, paths, at, note))
    return tuple(estimates)


def _form(motion: Motion, coasts: Sequence[Coast], fit: NonlinearFit) -> Array:
    """How far the halves of the coasts disagree on the two ratios, each fitted by itself."""
    values = []
    simple = Motion((), motion.ripples, motion.fastest_rad_s)
    for late in (False, True):
        halves = []
        for i, coast in enumerate(coasts):
            half = coast.t_s.size // 2
            rows = slice(half, None) if late else slice(0, half)
            speed = np.gradient(motion.predict(i, coast, fit.parameters), coast.t_s)
            offset = coast.measured[rows][0] if coast.of_angle else 0.0
            halves.append(
                Coast(
                    coast.path, coast.start_s, coast.t_s[rows] - coast.t_s[rows][0],
                    coast.measured[rows] - offset, coast.theta_rad[rows], coast.sense,
                    float(speed[rows][0]) if coast.of_angle else float(coast.measured[rows][0]),
                    coast.of_angle, coast.sigma,
                )
            )  # fmt: skip
        first = _initial_values(simple, halves)
        start = _transferred(Motion((), (), simple.fastest_rad_s), simple, first, len(halves))
        values.append(_solve(simple, halves, start).parameters[:2])
    apart = np.abs(values[1] - values[0])
    beside = np.abs(0.5 * (values[0] + values[1]) - fit.parameters[:2])
    return np.maximum(apart, beside)


def _evidence(motion: Motion, coasts: Sequence[Coast], fit: NonlinearFit) -> tuple[Evidence, ...]:
    plots = []
    for i, coast in enumerate(coasts):
        fitted = motion.predict(i, coast, fit.parameters)
        keep = slice(None, None, -(-coast.t_s.size // 2000))
        t = coast.t_s[keep] + coast.start_s
        word = "forward" if coast.sense > 0 else "backward"
        if coast.of_angle:
            measured = np.gradient(coast.measured, coast.t_s)[keep]
            modelled = np.gradient(fitted, coast.t_s)[keep]
        else:
            measured, modelled = coast.measured[keep], fitted[keep]
        speed = Series(word, t, measured * coast.sense, modelled * coast.sense)
        caption = "speed for the eye only; the fit is to the angle"
        axes = "t_s", "omega_mech_rad_s"
        plots.append(METHOD.plot(f"Coast-down {word}", axes, "line", (speed,), caption, coast.path))
        if coast.of_angle:
            angle = Series(word, t, coast.measured[keep], fitted[keep])
            caption, axes = "angle from the start of the coast", ("t_s", "theta_mech_rad")
            plots.append(
                METHOD.plot(f"Angle travelled {word}", axes, "line", (angle,), caption, coast.path)
            )
    return tuple(plots)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("spin_down",),
    experiment=EXPERIMENT,
    fit=fit,
    rank=0,
    terms=TERMS,
    clock_powers={"coast_coulomb_rad_s2": -2, "coast_viscous_1_s": -1},
    options={"level": 0.001},
)
