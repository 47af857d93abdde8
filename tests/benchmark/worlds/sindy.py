"""Sparse identification of the equations of motion and of both axes, weak form, by PySINDy.

What somebody would do who has the captures, the textbook's model of a synchronous machine and
PySINDy: the terms of that model are kept, and a library of further terms, each of which stands for
one effect, is thinned by sequentially thresholded least squares.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.records.capture import Campaign, Capture

Array = NDArray[np.float64]
Terms = Mapping[str, Sequence[Array]]

DOMAINS = 150
"""Test functions a capture."""

HALF_S, HALF_ROWS = 6e-3, 12
"""Half a test function's width [s], and the rows that it has at the least."""

THRESHOLDS = np.geomspace(1e-3, 0.5, 14)
"""Thresholds tried, in the target's scatter that a term of unit scatter explains."""

RIDGE = 1e-6


@dataclass(frozen=True, slots=True)
class Equation:
    """Weak rows of one capture: of the rate [n], of the model's terms [n, k], of further ones.

    `independent`: how many test functions fit side by side.
    """

    independent: float
    target: Array
    base: Array
    further: Mapping[str, Array]


def weak_sindy(campaign: Campaign) -> Sequence[str] | None:
    """Names of the effects whose terms PySINDy keeps beside those of the textbook's machine.

    Parameters
    ----------
    campaign : Campaign
        Captures of one motor.

    Returns
    -------
    sequence of str or None
        Names of the effects; None where no capture has an angle over time.

    Notes
    -----
    Three equations, for the rates of i_d, i_q and the speed, from every capture with an angle on a
    clock. Each capture's rows count by the scatter that the whole library leaves in it. The
    threshold is the one with the least Bayesian information criterion over the independent rows,
    as in [1]_; of both frames that a held voltage may be logged in, the one that fits better.

    References
    ----------
    .. [1] Mangan et al., Proc. R. Soc. A 473, 2017, 20170009, doi:10.1098/rspa.2017.0009.

    """
    # PySINDy places its test functions by the global generator
    np.random.seed(1)  # noqa: NPY002
    fits = [_equations(campaign, frame) for frame in (0.0, 0.5)]
    found = [one for one in fits if any(one.values())]
    if not found:
        return None
    best = min(found, key=lambda one: sum(_scatter(parts) for parts in one.values() if parts))
    names = [name for parts in best.values() if parts for name in _kept(parts)]
    return tuple(dict.fromkeys(names))


def _equations(campaign: Campaign, frame: float) -> dict[str, list[Equation]]:
    """Equations by name, each with its captures."""
    captures = [
        c for c in campaign.captures if c.has("theta_mech_rad", "t_s") and not c.has("vab_v")
    ]
    order = _cogging_order(captures)
    found: dict[str, list[Equation]] = {"d": [], "q": [], "speed": []}
    columns = [_columns(capture, frame) for capture in captures]
    fast = max((float(np.max(np.abs(c["omega"]))) for c in columns), default=1.0)
    for column in columns:
        if "vq" in column:
            for axis in "dq" if "vd" in column else "q":
                found[axis].append(_weak(column, column[f"i{axis}"], *_axis(column, axis)))
        found["speed"].append(_weak(column, column["omega"], *_motion(column, order, fast)))
    return found


def _cogging_order(captures: Sequence[Capture]) -> int | None:
    """Cycles of cogging a turn, where poles and slots are known."""
    for capture in captures:
        meta = capture.meta
        if meta.slots and meta.pole_pairs:
            return math.lcm(meta.slots, 2 * meta.pole_pairs)
    return None


def _columns(capture: Capture, frame: float) -> dict[str, Array]:
    """Columns on one clock; a held voltage is a mean of both that meet at a sample."""
    names = {
        "theta": "theta_mech_rad",
        "omega": "omega_mech_rad_s",
        "id": "id_a",
        "iq": "iq_a",
        "vd": "vd_v",
        "vq": "vq_v",
        "load": "torque_shaft_nm",
    }
    there = {short: name for short, name in names.items() if capture.has(name)}
    whole = capture.arrays("t_s", *there.values())
    good = np.all([np.isfinite(column) for column in whole.values()], axis=0)
    found = {short: whole[name][good] for short, name in there.items()}
    found["t"] = whole["t_s"][good]
    poles = float(capture.meta.pole_pairs or 1)
    found["poles"] = np.full(found["t"].size, poles)
    if "omega" not in found:
        found["omega"] = np.gradient(found["theta"], found["t"])
    if "vq" in found and capture.meta.voltage_timing == "held":
        step = float(np.median(np.diff(found["t"])))
        turn = np.exp(-1j * frame * poles * found["omega"] * step)
        v = (found.get("vd", 0.0) + 1j * found["vq"]) * (turn if "vd" in found else 1.0)
        v[1:] = 0.5 * (v[1:] + v[:-1])
        found["vq"] = v.imag
        if "vd" in found:
            found["vd"] = v.real
    still = np.zeros(found["t"].size)
    found.setdefault("id", still)
    found.setdefault("iq", still)
    return found


def _axis(c: Mapping[str, Array], axis: str) -> tuple[Sequence[Array], Terms]:
    """Terms of the rate of one current: the model's, and those of effects."""
    eps, omega_e = c["poles"] * c["theta"], c["poles"] * c["omega"]
    i = c["id"] + 1j * c["iq"]
    turns = np.exp(2j * math.pi * np.arange(3) / 3.0)
    signs = np.sign(np.real(np.conj(turns)[:, None] * i * np.exp(1j * eps)))
    lost = (2.0 / 3.0) * (turns @ signs) * np.exp(-1j * eps)
    own, other = (i.real, i.imag) if axis == "d" else (i.imag, i.real)

    def part(z: NDArray[np.complex128]) -> Array:
        return z.real if axis == "d" else z.imag

    base = [c[f"v{axis}"], own, omega_e * other]
    terms: dict[str, Sequence[Array]] = {
        "dead_time": [part(lost)],
        "saturation": [omega_e * other**3],
        "cross_saturation": [omega_e * other * own**2],
        "current_offset": [part(np.exp(-1j * eps)), part(1j * np.exp(-1j * eps))],
        "current_gain": [
            part(np.conj(i) * np.exp(-2j * eps)),
            part(1j * np.conj(i) * np.exp(-2j * eps)),
        ],
        "bemf_harmonics": [omega_e * np.cos(6.0 * eps), omega_e * np.sin(6.0 * eps)],
        "angle_eccentricity": [omega_e * np.cos(c["theta"]), omega_e * np.sin(c["theta"])],
        "iron_eddy": [omega_e**2 if axis == "d" else omega_e**2 * np.sign(omega_e)],
    }
    if axis == "q":
        base.append(omega_e)
    else:
        terms["angle_offset"] = [omega_e]
    if "vd" in c:
        terms["sample_delay"] = [omega_e * c["vq" if axis == "d" else "vd"]]
    return base, terms


def _motion(
    c: Mapping[str, Array], order: int | None, fast: float
) -> tuple[Sequence[Array], Terms]:
    """Terms of the rate of the speed; whatever is on the shaft without a transducer is nothing."""
    theta, omega, one = c["theta"], c["omega"], np.ones(c["theta"].size)
    load = c.get("load", np.zeros(theta.size))
    base = [c["iq"], c["id"] * c["iq"], load, omega, np.sign(omega)]
    slow = 0.05 * fast
    terms: dict[str, Sequence[Array]] = {
        "unbalance": [np.cos(theta), np.sin(theta)],
        "windage": [omega * np.abs(omega)],
        "stribeck": [np.sign(omega) * np.exp(-((omega / slow) ** 2))],
        "constant_load": [one],
        "load_dependent_friction": [np.abs(c["iq"]) * np.sign(omega)],
    }
    if order:
        terms["cogging"] = [np.cos(order * theta), np.sin(order * theta)]
    return base, terms


def _weak(c: Mapping[str, Array], state: Array, base: Sequence[Array], terms: Terms) -> Equation:
    """Means of rate and terms under PySINDy's test functions."""
    from pysindy import IdentityLibrary, WeakPDELibrary

    t = c["t"] - c["t"][0]
    step = float(np.median(np.diff(t)))
    half = min(max(HALF_S, HALF_ROWS * step), 0.2 * float(t[-1]))
    library = WeakPDELibrary(
        function_library=IdentityLibrary(), spatiotemporal_grid=t, K=DOMAINS, H_xt=half
    )
    sizes = [len(columns) for columns in terms.values()]
    further = [column for columns in terms.values() for column in columns]
    columns = np.stack([np.ones(t.size), *base, *further], axis=1)
    weak = np.asarray(library.fit_transform(columns))
    rate = np.asarray(library.convert_u_dot_integral(state[:, None]))[:, 0]
    mean, rate = weak[:, 1:] / weak[:, :1], rate / weak[:, 0]
    ends = len(base) + np.cumsum([0, *sizes])
    blocks = {
        name: mean[:, low:high] for name, low, high in zip(terms, ends[:-1], ends[1:], strict=True)
    }
    return Equation(min(DOMAINS, 0.5 * float(t[-1]) / half), rate, mean[:, : len(base)], blocks)


def _whole(parts: Sequence[Equation]) -> tuple[Array, Array, Array, Sequence[str]]:
    """Target, model and further columns of all captures, and the effect of each of the latter."""
    names = list(dict.fromkeys(name for part in parts for name in part.further))
    widths = {n: p.further[n].shape[1] for p in parts for n in p.further}
    target = np.concatenate([part.target for part in parts])
    base = np.concatenate([part.base for part in parts])
    further = [
        np.hstack([part.further.get(n, np.zeros((part.target.size, widths[n]))) for n in names])
        for part in parts
    ]
    return target, base, np.concatenate(further), [n for n in names for _ in range(widths[n])]


def _left(parts: Sequence[Equation]) -> list[Array]:
    """What the whole library leaves in each capture."""
    target, base, further, _ = _whole(parts)
    matrix = np.hstack([base, further])
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    left = target - matrix / scale @ np.linalg.lstsq(matrix / scale, target, rcond=1e-10)[0]
    return np.split(left, np.cumsum([part.target.size for part in parts])[:-1])


def _scatter(parts: Sequence[Equation]) -> float:
    """Logarithm of what the whole library leaves of the target."""
    power = sum(float(part.target @ part.target) for part in parts)
    return math.log(sum(float(one @ one) for one in _left(parts)) / power)


def _kept(parts: Sequence[Equation]) -> Sequence[str]:
    """Effects of the terms that are left at the best threshold."""
    from pysindy import STLSQ

    weight = np.concatenate(
        [np.full(one.size, 1.0 / max(float(np.std(one)), 1e-300)) for one in _left(parts)]
    )
    target, base, further, names = _whole(parts)
    q, _ = np.linalg.qr(base * weight[:, None])
    y, x = target * weight, further * weight[:, None]
    y, x = y - q @ (q.T @ y), x - q @ (q.T @ x)
    norm = np.linalg.norm(x, axis=0)
    there = norm > 1e-9 * np.linalg.norm(further * weight[:, None], axis=0)
    x, names = x[:, there] / norm[there], [n for n, on in zip(names, there, strict=True) if on]
    x *= float(np.linalg.norm(y))

    n = sum(part.independent for part in parts)

    def criterion(coefficients: Array) -> float:
        left = y - x @ coefficients
        return n * math.log(float(left @ left)) + math.log(n) * np.count_nonzero(coefficients)

    tried = [np.zeros(x.shape[1])]
    for threshold in THRESHOLDS:
        fit = STLSQ(threshold=threshold, alpha=RIDGE).fit(x, y[:, None])
        tried.append(np.asarray(fit.coef_)[0])
    best = min(tried, key=criterion)
    return [name for name, value in zip(names, best, strict=True) if value != 0.0]
