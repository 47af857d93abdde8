"""Clocks that a table writes as date and time of day."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.records.errors import CaptureError

_NANOSECONDS_A_SECOND = 1e9
_DAY_S = 86400.0


def instants(texts: Any, form: str) -> Any:
    """Date and time of day of texts [rows], null where one is not of the form.

    Parameters
    ----------
    texts
        polars series of texts [rows].
    form
        In the letters of strptime; without a day all are of one.

    """
    if "%d" not in form:
        texts, form = "1970-01-01 " + texts, f"%Y-%m-%d {form}"
    return texts.str.to_datetime(form, time_unit="ns", strict=False)


def seconds_of(texts: Any, name: str, form: str) -> NDArray[np.float64]:
    """Seconds from the first row [rows]; a time of day goes on past midnight.

    Parameters
    ----------
    texts
        The texts of a column [rows].
    name
        Name of the column, for messages.
    form
        Name of the form of time.

    Raises
    ------
    CaptureError
        A text that is not of the form.

    """
    times = instants(texts, form)
    wrong = np.flatnonzero((times.is_null() & texts.is_not_null()).to_numpy())
    if wrong.size:
        row = int(wrong[0])
        raise CaptureError(
            "bad_number",
            f"the column {name!r} holds {str(texts[row])[:40]!r}, which is no {form!r}",
            "correct `layout.instant` in the source map",
            (row, int(wrong[-1])),
        )
    seconds = (times - times.drop_nulls().first()).dt.total_nanoseconds() / _NANOSECONDS_A_SECOND
    numbers: NDArray[np.float64] = seconds.fill_null(float("nan")).to_numpy()
    if "%d" in form:
        return numbers
    return np.unwrap(numbers, period=_DAY_S) if np.isfinite(numbers).all() else numbers
