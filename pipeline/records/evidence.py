"""What a fit looked at, kept for the report and the recording: measured beside fitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

PlotKind = Literal["line", "scatter", "bars"]


@dataclass(frozen=True, slots=True)
class Series:
    """One measured curve with its fit: `x`, `measured`, `fitted` are [n]; `fitted` may be empty.

    The residual is measured - fitted. `label` distinguishes the series of one plot.
    """

    label: str
    x: NDArray[np.float64]
    measured: NDArray[np.float64]
    fitted: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Evidence:
    """One plot of one estimator. `x_name` and `y_name` are glossary names (unit last).

    Where `x_name` is `t_s` and `capture` is set, the series are traces of that capture, `y_name`
    is the measured column, and the recording shows them on its time line as well.
    """

    estimator: str
    title: str
    x_name: str
    y_name: str
    kind: PlotKind
    series: tuple[Series, ...]
    capture: str | None = None
    caption: str = ""
