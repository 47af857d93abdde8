"""Where the type B uncertainty of a fit comes from: instruments that every sample shares.

An estimator states its data as a function of a `Shift` of each source; refitting under a shift of
one standard uncertainty gives that source's signed contribution, correlations and all. Reference:
GUM 5.1.3 note 2 (numerical sensitivity) and H.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.records.capture import UNSTATED_U, Array, Capture, CaptureMeta, Indices
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Budget, Contribution, propagate

Shift = Mapping[str, float]


def station(meta: CaptureMeta) -> str:
    """The name of the bench, `unknown` where the capture does not state it.

    Parameters
    ----------
    meta
        Metadata of a capture.

    """
    return meta.station or "unknown"


def voltage_source(meta: CaptureMeta) -> str:
    """The source of the gain error of a voltage reading.

    Parameters
    ----------
    meta
        Metadata of a capture.

    Returns
    -------
    str
        A commanded voltage is another instrument than a measured one.

    """
    kind = "voltage_commanded" if meta.voltage_kind == "commanded" else "voltage"
    return f"{kind}@{station(meta)}"


def current_source(meta: CaptureMeta) -> str:
    """The source of the gain error of a current reading.

    Parameters
    ----------
    meta
        Metadata of a capture.

    """
    return f"current@{station(meta)}"


def torque_source(meta: CaptureMeta) -> str:
    """The source of the gain error of a torque transducer.

    Parameters
    ----------
    meta
        Metadata of a capture.

    """
    return f"torque@{station(meta)}"


def temperature_source(meta: CaptureMeta) -> str:
    """The source of the offset of a thermometer.

    Parameters
    ----------
    meta
        Metadata of a capture.

    """
    return f"temperature@{station(meta)}"


def clock_source(meta: CaptureMeta) -> str:
    """The source of the error of a time base.

    Parameters
    ----------
    meta
        Metadata of a capture.

    """
    return f"clock@{station(meta)}"


SOURCES: Mapping[str, tuple[Callable[[CaptureMeta], str], str]] = {
    "voltage": (voltage_source, "u_rel_voltage"),
    "current": (current_source, "u_rel_current"),
    "temperature": (temperature_source, "u_temp_degc"),
    "torque": (torque_source, "u_rel_torque"),
    "clock": (clock_source, "u_rel_clock"),
}


def instrument_uncertainties(
    captures: Iterable[Capture], kinds: Iterable[str] = ("voltage", "current", "temperature")
) -> dict[str, float]:
    """Standard uncertainty of each source: relative for gains, [K] for temperatures.

    The largest that the captures of a station state; what is usual (`UNSTATED_U`) where none
    states it.

    Parameters
    ----------
    captures
        That a fit rests on.
    kinds
        Of instruments: keys of `SOURCES`.

    Returns
    -------
    dict of float
        By source, sorted.

    """
    requested = tuple(kinds)
    stated: dict[str, float] = {}
    usual: dict[str, float] = {}
    for capture in captures:
        for kind in requested:
            source_of, key = SOURCES[kind]
            source, u = source_of(capture.meta), getattr(capture.meta, key)
            usual[source] = UNSTATED_U[key]
            if u is not None:
                stated[source] = max(stated.get(source, 0.0), u)
    return dict(sorted((usual | stated).items()))


def shifted_offsets(shift: Shift, sources: Iterable[str], part: Indices) -> Array:
    """What a shift adds to each of n rows of several captures.

    Parameters
    ----------
    shift
        By source [unit of its readings, or 1 for a gain].
    sources
        One a capture.
    part
        Number of each row's capture [n].

    """
    return np.array([shift.get(source, 0.0) for source in sources])[part]


def shifted_gains(
    shift: Shift, captures: Sequence[Capture], part: Indices, *kinds: str
) -> tuple[Array, ...]:
    """The gains [n, 1] of some kinds of instruments, by rows of several captures.

    Parameters
    ----------
    shift
        By source, relative.
    captures
        By number.
    part
        Number of each row's capture [n].
    *kinds
        Keys of `SOURCES`.

    """
    metas = [capture.meta for capture in captures]
    return tuple(1.0 + shifted_offsets(shift, map(SOURCES[kind][0], metas), part) for kind in kinds)


def unstated_note(
    captures: Iterable[Capture], kinds: Iterable[str] = ("voltage", "current", "temperature")
) -> str:
    """Which `u_*` keys no capture states, or states as 0, in words.

    Parameters
    ----------
    captures
        Captures of one fit.
    kinds
        Keys of `SOURCES`: the instruments that the fit uses.

    Returns
    -------
    str
        Empty where every instrument's uncertainty is stated and above 0.

    """
    metas = [capture.meta for capture in captures]
    words = []
    for key in (SOURCES[kind][1] for kind in kinds):
        stated = {getattr(meta, key) for meta in metas} - {None}
        if not stated:
            unit = " K" if key == "u_temp_degc" else ""
            words.append(f"{key} not stated, taken as {UNSTATED_U[key]:g}{unit}")
        elif not any(stated):
            words.append(f"{key} stated as 0, as if the instrument had no error")
    return ", ".join(words)


def in_shares(
    uncertainties: Mapping[str, float], sources: Sequence[str], weights: Array
) -> dict[str, float]:
    """Uncertainties of instruments, each times the share of what it measured.

    Parameters
    ----------
    uncertainties
        By source.
    sources
        Of each part.
    weights
        Of each part, in any unit [n].

    Returns
    -------
    dict of float
        By source.

    """
    share = weights / np.sum(weights)
    return {
        source: u * float(share[[of_part == source for of_part in sources]].sum())
        for source, u in uncertainties.items()
    }


def contributions(
    evaluate: Callable[[Shift], Array], uncertainties: Mapping[str, float]
) -> list[list[Contribution]]:
    """For each of the k results of evaluate(shift) [k], the type B contribution of each source.

    `evaluate` refits with each source shifted by the amounts given (a relative gain error, an
    offset [K], whatever `uncertainties` counts); half the central difference of plus and minus
    one standard uncertainty is the signed contribution.

    Parameters
    ----------
    evaluate
        Gives the k results [k, their units] with each source shifted.
    uncertainties
        One standard uncertainty a source.

    Returns
    -------
    list of list of Contribution
        One list a result [its unit].

    References
    ----------
    JCGM 100:2008, 5.1.3 note 2 (numerical sensitivity).

    """
    size = evaluate({}).size
    budgets: list[list[Contribution]] = [[] for _ in range(size)]
    for source, u in sorted(uncertainties.items()):
        if u == 0.0:
            continue
        half = 0.5 * (evaluate({source: u}) - evaluate({source: -u}))
        for index in range(size):
            budgets[index].append(Contribution(source, float(half[index]), "B"))
    return budgets


def with_clock(estimate: Estimate, power: int, captures: Iterable[Capture]) -> Estimate:
    """The estimate with what the time bases of its captures may have made of it.

    A clock fast by a share g shows (1 + g)^power of the constant. The time bases of several
    stations count in full each: never too little. Reference: GUM 5.1.6, u(X)/X = p u(t)/t.

    Parameters
    ----------
    estimate
        A measured constant.
    power
        Of the clock in it.
    captures
        Whose time bases it rests on.

    """
    gains = instrument_uncertainties(captures, ("clock",))
    parts = [Contribution(name, power * estimate.number * u, "B") for name, u in gains.items()]
    return replace(estimate, budget=budget_of((*estimate.budget, *parts)))


def budget_of(parts: Iterable[Contribution]) -> Budget:
    """One part a source, parts of equal sources added with their signs (`propagate`), none of 0.

    Parameters
    ----------
    parts
        Contributions [unit of the estimate], in any order.

    Returns
    -------
    Budget
        Parts of equal sources added with their signs; parts that come to 0 left out.

    """
    return tuple(part for part in propagate([(1.0, tuple(parts))]) if part.u != 0.0)
