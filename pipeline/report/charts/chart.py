"""One evidence as inline SVG: measured under fitted, and what is left over below, on one x axis.

Hand-assembled, since a page of fourteen charts through a chart library costs seconds. Colours
are CSS classes, so that a page in light, dark or print styles them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import takewhile
from pathlib import PurePosixPath

import numpy as np

from pipeline.numerics.thinning import cloud_points, line_points
from pipeline.physics.glossary import unit_of
from pipeline.physics.notation import quantity
from pipeline.records.capture import Array
from pipeline.records.evidence import Evidence, Series
from pipeline.report.charts.axis import Axis, axis_for, padded, symmetric_axis, x_ticks, y_ticks
from pipeline.report.charts.band import filled, outlined
from pipeline.report.charts.svg import text

WIDTH, TOP, LEFT, RIGHT, BOTTOM = 640.0, 24.0, 62.0, 14.0, 38.0
MAIN, GAP, RESIDUAL, LABELS = 210.0, 34.0, 70.0, 124.0
MOST_LABELS, LABEL_PITCH, LABEL_CHARS = 8, 16.0, 13
FILES = frozenset({".mcap", ".csv", ".txt", ".tsv", ".log"})
LINE_LIMIT = 600
FEW_DOTS = 150
PALETTE = 6
FAR_OUT = 9.0
"""Medians of the residual's size, about six standard deviations, beyond which a sample is far."""
FEWEST = 5
"""Differences of neighbours from which on their noise counts as known."""


@dataclass(frozen=True, slots=True)
class Panel:
    """Two axes over one rectangle of the drawing."""

    x: Axis
    y: Axis

    def place(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Pixels of points [n].

        Parameters
        ----------
        x
            Places across [n, data unit].
        y
            Places down [n, data unit].

        """
        return self.x.pixels(x), self.y.pixels(y)


def chart(evidence: Evidence) -> str:
    """The SVG element of one evidence; a paragraph instead where no sample is finite.

    Every series with a fit gets its residual in the lower panel, whose band is two standard
    deviations of the point-to-point noise. Paths carry class and label for the page's read-out.

    Parameters
    ----------
    evidence
        Measured and fitted samples of one plot.

    """
    ranges = _ranges(evidence)
    if ranges is None:
        return '<p class="empty">no finite samples to draw</p>'
    scale = residual_scale(evidence.series)
    labelled = 1 < len(evidence.series) <= MOST_LABELS
    right = WIDTH - (LABELS if labelled else RIGHT)
    (x_low, x_high), (y_low, y_high) = ranges
    x = axis_for(evidence.x_name, x_low, x_high, LEFT, right, 6)
    main = Panel(x, axis_for(evidence.y_name, y_low, y_high, TOP + MAIN, TOP))
    body = [_frame(main), *_main_marks(evidence, main)]
    if labelled:
        body += _end_labels(evidence.series, main)
    bottom = TOP + MAIN
    if scale is not None:
        bottom += GAP + RESIDUAL
        below = Panel(
            x, symmetric_axis(evidence.y_name, _reach(evidence, scale), bottom, bottom - RESIDUAL)
        )
        body += [_frame(below), *_residual_marks(evidence, below, scale)]
    body.append(_x_axis(x, bottom))
    height = bottom + BOTTOM
    return (
        f'<svg class="chart" viewBox="0 0 {WIDTH:g} {height:g}" role="img" '
        f'aria-label="{escape(_spoken(evidence, scale))}" {_geometry(main, bottom)}>'
        f"{''.join(body)}</svg>"
    )


def _ranges(evidence: Evidence) -> tuple[tuple[float, float], tuple[float, float]] | None:
    xs = _finite(one.x for one in evidence.series)
    ys = _finite(y for one in evidence.series for y in (one.measured, one.fitted, one.before))
    if xs.size == 0 or ys.size == 0:
        return None
    x_range = float(xs.min()), float(xs.max())
    y_range = float(ys.min()), float(ys.max())
    if evidence.kind == "line":
        return x_range, padded(*y_range)
    if evidence.kind == "scatter":
        return padded(*x_range, 0.03), padded(*y_range)
    half = _bar_pitch(xs) / 2
    low, high = min(y_range[0], 0.0), max(y_range[1], 0.0)
    air = 0.05 * (high - low)
    x_range = x_range[0] - half, x_range[1] + half
    return x_range, (low - air if low < 0 else low, high + air if high > 0 else high)


def _finite(arrays: Iterable[Array]) -> Array:
    joined: Array = np.concatenate([np.empty(0), *arrays])
    return joined[np.isfinite(joined)]


def _bar_pitch(xs: Array) -> float:
    distinct = np.unique(xs)
    return float(np.diff(distinct).min()) if distinct.size > 1 else 1.0


def _reach(evidence: Evidence, scale: ResidualScale) -> float:
    """Half the height of the residual's axis: all of it, but for one sample in a hundred at most
    that lies far out; those are drawn at the edge.
    """
    both = (of(one) for one in evidence.series for of in (residual_of, residual_before))
    sizes = np.abs(_finite(both))
    largest, usual = float(sizes.max()), FAR_OUT * float(np.median(sizes))
    outside = int(np.count_nonzero(sizes > usual))
    if usual > 0.0 and outside <= 0.01 * sizes.size and largest > 2.0 * usual:
        return 1.08 * usual
    return 1.08 * max(largest, 2.0 * (scale.noise or 0.0))


def _main_marks(evidence: Evidence, panel: Panel) -> Iterator[str]:
    fitted = any(one.fitted.size for one in evidence.series)
    several = len(evidence.series) > 1
    for index, one in enumerate(evidence.series):
        css = "measured" if fitted or not several else f"c{index % PALETTE}"
        yield _drawn(css, evidence, panel, one, one.measured, index)
    draw = _bar_caps if evidence.kind == "bars" else _fit_line
    for index, one in enumerate(evidence.series):
        if one.before.size:
            marks = _fit_line(panel, one.x, one.before, index, len(evidence.series))
            yield _path("before", marks, one.label)
        if one.fitted.size:
            order = np.argsort(one.x, kind="stable") if evidence.kind == "scatter" else slice(None)
            marks = draw(panel, one.x[order], one.fitted[order], index, len(evidence.series))
            yield _path("fitted caps" if evidence.kind == "bars" else "fitted", marks, one.label)


def _residual_marks(evidence: Evidence, panel: Panel, scale: ResidualScale) -> Iterator[str]:
    left, right = panel.x.start, panel.x.end
    band = min(2.0 * (scale.noise or 0.0), panel.y.high)
    top, bottom = (panel.y.pixel(side * band) for side in (1, -1))
    if scale.noise is not None:
        yield (
            f'<rect class="band" x="{left:.1f}" y="{top:.1f}" '
            f'width="{right - left:.1f}" height="{bottom - top:.1f}"/>'
        )
    reach, beyond = panel.y.high, 0
    for css, of in (("residual before", residual_before), ("residual", residual_of)):
        for index, one in enumerate(evidence.series):
            residual = of(one)
            if residual.size:
                beyond += int(np.count_nonzero(np.abs(residual) > reach))
                inside = np.clip(residual, -reach, reach)
                yield _drawn(css, evidence, panel, one, inside, index)
    if scale.noise is not None:
        lines = "".join(f"M{left:.1f} {y:.1f}H{right:.1f}" for y in (top, bottom))
        yield f'<path class="noise" d="{lines}"/>'
    words = residual_words(scale, panel.y) + (f", {beyond} beyond" if beyond else "")
    yield text("scale", right, panel.y.end - 7, words)


def _drawn(css: str, evidence: Evidence, panel: Panel, series: Series, y: Array, index: int) -> str:
    """The marks of one series; a dense trace is the band between its extremes."""
    if evidence.kind == "line" and (band := filled(*panel.place(series.x, y))):
        return _path(f"{css} trace", band, series.label)
    marks = _MARKS[evidence.kind](panel, series.x, y, index, len(evidence.series))
    return _path(f"{css} {_shape(evidence)}", marks, series.label)


def _fit_line(panel: Panel, x: Array, y: Array, index: int, count: int) -> str:
    """A fitted curve, or the edges of a dense one, through which the measured one shows."""
    return outlined(*panel.place(x, y)) or _line(panel, x, y, index, count)


def residual_words(scale: ResidualScale, axis: Axis) -> str:
    """One line: rms of the residual beside the noise between neighbours, and their ratio.

    Parameters
    ----------
    scale
        Scatter of the residuals.
    axis
        Axis of the residuals.

    """
    unit = axis.scale.unit
    rms = f"rms {axis.scale.shown(scale.rms):.3g} {unit}".strip()
    if scale.noise is None or scale.ratio is None:
        return f"{rms}, n {scale.n}"
    noise = f"noise {axis.scale.shown(scale.noise):.3g} {unit}".strip()
    return f"{rms}, {noise}, ratio {scale.ratio:.2f}, n {scale.n}"


def _line(panel: Panel, x: Array, y: Array, _index: int, _count: int) -> str:
    keep = line_points(np.where(np.isfinite(x), y, np.nan), LINE_LIMIT)
    x_px, y_px = panel.place(x[keep], y[keep])
    drawn = np.isfinite(x_px) & np.isfinite(y_px)
    starts = drawn & ~np.concatenate([[False], drawn[:-1]])
    letters = np.where(starts, "M", "L")[drawn].tolist()
    return _joined(letters, x_px[drawn], y_px[drawn], "")


def _dots(panel: Panel, x: Array, y: Array, _index: int, _count: int) -> str:
    x_px, y_px = panel.place(x, y)
    keep = cloud_points(x_px, y_px, 1.0)
    return _joined(["M"] * keep.size, x_px[keep], y_px[keep], "h0")


def _bars(panel: Panel, x: Array, y: Array, index: int, count: int) -> str:
    centre, top, half = _bar_places(panel, x, y, index, count)
    base = panel.y.pixel(0.0)
    return "".join(
        f"M{c - half:.1f} {base:.1f}V{t:.1f}H{c + half:.1f}V{base:.1f}Z"
        for c, t in zip(centre.tolist(), top.tolist(), strict=True)
    )


def _bar_caps(panel: Panel, x: Array, y: Array, index: int, count: int) -> str:
    centre, top, half = _bar_places(panel, x, y, index, count)
    return "".join(
        f"M{c - half - 2:.1f} {t:.1f}H{c + half + 2:.1f}"
        for c, t in zip(centre.tolist(), top.tolist(), strict=True)
    )


def _bar_places(
    panel: Panel, x: Array, y: Array, index: int, count: int
) -> tuple[Array, Array, float]:
    finite = np.isfinite(x) & np.isfinite(y)
    x_px, y_px = panel.place(x[finite], y[finite])
    pitch = min(_bar_pitch(x_px) if x_px.size > 1 else 24.0, 24.0) * 0.8
    width = pitch / count
    return x_px + (index - (count - 1) / 2) * width, y_px, max(width / 2, 0.6)


_MARKS: dict[str, Callable[[Panel, Array, Array, int, int], str]] = {
    "line": _line,
    "scatter": _dots,
    "bars": _bars,
}


def _shape(evidence: Evidence) -> str:
    """CSS class of the measured marks; a few dots are drawn larger than a cloud."""
    if evidence.kind != "scatter":
        return "bars" if evidence.kind == "bars" else "curve"
    return "dots few" if sum(one.x.size for one in evidence.series) <= FEW_DOTS else "dots"


def _joined(letters: list[str], x_px: Array, y_px: Array, after: str) -> str:
    places = zip(letters, x_px.tolist(), y_px.tolist(), strict=True)
    return "".join([f"{letter}{x:.1f} {y:.1f}{after}" for letter, x, y in places])


def _path(css: str, marks: str, label: str) -> str:
    return f'<path class="{css}" data-label="{escape(label)}" d="{marks}"/>' if marks else ""


def _end_labels(series: tuple[Series, ...], panel: Panel) -> list[str]:
    """Names of the series at their right ends, moved apart where they would overlap."""
    wanted = []
    for index, one in enumerate(series):
        drawn = np.flatnonzero(np.isfinite(one.x) & np.isfinite(one.measured))
        if drawn.size:
            last = drawn[np.argmax(one.x[drawn])]
            wanted.append((panel.y.pixel(float(one.measured[last])), index))
    places: list[float] = []
    for place, _ in sorted(wanted):
        places.append(max(place, places[-1] + LABEL_PITCH) if places else place)
    lift = max(places[-1] - panel.y.start, 0.0) if places else 0.0
    names = _short([one.label for one in series])
    # a label has its curve's own colour where colours separate the curves
    fitted = any(one.fitted.size for one in series)
    return [
        text(
            f"end {'plain' if fitted else f't{index % PALETTE}'}",
            panel.x.end + 6,
            place - lift + 4,
            names[index],
            series[index].label,
        )
        for place, (_, index) in zip(places, sorted(wanted), strict=True)
    ]


def _short(labels: Sequence[str]) -> list[str]:
    """Labels that fit the margin: of files their names less what all begin with, else the end."""
    paths = [PurePosixPath(label) for label in labels]
    if all(path.suffix in FILES for path in paths):
        words = [path.stem.split("_") for path in paths]
        same = takewhile(lambda column: len(set(column)) == 1, zip(*words, strict=False))
        kept = sum(1 for _ in same)
        labels = ["_".join(own[kept:] or own) for own in words]
    return [x if len(x) <= LABEL_CHARS else f"…{x[1 - LABEL_CHARS :]}" for x in labels]


def _frame(panel: Panel) -> str:
    left, right = panel.x.start, panel.x.end
    rows = y_ticks(panel.y, left, right)
    columns = "".join(
        f'<path class="grid" d="M{x:.1f} {panel.y.end:.1f}V{panel.y.start:.1f}"/>'
        for x in panel.x.pixels(np.array(panel.x.ticks)).tolist()
    )
    title = (
        f'<text class="title" x="4" y="{panel.y.end - 9:.1f}">{_subscripts(panel.y.title)}</text>'
    )
    return rows + columns + title


def _x_axis(x: Axis, bottom: float) -> str:
    middle = (x.start + x.end) / 2
    return (
        f'{x_ticks(x, bottom)}<text class="title x" x="{middle:.1f}" y="{bottom + 33:.1f}">'
        f"{_subscripts(x.title)}</text>"
    )


def _subscripts(title: str) -> str:
    head, _, tail = title.partition("_")
    if not tail or len(head) != 1:
        return escape(title)
    symbol, space, rest = tail.partition(" ")
    shifted = f'<tspan dy="3" class="sub">{escape(symbol)}</tspan><tspan dy="-3">{space}'
    return f"{escape(head)}{shifted}{escape(rest)}</tspan>"


def _geometry(main: Panel, bottom: float) -> str:
    def axis(letter: str, one: Axis) -> str:
        ends = (one.scale.shown(one.low), one.scale.shown(one.high), one.start, one.end)
        numbers = " ".join(f"{number:.7g}" for number in ends)
        return f'data-{letter}="{numbers}" data-{letter}-unit="{escape(one.scale.unit)}"'

    return f'{axis("x", main.x)} {axis("y", main.y)} data-bottom="{bottom:g}"'


def _spoken(evidence: Evidence, scale: ResidualScale | None) -> str:
    words = f"{evidence.title}: {len(evidence.series)} series"
    if scale is None:
        return words

    return f"{words}, residual rms {quantity(scale.rms, unit_of(evidence.y_name), 3)}"


@dataclass(frozen=True, slots=True)
class ResidualScale:
    """Scatter of measured - fitted: `rms` and the point-to-point `noise` [unit of y], `n` points.

    `noise` is None with fewer than `FEWEST` neighbours, or where all of them are equal.
    """

    rms: float
    noise: float | None
    n: int

    @property
    def ratio(self) -> float | None:
        """The rms over the noise: 1 for white noise, more where neighbours share an error."""
        return None if self.noise is None else self.rms / self.noise


def residual_of(series: Series) -> Array:
    """What the fit left over, measured - fitted [n]; empty where the series has no fit.

    Parameters
    ----------
    series
        Measured and fitted samples.

    """
    return _less(series.measured, series.fitted)


def residual_before(series: Series) -> Array:
    """What an earlier fit left over [n]; empty where there was none.

    Parameters
    ----------
    series
        Measured and fitted samples.

    """
    return _less(series.measured, series.before)


def _less(measured: Array, fitted: Array) -> Array:
    if fitted.size == 0:
        return np.empty(0)
    with np.errstate(invalid="ignore"):
        return np.asarray(measured - fitted, dtype=np.float64)


def residual_scale(series: Iterable[Series]) -> ResidualScale | None:
    """Scatter of the residuals of several series, each in order of x; None without any fit.

    The noise is the root of half the mean squared difference of neighbours, which a smooth residual
    hardly moves. Reference: J. von Neumann, R. H. Kent, H. R. Bellinson, B. I. Hart, "The mean
    square successive difference", Ann. Math. Statist. 12 (1941) 153-162.

    Parameters
    ----------
    series
        Measured and fitted samples, each in order of x.

    """
    residuals, steps = [], []
    for one in series:
        residual = residual_of(one)
        if residual.size == 0:
            continue
        in_order = residual[np.argsort(one.x, kind="stable")]
        in_order = in_order[np.isfinite(in_order)]
        residuals.append(in_order)
        steps.append(np.diff(in_order))
    everything = np.concatenate(residuals) if residuals else np.empty(0)
    if everything.size == 0:
        return None
    differences = np.concatenate(steps)
    rms = math.sqrt(float(np.mean(everything**2)))
    noise = None
    if differences.size >= FEWEST and np.any(differences != 0.0):
        noise = math.sqrt(float(np.mean(differences**2)) / 2.0)
    return ResidualScale(rms, noise, int(everything.size))
