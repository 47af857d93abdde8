"""One constant over the lots in order of time: motors, means, limits, margin, moving average."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from pipeline.physics.notation import quantity
from pipeline.records.lot_constant import ConstantResult, LotMean, MotorValue
from pipeline.records.lot_regression import CoggingBand, OrderLevel
from pipeline.report.charts.axis import Axis, axis_for, padded, x_ticks, y_ticks
from pipeline.report.charts.svg import band, line, picture, text

WIDTH, LEFT, RIGHT, TOP, HEIGHT, BOTTOM = 640.0, 66.0, 12.0, 14.0, 190.0, 40.0
MOST_DOTS, MOST_NAMES = 60, 14
NAME_CHARS = 11


def lot_chart(constant: ConstantResult) -> str:
    """SVG of a constant's lots; an empty text where it has none.

    Parameters
    ----------
    constant
        The constant's comparison.

    """
    if not constant.lots:
        return ""
    y = _range(constant)
    pitch = (WIDTH - LEFT - RIGHT) / len(constant.lots)
    body = [_grid(y), _margin(constant, y), _limits(constant, y)]
    for index, lot in enumerate(constant.lots):
        middle = LEFT + pitch * (index + 0.5)
        own = [m for m in constant.motors if m.lot == lot.lot and m.side == lot.side]
        body.append(_column(lot, own, constant.unit, middle, min(pitch, 60.0), y))
    body += [_average(constant, y, pitch), _names(constant.lots, pitch)]
    return picture("chart lots", WIDTH, TOP + HEIGHT + BOTTOM, f"{constant.name} by lot", *body)


def _range(constant: ConstantResult) -> Axis:
    of_motors = [motor.value for motor in constant.motors]
    low, high = min(of_motors), max(of_motors)
    bounds = constant.bounds
    centre = bounds.nominal if bounds is not None else None
    if bounds is not None and bounds.margin is not None and centre is not None:
        low, high = min(low, centre - bounds.margin), max(high, centre + bounds.margin)
    reach = max(high - low, 1e-12 * abs(high))
    for limit in () if bounds is None else (bounds.lower, bounds.upper):
        # A limit far away would flatten everything; it is then given in words alone.
        if limit is not None and low - reach <= limit <= high + reach:
            low, high = min(low, limit), max(high, limit)
    return axis_for(constant.name, *padded(low, high, 0.06), TOP + HEIGHT, TOP, 4)


def _grid(y: Axis) -> str:
    return y_ticks(y, LEFT, WIDTH - RIGHT) + text("title", 2, 10, y.title)


def _margin(constant: ConstantResult, y: Axis) -> str:
    bounds = constant.bounds
    means = [lot.mean for lot in constant.lots if lot.side == "baseline"]
    if bounds is None or bounds.margin is None or not means:
        return ""
    centre = sum(means) / len(means)
    top = max(y.pixel(centre + bounds.margin), TOP)
    bottom = min(y.pixel(centre - bounds.margin), TOP + HEIGHT)
    return (
        f'<rect class="band" x="{LEFT:g}" y="{top:.1f}" width="{WIDTH - LEFT - RIGHT:g}" '
        f'height="{max(bottom - top, 0.0):.1f}"><title>margin of sameness</title></rect>'
    )


def _limits(constant: ConstantResult, y: Axis) -> str:
    if constant.bounds is None:
        return ""
    marks = []
    for css, words, limit in (
        ("residual", "lower limit", constant.bounds.lower),
        ("residual", "upper limit", constant.bounds.upper),
        ("noise", "lower acceptance limit", constant.bounds.accept_lower),
        ("noise", "upper acceptance limit", constant.bounds.accept_upper),
    ):
        if limit is not None and y.low <= limit <= y.high:
            marks.append(
                f'<path class="{css}" d="M{LEFT:g} {y.pixel(limit):.1f}H{WIDTH - RIGHT:g}">'
                f"<title>{words}</title></path>"
            )
    return "".join(marks)


def _column(
    lot: LotMean, motors: Sequence[MotorValue], unit: str, middle: float, width: float, y: Axis
) -> str:
    """One lot: its motors beside each other, its mean as a stroke with ± 2 u."""
    css = "t-new" if lot.side == "candidate" else "t-old"
    shown = sorted(motors, key=lambda m: (m.value, m.motor_id))
    if len(shown) > MOST_DOTS:
        picked = np.unique(np.linspace(0, len(shown) - 1, MOST_DOTS).round().astype(int))
        shown = [m for k, m in enumerate(shown) if k in set(picked.tolist()) or m.outlier]
    dots = []
    for k, motor in enumerate(shown):
        place = middle + 0.55 * width * ((k % 7) / 6.0 - 0.5)
        words = escape(f"{motor.motor_id}: {quantity(motor.value, unit)}")
        mark = " outlier" if motor.outlier else ""
        dots.append(
            f'<circle class="{css}{mark}" cx="{place:.1f}" cy="{y.pixel(motor.value):.1f}" r="2.6">'
            f"<title>{words}</title></circle>"
        )
    mean, low, high = (y.pixel(lot.mean + k * lot.u) for k in (0.0, -2.0, 2.0))
    half = 0.38 * width
    return (
        "".join(dots)
        + f'<path class="mean {css}" d="M{middle - half:.1f} {mean:.1f}h{2 * half:.1f}'
        f'M{middle:.1f} {low:.1f}V{high:.1f}"><title>{escape(lot.lot)}: mean '
        f"{quantity(lot.mean, unit)} of {lot.motors}</title></path>"
    )


def _average(constant: ConstantResult, y: Axis, pitch: float) -> str:
    """The moving average with its limits, where it is charted."""
    places = [LEFT + pitch * (k + 0.5) for k in range(len(constant.lots))]
    paths = []
    for css, averages in (
        ("fitted", [lot.ewma for lot in constant.lots]),
        ("noise", [lot.ewma_low for lot in constant.lots]),
        ("noise", [lot.ewma_high for lot in constant.lots]),
    ):
        points = [
            f"{x:.1f} {y.pixel(min(max(v, y.low), y.high)):.1f}"
            for x, v in zip(places, averages, strict=True)
            if v is not None
        ]
        if points:
            paths.append(f'<path class="{css}" d="M{"L".join(points)}"/>')
    return "".join(paths)


def _names(lots: Sequence[LotMean], pitch: float) -> str:
    step = math.ceil(len(lots) / MOST_NAMES)
    marks = []
    for index, lot in enumerate(lots):
        if index % step and index != len(lots) - 1:
            continue
        short = lot.lot if len(lot.lot) <= NAME_CHARS else lot.lot[: NAME_CHARS - 1] + "…"
        place = LEFT + pitch * (index + 0.5)
        marks.append(text("tick x", place, TOP + HEIGHT + 15, short, lot.lot))
    return "".join(marks)


def cogging_chart(bands: Sequence[CoggingBand], orders: Sequence[OrderLevel]) -> str:
    """SVG of both sides' cogging torque over the common period of their orders, ± 1 sd.

    Parameters
    ----------
    bands
        Cogging torque of each side over the angle.
    orders
        Levels of the orders on both sides.

    """
    if not bands:
        return ""
    common = math.gcd(*(level.order for level in orders)) if orders else 1
    window = 2.0 * math.pi / max(common, 1)
    cut = [int(np.searchsorted(one.theta_mech_rad, window * 1.0001)) for one in bands]
    low = min(min(one.low_nm[:n]) for one, n in zip(bands, cut, strict=True))
    high = max(max(one.high_nm[:n]) for one, n in zip(bands, cut, strict=True))
    x = axis_for("theta_mech_deg", 0.0, math.degrees(window), LEFT, WIDTH - RIGHT, 6)
    y = axis_for("torque_shaft_nm", *padded(low, high), TOP + HEIGHT, TOP, 4)
    body = [_grid(y), x_ticks(x, TOP + HEIGHT)]
    for side, n in zip(bands, cut, strict=True):
        css = "t-new" if side.side == "candidate" else "t-old"
        px = x.pixels(np.degrees(np.array(side.theta_mech_rad[:n]))).tolist()
        up, down, mean = (
            y.pixels(np.array(torque_nm[:n])).tolist()
            for torque_nm in (side.high_nm, side.low_nm, side.mean_nm)
        )
        body.append(f'<path class="area {css}" d="{band(px, up, down)}"/>')
        body.append(f'<path class="mean {css}" d="{line(px, mean)}"/>')
    middle = (LEFT + WIDTH - RIGHT) / 2.0
    body.append(text("title x", middle, TOP + HEIGHT + 33, "shaft angle [deg]"))
    words = "cogging torque of both sides"
    return picture("chart lots", WIDTH, TOP + HEIGHT + BOTTOM, words, *body)
