"""What a fit looked at, kept for the report and the recording: measured beside fitted."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

PlotKind = Literal["line", "scatter", "bars"]


@dataclass(frozen=True, slots=True)
class Series:
    """One measured curve with its fit; the residual is `measured` less `fitted`.

    Attributes
    ----------
    label
        Distinguishes the series of one plot.
    x
        [n, unit of the plot's `x_name`].
    measured
        [n, unit of the plot's `y_name`].
    fitted
        [n], or empty where there is no fit.
    before
        [n], what an earlier fit made; empty where there was none.

    """

    label: str
    x: NDArray[np.float64]
    measured: NDArray[np.float64]
    fitted: NDArray[np.float64]
    before: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True, slots=True)
class Evidence:
    """One plot of one estimator.

    Attributes
    ----------
    estimator, title
        Its name, and what the plot shows.
    x_name, y_name
        Glossary names, unit last. Where `x_name` is `t_s` and `capture` is set, the series are
        traces of that capture and `y_name` is its column; a recording shows them on its time line
        too.
    kind
        `line`, `scatter` or `bars`.
    series
        The curves.
    capture
        The capture that is shown, None for several.
    caption
        Text below the plot.

    """

    estimator: str
    title: str
    x_name: str
    y_name: str
    kind: PlotKind
    series: tuple[Series, ...]
    capture: str | None = None
    caption: str = ""
