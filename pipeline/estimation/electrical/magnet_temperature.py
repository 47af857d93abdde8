"""The temperature of the magnets: by their thermometer, else by what is near them."""

from __future__ import annotations

from collections.abc import Iterable

from pipeline.estimation.electrical.terminals import first_temperature
from pipeline.estimation.policy import policy
from pipeline.estimation.uncertainty.instruments import instrument_uncertainties, temperature_source
from pipeline.records.capture import Capture

UNLOGGED = "assumed:temp_magnet_degc"
NEAR = ("winding", "case")
"""Places that are about as warm as the magnets while no current flows."""
UNPOWERED = ("open_circuit", "hand_turn")


def magnet_column(capture: Capture) -> str | None:
    """The column that stands for the temperature of the magnets.

    Parameters
    ----------
    capture
        Any capture.

    Returns
    -------
    str or None
        `temp_magnet_degc`; in tests without current also the winding's or the case's, which are
        about as warm then. None where no such column holds a value.

    """
    proxies = NEAR if capture.meta.test in UNPOWERED else ()
    return first_temperature(capture, "magnet", *proxies)


def assumed_temperature(capture: Capture, otherwise_degc: float = 25.0) -> float:
    """The temperature of the magnets where nothing records it.

    Parameters
    ----------
    capture
        A capture without a column of `magnet_column`.
    otherwise_degc
        What is taken where the capture states no ambient temperature.

    Returns
    -------
    float
        The ambient temperature of the metadata, else `otherwise_degc`.

    """
    ambient = capture.meta.ambient_degc
    return otherwise_degc if ambient is None else ambient


def magnet_source(capture: Capture) -> str:
    """The source of the error of the magnets' temperature in a capture.

    Parameters
    ----------
    capture
        Any capture.

    Returns
    -------
    str
        The thermometer of the station; else a source that all captures of a test share, since they
        were recorded one after the other.

    """
    column = magnet_column(capture)
    if column == "temp_magnet_degc":
        return temperature_source(capture.meta)
    return f"{UNLOGGED}:{capture.meta.test}:{column or 'ambient'}"


def magnet_uncertainties(captures: Iterable[Capture]) -> dict[str, float]:
    """Standard uncertainty [K] of each source of `magnet_source`, sorted.

    Parameters
    ----------
    captures
        That a fit rests on.

    Returns
    -------
    dict of float
        By source: of thermometers what captures state, of what stands in for one the policy's.

    """
    captures = tuple(captures)
    logged = [c for c in captures if magnet_column(c) == "temp_magnet_degc"]
    u_k = instrument_uncertainties(logged, ("temperature",))
    for capture in captures:
        column = magnet_column(capture)
        if column != "temp_magnet_degc":
            magnet = policy().magnet
            u_k[magnet_source(capture)] = magnet.elsewhere_k if column else magnet.unlogged_k
    return dict(sorted(u_k.items()))


def unlogged_note(captures: Iterable[Capture]) -> str:
    """Where the temperature of the magnets is assumed, in words.

    Parameters
    ----------
    captures
        Captures of one fit.

    Returns
    -------
    str
        Empty where a thermometer of the magnets recorded all of them.

    """
    unlogged = {}
    for capture in captures:
        column = magnet_column(capture)
        if column != "temp_magnet_degc":
            size = policy().magnet.elsewhere_k if column else policy().magnet.unlogged_k
            unlogged[column or "ambient"] = f"{column or 'ambient temperature'} ± {size:g} K"
    if not unlogged:
        return ""
    return f"temp_magnet_degc not logged, magnets taken at {', '.join(unlogged.values())}"
