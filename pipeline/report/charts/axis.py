"""Axes of a chart: range, round ticks, unit with prefix, and the way from data to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.physics.glossary import unit_of
from pipeline.physics.notation import MINUS, Scale, scale_for
from pipeline.records.capture import Array
from pipeline.report.charts.svg import text
from pipeline.views.names import quantity_words

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_ANGLE_STEPS = (5.0, 10.0, 15.0, 30.0, 45.0, 60.0, 90.0, 180.0, 360.0)


@dataclass(frozen=True, slots=True)
class Axis:
    """A range [data unit] laid over pixels, `start` at `low` and `end` at `high`."""

    low: float
    high: float
    start: float
    end: float
    ticks: tuple[float, ...]
    scale: Scale
    title: str

    def pixels(self, values: Array) -> Array:
        """Where values [n, data unit] lie [n, px].

        Parameters
        ----------
        values
            The values [n, data unit].

        """
        return self.start + (values - self.low) * ((self.end - self.start) / (self.high - self.low))

    def pixel(self, value: float) -> float:
        """Where one value [data unit] lies [px].

        Parameters
        ----------
        value
            The value [data unit].

        """
        return float(self.pixels(np.array([value]))[0])

    def labels(self) -> tuple[str, ...]:
        """Text of the ticks, all with as many decimals as the finest needs."""
        shown = [self.scale.shown(tick) for tick in self.ticks]
        places = max((_decimals(number) for number in shown), default=0)
        return tuple(_tick_text(number, places) for number in shown)


def axis_for(name: str, low: float, high: float, start: float, end: float, count: int = 5) -> Axis:
    """An axis for a quantity named with its unit last, widened to hold a little air.

    `count` is about how many ticks there will be; a range of no width is opened around its value.

    Parameters
    ----------
    name
        Name of the quantity, ending in its unit.
    low
        Lower end [data unit].
    high
        Upper end [data unit].
    start
        Where the axis begins [px].
    end
        Where the axis ends [px].
    count
        About how many ticks there are.

    """
    low, high = _open(low, high)
    unit = unit_of(name)
    step = _step((high - low) / count, degrees=unit == "deg")
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    ticks = tuple(i * step for i in range(first, last + 1))
    scale = scale_for(max(abs(low), abs(high)), unit)
    return Axis(low, high, start, end, ticks, scale, f"{quantity_words(name)}{_bracket(scale)}")


def symmetric_axis(name: str, reach: float, start: float, end: float) -> Axis:
    """An axis from -reach to reach with three ticks, for residuals.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.
    reach
        Value at the ends [data unit].
    start
        Where the axis begins [px].
    end
        Where the axis ends [px].

    """
    reach = reach if reach > 0.0 and math.isfinite(reach) else 1.0
    step = _step(reach, degrees=False)
    step = step if step <= reach else _step(reach / 2, degrees=False)
    scale = scale_for(step, unit_of(name))
    title = f"measured {MINUS} fitted{_bracket(scale)}"
    return Axis(-reach, reach, start, end, (-step, 0.0, step), scale, title)


def padded(low: float, high: float, share: float = 0.05) -> tuple[float, float]:
    """The range with a share of its width added on both sides.

    Parameters
    ----------
    low
        Lower end [data unit].
    high
        Upper end [data unit].
    share
        Share of the width that is added on each side [1].

    """
    air = share * (high - low)
    return low - air, high + air


def _bracket(scale: Scale) -> str:
    return f" [{scale.unit.removeprefix('×')}]" if scale.unit else ""


def _open(low: float, high: float) -> tuple[float, float]:
    if high > low:
        return low, high
    half = 0.05 * abs(low) or 1.0
    return low - half, high + half


def _step(rough: float, *, degrees: bool) -> float:
    if degrees and rough <= _ANGLE_STEPS[-1] and rough > 1.0:
        return next(step for step in _ANGLE_STEPS if step >= rough)
    decade = 10.0 ** math.floor(math.log10(rough))
    return decade * next(step for step in _STEPS if step * decade >= rough * (1 - 1e-9))


def _decimals(number: float) -> int:
    text = f"{number:.6g}"
    return len(text.partition(".")[2]) if "e" not in text else 0


def _tick_text(number: float, places: int) -> str:
    text = f"{number:.{places}f}" if abs(number) < 1e7 else f"{number:.4g}"
    return text.replace("-", MINUS) if text.strip("-0.") else text.removeprefix("-")


def x_ticks(x: Axis, below: float, lines: tuple[float, float] | None = None) -> str:
    """Labels under a drawing that ends at `below` [px], with lines from the first to the second.

    Parameters
    ----------
    x
        The axis.
    below
        Where the drawing ends [px].
    lines
        From where to where lines go [px]; None for no lines.

    """
    return "".join(
        (f'<path class="grid" d="M{place:.1f} {lines[0]:.1f}V{lines[1]:.1f}"/>' if lines else "")
        + text("tick x", place, below + 15, label)
        for place, label in zip(x.pixels(np.array(x.ticks)).tolist(), x.labels(), strict=True)
    )


def y_ticks(y: Axis, left: float, right: float | None = None) -> str:
    """Labels left of a drawing that begins at `left` [px], with lines to `right`.

    Parameters
    ----------
    y
        The axis.
    left
        Where the drawing begins [px].
    right
        Where lines end [px]; None for no lines.

    """
    return "".join(
        (f'<path class="grid" d="M{left:.1f} {place:.1f}H{right:.1f}"/>' if right else "")
        + text("tick y", left - 5, place + 4, label)
        for place, label in zip(y.pixels(np.array(y.ticks)).tolist(), y.labels(), strict=True)
    )
