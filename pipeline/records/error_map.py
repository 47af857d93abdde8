"""Where an error lives: its mean over cells of one or two variables, and how sure that is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.records.field_kinds import Keyword, Name, Share, ShareOrNull
from pipeline.records.plain_form import PlainRecord

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bins(PlainRecord):
    """The cells of one variable.

    Attributes
    ----------
    variable
        Glossary name.
    edges
        Ascending [the variable's unit]: cell n runs from edge n to edge n + 1.

    """

    variable: Name
    edges: Annotated[tuple[float, ...], Keyword("minItems", 2)]

    @property
    def count(self) -> int:
        """Cells."""
        return len(self.edges) - 1


@dataclass(frozen=True, slots=True)
class ErrorMap(PlainRecord):
    """Mean error of one signal over cells of one variable, or of two.

    Attributes
    ----------
    signal, unit
        Glossary name and unit of the signal.
    x, y
        Cells of the variables; `y` is None for a map of one variable.
    count
        Samples of each cell, [X] or [Y, X].
    mean
        Mean error of each cell [unit], NaN for a cell without samples.
    p_value
        Chance of a mean this far from zero, NaN where there are too few visits to a cell.
    explained
        Share of the error's variance that lies between the cells [1].
    p_map
        Chance of means this far from each other.

    """

    signal: Name
    unit: str
    x: Bins
    y: Bins | None
    count: NDArray[np.int64]
    mean: Array
    p_value: Array
    explained: Share
    p_map: ShareOrNull

    @property
    def variables(self) -> tuple[str, ...]:
        """The one variable, or those of x and y."""
        return tuple(bins.variable for bins in (self.x, self.y) if bins is not None)

    @property
    def reach(self) -> float:
        """The largest mean, without its sign [unit]; 0 where no cell has one."""
        finite = np.abs(self.mean[np.isfinite(self.mean)])
        return float(finite.max()) if finite.size else 0.0

    def document(self) -> dict[str, Any]:
        """The JSON form: null where a number is not there."""
        return {
            "signal": self.signal,
            "unit": self.unit,
            "x": self.x.document(),
            "y": None if self.y is None else self.y.document(),
            "count": self.count.tolist(),
            "mean": _nulls(self.mean.tolist()),
            "p_value": _nulls(self.p_value.tolist()),
            "explained": self.explained,
            "p_map": None if math.isnan(self.p_map) else self.p_map,
        }


@dataclass(frozen=True, slots=True)
class Histogram(PlainRecord):
    """How often the error of a signal takes a value.

    Attributes
    ----------
    signal
        Glossary name.
    edges
        Of the bins [H + 1], in noise floors.
    count
        Errors of each bin [H]; those beyond the last edges are counted in the outermost bins.

    """

    signal: str
    edges: tuple[float, ...]
    count: tuple[int, ...]


def _nulls(nested: Any) -> Any:
    if isinstance(nested, list):
        return [_nulls(one) for one in nested]
    return None if math.isnan(nested) else nested
