"""True currents: what the current sensors recorded, less their effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Complex, Recorded, Signals, Values, between
from pipeline.criticism.signals.angle_sensor import both_axes
from pipeline.criticism.signals.between_rows import Waves, at_parts, evenly

WAVES, HOLD_ENDS = "waves", "hold_ends"
"""Places between rows: even ones, and where a vector that is held begins and ends."""


def drive_current(
    segment: Segment, signals: Signals, model: Model, values: Values, size: int
) -> Complex:
    """True current of a drive's log.

    Parameters
    ----------
    segment
        The log.
    signals
        Recorded columns [n].
    model
        Effects of the current sensors.
    values
        Parameters by full name.
    size
        Points wanted; beyond the samples, waves of the angle on straight lines between them.

    Returns
    -------
    array [size], complex
        d + jq [A].

    """
    current = _at_rows(segment, signals, model, values)
    if size == current.size:
        return current
    return current_between(segment, current, model, evenly(size // current.size))


def _at_rows(segment: Segment, signals: Signals, model: Model, values: Values) -> Complex:
    """True current [n, A] of a drive's log at its rows."""
    recorded = _recorded(segment, signals, model)
    zero = values["zero_alpha_a"] + 1j * values["zero_beta_a"]
    if zero and both_axes(segment):
        eps, theta, pairs = recorded.eps_rad, signals["theta_mech_rad"], model.machine.pole_pairs
        back = segment.once(theta, "back", pairs, lambda: np.exp(-1j * eps))
        recorded = replace(recorded, i_a=recorded.i_a - zero * back)
    return true_current(recorded, segment.instrument.ammeter, model, values)


def current_between(
    segment: Segment,
    current: Complex,
    model: Model,
    parts: tuple[float, ...],
    name: str = WAVES,
) -> Complex:
    """A log's current between its rows: straight lines, and waves of the angle on them.

    Parameters
    ----------
    segment
        The log.
    current
        At its rows [n, A].
    model
        Pole pairs and policy.
    parts
        Where points are behind each row [p, rows].
    name
        Of these places; what they take is computed once for each name.

    Returns
    -------
    array [n p], complex
        By row, in A.

    """
    signals, pairs, policy = segment.recorded, model.machine.pole_pairs, model.policy.ripple
    theta = signals["theta_mech_rad"]

    def made() -> Waves:
        recorded = _recorded(segment, signals, model).i_a
        return Waves.of(segment, recorded, pairs * theta, parts, policy)

    waves = segment.once(theta, name, (parts, pairs, policy), made)
    lines = at_parts(current, parts)
    return lines + waves.added(current, lines.size) if segment.instrument.waves else lines


def ripples(segment: Segment) -> bool:
    """Whether the rows of a log show waves of its current, where it was looked at between them.

    Parameters
    ----------
    segment
        The log.

    """
    known = (segment.cache.get(name) for name in (WAVES, HOLD_ENDS))
    return any(bool(one[2].fit.any()) for one in known if one is not None)


def unseen_waves(segment: Segment, size: int) -> Complex | None:
    """Waves of a log's current whose size its rows do not show (`Waves.unseen`).

    Parameters
    ----------
    segment
        A log that was looked at between its rows.
    size
        Points.

    Returns
    -------
    array [o, size], complex, or None
        In A of the q axis; None where no such wave was looked for.

    """
    known = segment.cache.get(WAVES)
    if known is None or not segment.instrument.waves:
        return None
    return known[2].unseen(_complex_current(segment), size)


def unseen_slopes(segment: Segment, pole_pairs: int) -> Complex | None:
    """How fast waves may change a log's current whose size its rows do not show.

    Parameters
    ----------
    segment
        A log that was looked at between its rows.
    pole_pairs
        Turns the angle into an electrical one.

    Returns
    -------
    array [o, n], complex, or None
        In A/s of the q axis, times a phase that is not known (`Waves.unseen_slopes`); None where no
        wave was looked for.

    """
    known = segment.cache.get(HOLD_ENDS) or segment.cache.get(WAVES)
    if known is None or not segment.instrument.waves:
        return None
    eps_rad = pole_pairs * segment.recorded["theta_mech_rad"]
    slopes: Complex = known[2].unseen_slopes(_complex_current(segment), eps_rad) / segment.ts_s
    return slopes


def _complex_current(segment: Segment) -> Complex:
    i_q = segment.recorded["iq_a"]
    return segment.recorded.get("id_a", np.zeros(i_q.size)) + 1j * i_q


def table_current(
    segment: Segment,
    current: Complex,
    eps_rad: Array,
    omega_e_rad_s: Array,
    model: Model,
    values: Values,
) -> Complex:
    """True current of the rows of a table.

    Parameters
    ----------
    segment
        The table.
    current
        Recorded, complex [n, A].
    eps_rad
        Electrical angle [n].
    omega_e_rad_s
        Electrical speed [n].
    model
        Effects of the current sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [n], complex
        In A.

    """
    nothing = np.zeros(current.size)
    recorded = Recorded(
        current, nothing, eps_rad, omega_e_rad_s, segment.ts_s, False, segment.instrument.name
    )
    return true_current(recorded, segment.instrument.ammeter, model, values)


def _recorded(segment: Segment, signals: Signals, model: Model) -> Recorded:
    theta, pairs = signals["theta_mech_rad"], model.machine.pole_pairs

    def turning() -> tuple[Array, Array]:
        eps = pairs * theta
        return eps, np.gradient(eps, segment.ts_s)

    eps, omega = segment.once(theta, "turning", (segment.ts_s, pairs), turning)
    return Recorded(
        i_a=signals.get("id_a", np.zeros(theta.size)) + 1j * signals["iq_a"],
        torque_nm=signals.get("torque_shaft_nm", np.zeros(theta.size)),
        eps_rad=eps,
        omega_e_rad_s=omega,
        ts_s=segment.ts_s,
        inverter=True,
        instrument=segment.instrument.name,
        ahead=ahead_in(segment, signals, model.machine.pole_pairs),
        analysed=bool(segment.fixed.get("measured")),
    )


def ahead_in(
    segment: Segment, signals: Signals, pole_pairs: int
) -> Callable[[float], tuple[Complex, Array, Array]] | None:
    """Changes of currents, torque and angle within a delay, from the whole log of a segment.

    Parameters
    ----------
    segment
        On its true clock; its `unthinned` part holds the whole log.
    signals
        Recorded columns [n].
    pole_pairs
        Turns the angle into an electrical one.

    Returns
    -------
    callable or None
        delay [s] -> changes of complex current [n, A], torque [n, N·m] and electrical angle [n,
        rad]; None where nothing was thinned.

    """
    log, rows = segment.unthinned.late, segment.recorded.get("t_s")
    if not log or rows is None:
        return None
    at: Array | None = segment.once(rows, "places", None, lambda: _places(rows))
    if at is None:
        return None
    places = at.astype(np.int64)

    def whole() -> tuple[Array, Array]:
        columns = np.stack(list(log.values()))
        return columns, columns.take(places, axis=-1, mode="clip")

    columns, now = segment.once(rows, "whole", None, whole)

    def ahead(delay_s: float) -> tuple[Complex, Array, Array]:
        later = between(columns, at + delay_s / segment.ts_s)
        change = dict(zip(log, later - now, strict=True))
        zero = np.zeros(at.size)
        current = change.get("id_a", zero) + 1j * change.get("iq_a", zero)
        return current, change.get("torque_shaft_nm", zero), pole_pairs * change["theta_mech_rad"]

    return ahead if at.size == next(iter(signals.values())).size else None


def _places(rows: Array) -> Array | None:
    """Places [n] of times [n, s] on the even clock that they were taken from."""
    steps = np.diff(rows)
    if not (steps > 0.0).any():
        return None
    return np.rint(rows / float(np.median(steps[steps > 0.0])))


def true_current(recorded: Recorded, ammeter: str, model: Model, values: Values) -> Complex:
    """True complex current of a recorded one: gain and effects of its sensors taken out.

    Parameters
    ----------
    recorded
        Recorded signals [n].
    ammeter
        Nuisance that is the gain of the instrument.
    model
        Effects of the current sensors, taken out in their order.
    values
        Parameters by full name.

    Returns
    -------
    array [n], complex
        In A.

    """
    gain = 1.0 / (1.0 + values[ammeter])
    ahead = recorded.ahead
    recorded = replace(recorded, i_a=gain * recorded.i_a)
    if ahead is not None:

        def scaled(delay_s: float) -> tuple[Complex, Array, Array]:
            current, torque, turned = ahead(delay_s)
            return gain * current, torque, turned

        recorded = replace(recorded, ahead=scaled)
    for current, q in model.hooks("current", values):
        recorded = replace(recorded, i_a=current(recorded, q))
    return recorded.i_a
