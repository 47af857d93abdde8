"""Terminal voltages and currents of a capture, whichever of the equivalent columns it holds."""

from __future__ import annotations

import numpy as np

from pipeline.records.capture import Array, Capture

PAIRS = ("ab", "bc", "ca")
UNALIGNED = (
    "rotor angle unknown: the low inductance is taken as d, as with interior magnets; a back-EMF "
    "or an alignment would show it"
)
"""What is said of both inductances where three pairs at one unknown angle gave them."""


def pair_of(capture: Capture) -> str | None:
    """The terminal pair of a two-terminal test.

    Parameters
    ----------
    capture
        Of one pair.

    Returns
    -------
    str or None
        `ab`, `bc` or `ca`: as stated, else of the only line voltage there.

    """
    if capture.meta.pair in PAIRS:
        return capture.meta.pair
    held = [pair for pair in PAIRS if capture.has(f"v{pair}_v")]
    return held[0] if len(held) == 1 else None


def voltage_columns(capture: Capture, pair: str) -> tuple[str, ...]:
    """The columns that give the voltage of a terminal pair.

    Parameters
    ----------
    capture
        Any capture.
    pair
        `ab`, `bc` or `ca`.

    Returns
    -------
    tuple of str
        The line voltage, else both phase voltages, else empty.

    """
    of_pair = (f"v{pair}_v",)
    phases = (f"v{pair[0]}_v", f"v{pair[1]}_v")
    return next((names for names in (of_pair, phases) if capture.has(*names)), ())


def current_columns(capture: Capture, pair: str) -> tuple[str, ...]:
    """The line currents of a terminal pair that a capture holds, the first terminal's first.

    Parameters
    ----------
    capture
        Any capture.
    pair
        `ab`, `bc` or `ca`.

    """
    return tuple(n for n in (f"i{pair[0]}_a", f"i{pair[1]}_a") if capture.has(n))


def pair_signals(capture: Capture, pair: str, *further: str) -> dict[str, Array]:
    """`t_s`, `v_v` and `i_a` [n] of one terminal pair, and `further` that the capture holds.

    The current is positive into the pair's first terminal; where both line currents are there,
    i = (i_first - i_second) / 2. Rows with a missing value in any of t, v, i are left out.
    Raises KeyError where a voltage or a current is missing.

    Parameters
    ----------
    capture
        Of one terminal pair, or of all three phases.
    pair
        `ab`, `bc` or `ca`.
    further
        Further columns, where they are there.

    Returns
    -------
    dict of array [n]
        `t_s` [s], `v_v` [V], `i_a` [A] and the others.

    Raises
    ------
    KeyError
        Where a voltage or a current is missing.

    """
    volts, amps = voltage_columns(capture, pair), current_columns(capture, pair)
    if not volts or not amps or not capture.has("t_s"):
        raise KeyError(f"{capture.path} holds no voltage and current of pair {pair}")
    extra = tuple(name for name in further if capture.has(name))
    columns = capture.arrays("t_s", *volts, *amps, *extra)
    v = columns[volts[0]] if len(volts) == 1 else columns[volts[0]] - columns[volts[1]]
    signs = [1.0 if name == f"i{pair[0]}_a" else -1.0 for name in amps]
    i = np.mean([sign * columns[name] for sign, name in zip(signs, amps, strict=True)], axis=0)
    keep = np.isfinite(columns["t_s"]) & np.isfinite(v) & np.isfinite(i)
    signals = {"t_s": columns["t_s"], "v_v": v, "i_a": i} | {name: columns[name] for name in extra}
    return {name: values[keep] for name, values in signals.items()}


def first_temperature(capture: Capture, *places: str) -> str | None:
    """The first of the temperature columns of these places that holds a finite value.

    Parameters
    ----------
    capture
        Where to look.
    places
        `winding`, `magnet`, `case` or `ambient`, in order of preference.

    Returns
    -------
    str or None
        The column's name, None where none of them holds a value.

    """
    for place in places:
        name = f"temp_{place}_degc"
        if capture.has(name) and np.isfinite(capture.arrays(name)[name]).any():
            return name
    return None


def bridged(t_s: Array, values: Array) -> Array:
    """A slow channel [n] at all times [n, s]: straight lines between its values, its ends held.

    A temperature before its first and after its last reading is that reading. As it was where no
    value is there.

    Parameters
    ----------
    t_s : array [n], s
        Times of all rows.
    values : array [n]
        NaN where the slow channel holds no reading.

    Returns
    -------
    array [n]
        In the unit of `values`.

    """
    finite = np.isfinite(values)
    if not finite.any():
        return values
    return np.interp(t_s, t_s[finite], values[finite])
