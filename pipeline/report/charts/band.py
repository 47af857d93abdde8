"""A dense trace as the band between its extremes: a curve drawn over itself would be one block."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.records.capture import Array
from pipeline.report.charts.svg import band, line

COLUMN_PX, FEWEST_A_COLUMN, LEAST_HEIGHT_PX = 1.5, 4.0, 8.0
"""Width of a column; samples in one on average and median height, from which on it is dense."""
GAP_COLUMNS = 3.0
"""Columns from one to the next, beyond which there is a gap."""


def extremes(x_px: Array, y_px: Array) -> tuple[Array, Array, Array] | None:
    """Middle, top and bottom [C, px] of the columns of a dense trace; None for any other.

    `x_px`, `y_px` are [n], x rising; samples that are not finite are left out.

    Parameters
    ----------
    x_px
        Places across [n, px], rising.
    y_px
        Places down [n, px].

    """
    fine = np.isfinite(x_px) & np.isfinite(y_px)
    x, y = x_px[fine], y_px[fine]
    if x.size < 2 or np.any(np.diff(x) < 0.0):
        return None
    column = np.floor(x / COLUMN_PX)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1])
    if x.size < FEWEST_A_COLUMN * starts.size:
        return None
    top, bottom = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    if float(np.median(bottom - top)) < LEAST_HEIGHT_PX:
        return None
    return (column[starts] + 0.5) * COLUMN_PX, top, bottom


def filled(x_px: Array, y_px: Array) -> str:
    """The path of the band, closed between its gaps; empty where the trace is not dense.

    Parameters
    ----------
    x_px
        Places across [n, px], rising.
    y_px
        Places down [n, px].

    """
    return "".join(
        band(x.tolist(), top.tolist(), bottom.tolist()) for x, top, bottom in _runs(x_px, y_px)
    )


def outlined(x_px: Array, y_px: Array) -> str:
    """The path of the band's two edges, so that another shows through; empty as above.

    Parameters
    ----------
    x_px
        Places across [n, px], rising.
    y_px
        Places down [n, px].

    """
    return "".join(line(x, top) + line(x, bottom) for x, top, bottom in _runs(x_px, y_px))


def _runs(x_px: Array, y_px: Array) -> Iterator[tuple[Array, Array, Array]]:
    """The band's columns from gap to gap."""
    ends = extremes(x_px, y_px)
    if ends is None:
        return
    cuts = np.flatnonzero(np.diff(ends[0]) > GAP_COLUMNS * COLUMN_PX) + 1
    parts = (np.split(one, cuts) for one in ends)
    yield from zip(*parts, strict=True)
