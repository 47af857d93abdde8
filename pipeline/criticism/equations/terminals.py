"""Two terminals of a rotor at rest: resistance steps, and current steps at a known angle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import PAIR_RAD, Segment, segment_of
from pipeline.criticism.data.sensors import prepared
from pipeline.criticism.data.traces import even_clock, window_between_gaps
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Recorded, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.true_current import true_current
from pipeline.criticism.signals.true_state import at_rest, operating
from pipeline.criticism.signals.voltage import central, recorded_voltage
from pipeline.numerics.projection import Projection, projection, window_starts
from pipeline.records.capture import Capture


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Voltage and current of one pair of terminals of a rotor at rest.

    Parameters
    ----------
    capture
        A resistance test, a heat run, or a current step at a stated angle.
    machine
        Policy.

    Returns
    -------
    Segment or None
        None without a pair, a current of it, or the angle of a current step. Of a resistance test
        or heat run only the settled windows are used, of a step those clear of its edges.

    """
    recorded = _pair_and_current(capture)
    place, stepped = capture.meta.theta_elec_deg, capture.meta.test == "current_step"
    if recorded is None or (stepped and place is None):
        return None
    pair, current = recorded
    sign = 1.0 if current[1] == pair[0] else -1.0
    extra = ["temp_winding_degc"] if capture.has("temp_winding_degc") else []
    policy = machine.policy.cutting
    period, columns, keep = even_clock(capture, (f"v{pair}_v", current, *extra), policy)
    volts, amps = columns.pop(f"v{pair}_v"), sign * columns.pop(current)
    columns = {"v_pair_v": volts, "i_pair_a": amps, **columns}
    sensors = prepared(columns, period, machine.policy)
    fixed = {"pair_rad": PAIR_RAD[pair], "phase": float("abc".index(current[1]))}
    if stepped and place is not None:
        fixed["theta_elec_rad"] = math.radians(place)
        edges = np.abs(np.diff(volts)) > policy.change_u * sensors.noise["v_pair_v"]
        keep[:-1] &= ~edges
        keep[1:] &= ~edges
        window = max(min(round(policy.step_window_s / period), keep.size // 4), policy.least_window)
    else:
        # two windows in the longest level, where a multimeter took few rows of each
        jumps = np.abs(np.diff(amps)) > policy.change_u * sensors.noise["i_pair_a"]
        longest = int(np.diff(np.flatnonzero(np.concatenate([[True], jumps, [True]]))).max())
        window = min(window_between_gaps(period, keep, policy), longest // 2)
        window = max(window, policy.least_window)
    weak = projection(np.zeros(keep.size), window_starts(keep, window), window, ())
    if not stepped:
        weak = _settled(weak, amps, policy.change_u * sensors.noise["i_pair_a"])
    return segment_of(
        capture,
        "terminal",
        "bench",
        period,
        columns,
        sensors,
        channels=("v_pair_v",),
        weak=weak,
        fixed=fixed,
    )


def _pair_and_current(capture: Capture) -> tuple[str, str] | None:
    """The pair of terminals with a voltage, and the column of a current through it."""
    pairs = [one for one in PAIR_RAD if capture.has(f"v{one}_v")]
    pair = capture.meta.pair or (pairs[0] if len(pairs) == 1 else None)
    if pair is None or not capture.has(f"v{pair}_v"):
        return None
    current = next((n for n in (f"i{pair[0]}_a", f"i{pair[1]}_a") if capture.has(n)), None)
    return None if current is None else (pair, current)


def _settled(weak: Projection, amps: Array, change_a: float) -> Projection:
    """The windows in which the current does not move: there the inductance does not matter."""
    spread = np.array([np.ptp(amps[s : s + weak.length]) for s in weak.starts])
    steady = spread < max(change_a, 1e-11)
    return weak.only(steady)


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True current [n] of a rotor at rest.

    Parameters
    ----------
    segment
        The capture, on its true clock.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The state [n] of a rotor at rest.

    Notes
    -----
    i = (2/√3) i_pair e^{j(pair − 30° − ε)}: a current through two terminals, the third without.

    """
    n = signals["i_pair_a"].size
    zero, eps = np.zeros(n), np.full(n, segment.fixed.get("theta_elec_rad", 0.0))
    stationary = (
        2
        / math.sqrt(3)
        * signals["i_pair_a"]
        * np.exp(1j * (segment.fixed["pair_rad"] - math.pi / 6))
    )
    phase = int(segment.fixed["phase"])
    by = segment.instrument
    bench = Recorded(stationary, zero, eps, zero, segment.ts_s, False, by.name, phase)
    current = true_current(bench, by.ammeter, model, values) * np.exp(-1j * eps)
    return replace(operating(segment, signals, model, values, current, at_rest(n)), eps_rad=eps)


def measured(_: Segment, signals: Signals, __: Model, ___: Values) -> Array:
    """The pair's voltage [1, n, V]."""
    return signals["v_pair_v"][None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The pair's voltage [1, n, V].

    Parameters
    ----------
    segment
        The capture, on its true clock.
    x
        True state [n].
    pieces
        Flux and drops of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In V.

    Notes
    -----
    √3 Re[(R i + drops + dψ/dt) e^{j(ε + 30° − pair)}], the rotor at rest; `pair` is where the
    pair's line voltage stands beside that of ab.

    """
    frame = x.once(x.eps_rad, "turn", lambda: np.exp(1j * x.eps_rad))
    stationary = (pieces.drop_v + central(pieces.psi_wb, segment.ts_s)) * frame
    stationary = recorded_voltage(stationary, segment, x, model, values)
    turn = np.exp(1j * (math.pi / 6 - segment.fixed["pair_rad"]))
    voltage: Array = math.sqrt(3) * (stationary * turn).real
    return voltage[None]


EQUATION = Equation(
    name="terminal",
    words="v_pair = √3 Re[(R i + drops + dψ/dt) e^{j(ε + 30° − pair)}] at rest",
    tests=("resistance", "current_step", "heat_run"),
    columns=("t_s",),
    channels=(Channel("v_pair_v", offset="voltmeter"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("r_ohm", "ld_h", "lq_h"),
        hooks=frozenset({"flux", "drop"}),
        sensors=frozenset({"current", "voltage", "clock"}),
    ),
    recorder="step",
    use=Use(warms=frozenset({"drop"}), at_rest=True),
)
