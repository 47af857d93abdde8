"""Fewer points, same picture: what a screen cannot resolve is left out, no extreme is lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def line_points(y: Array, limit: int) -> Indices:
    """Rows of a curve that a drawing needs: of each bucket its extremes.

    Parameters
    ----------
    y
        Curve [n, any unit]; NaN is a gap.
    limit
        Most points, or so.

    Returns
    -------
    array
        Rising row numbers. All rows where there are up to `limit`; else at most `limit` + 2 of a
        curve without gaps, and one more a bucket with a gap.

    Notes
    -----
    The curve is cut into limit/2 buckets of equal length. Of each the least and the greatest value
    stay, and the first NaN, so that a gap remains a gap; the two ends stay too.

    """
    if y.size <= limit:
        return np.arange(y.size, dtype=np.intp)
    edges = np.linspace(0, y.size, max(limit // 2, 1) + 1).astype(np.intp)
    width = int(np.diff(edges).max())
    rows = np.minimum(edges[:-1, None] + np.arange(width), edges[1:, None] - 1)
    block = y[rows]
    gap = np.isnan(block)
    lowest = np.where(gap, np.inf, block).argmin(axis=1)
    highest = np.where(gap, -np.inf, block).argmax(axis=1)
    bucket = np.arange(rows.shape[0])
    picked = [rows[bucket, lowest], rows[bucket, highest]]
    if gap.any():
        holed = np.flatnonzero(gap.any(axis=1))
        picked.append(rows[holed, gap[holed].argmax(axis=1)])
    ends = np.array([0, y.size - 1], dtype=np.intp)
    return np.unique(np.concatenate([*picked, ends]))


def cloud_points(x_px: Array, y_px: Array, cell_px: float) -> Indices:
    """Points of a cloud that fall in different cells of a grid, the first of each cell.

    Parameters
    ----------
    x_px, y_px
        Where the points are drawn [n, pixel]; points that are not finite are left out.
    cell_px
        Side of a cell [pixel].

    Returns
    -------
    array
        Rising indices of the points.

    """
    finite = np.flatnonzero(np.isfinite(x_px) & np.isfinite(y_px))
    column = np.floor(x_px[finite] / cell_px).astype(np.int64)
    row = np.floor(y_px[finite] / cell_px).astype(np.int64)
    _, first = np.unique(column * 1_000_003 + row, return_index=True)
    return finite[np.sort(first)]
