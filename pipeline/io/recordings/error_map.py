"""An error map as a picture: cells in blue to red, gaps hatched, ticks and a colour bar.

The viewer has no view of one variable over two others, so that a map is an image with labels at
its sides; the numbers themselves go beside it as a tensor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun import RecordingStream
from rerun.blueprint import Spatial2DView

from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.stream import send_rows, tensor
from pipeline.physics.notation import scale_for
from pipeline.records.error_map import Bins, ErrorMap

CELL = 8
BAR_GAP, BAR_WIDTH = 1.5 * CELL, CELL
TICKS = 4
_COLD = np.array([33.0, 102.0, 172.0])
_WARM = np.array([178.0, 24.0, 43.0])
_NEUTRAL = 247.0
_HATCH = ((74, 74, 74), (58, 58, 58))
_GREY = (140, 140, 140)
PARTS = ("picture", "bar", "axes", "frame")
Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Labels:
    """Texts at places [L, 2] in pixels of the picture."""

    places: NDArray[np.float64]
    texts: tuple[str, ...]


def diverging(share: NDArray[np.float64]) -> Image:
    """Colours of shares from −1 (blue) over 0 (white) to 1 (red).

    Parameters
    ----------
    share
        [...].

    Returns
    -------
    array [..., 3]
        RGB.

    """
    strength = np.clip(np.abs(share), 0.0, 1.0)[..., None]
    end = np.where(share[..., None] < 0.0, _COLD, _WARM)
    return np.rint(_NEUTRAL + (end - _NEUTRAL) * strength).astype(np.uint8)


def map_picture(error_map: ErrorMap, reach: float) -> Image:
    """The picture of a map of two variables.

    Parameters
    ----------
    error_map
        The map.
    reach
        Mean error of full colour [unit].

    Returns
    -------
    array [height, width, 3]
        RGB; empty cells are hatched.

    """
    rows, columns = error_map.mean.shape
    height, width = CELL * rows, CELL * columns
    known = np.isfinite(error_map.mean)[::-1]
    share = np.where(known, error_map.mean[::-1], 0.0) / (reach or 1.0)
    cells = np.kron(diverging(share), np.ones((CELL, CELL, 1), dtype=np.uint8))
    down, across = np.indices((height, width)) // (CELL // 2)
    hatch = np.array(_HATCH, dtype=np.uint8)[(down + across) % 2]
    known_pixels = np.kron(known, np.ones((CELL, CELL), dtype=bool))
    return np.where(known_pixels[..., None], cells, hatch)


def bar_picture(rows: int) -> Image:
    """The picture of a colour bar, from full colour downwards to its negative.

    Parameters
    ----------
    rows
        Cells that the bar is high.

    Returns
    -------
    array [height, width, 3]
        RGB.

    """
    ramp = np.linspace(1.0, -1.0, CELL * rows)[:, None] * np.ones((1, BAR_WIDTH))
    return diverging(ramp)


def map_labels(error_map: ErrorMap, reach: float, words: tuple[str, str]) -> Labels:
    """Ticks of both axes and of the colour bar of a map.

    Parameters
    ----------
    error_map
        The map.
    reach
        Mean error of full colour [unit].
    words
        Names of x and y.

    Returns
    -------
    Labels
        Places in pixels of the picture.

    Raises
    ------
    ValueError
        The map is of one variable.

    """
    if error_map.y is None:
        raise ValueError("a picture needs a map of two variables")
    width, height = CELL * error_map.x.count, CELL * error_map.y.count
    bar = width + BAR_GAP + BAR_WIDTH / 2
    scale = scale_for(reach, error_map.unit)
    beside, full = bar + 1.75 * CELL, f"{scale.shown(reach):.3g}"
    labels = [
        *((CELL * place, height + 0.7 * CELL, text) for place, text in _ticks(error_map.x)),
        *((-1.1 * CELL, height - CELL * place, text) for place, text in _ticks(error_map.y)),
        (width / 2, height + 1.9 * CELL, words[0]),
        (0.0, -0.75 * CELL, words[1]),
        (bar, -0.75 * CELL, scale.unit or "1"),
        (beside, CELL / 3, f"+{full}"),
        (beside, height / 2, "0"),
        (beside, height - CELL / 3, f"-{full}"),
    ]
    return Labels(np.array([(x, y) for x, y, _ in labels]), tuple(text for *_, text in labels))


def _ticks(bins: Bins) -> list[tuple[float, str]]:
    """Place in cells and text of round numbers along an axis."""
    low, high = bins.edges[0], bins.edges[-1]
    rough = (high - low) / TICKS
    decade = 10.0 ** np.floor(np.log10(rough))
    step = float(min((s for s in (1, 2, 2.5, 5, 10) if s * decade >= rough), default=10) * decade)
    numbers = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
    each = (high - low) / bins.count
    return [((n - low) / each, f"{n:.6g}" if abs(n) > 1e-9 * step else "0") for n in numbers]


def send_map(
    stream: RecordingStream,
    entity: str,
    error_map: ErrorMap,
    reach: float,
    at: tuple[str, int] | None = None,
) -> None:
    """Sends the picture of a map and its values.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where it lies.
    error_map
        The map.
    reach
        Mean error of full colour [unit].
    at
        A timeline and a place on it; None for all times.

    """
    picture = map_picture(error_map, reach)
    if at is None:
        stream.log(f"{entity}/picture", rr.Image(picture), static=True)
        stream.log(f"{entity}/values", rr.Tensor(error_map.mean), static=True)
        return
    timeline, place = at
    shape = rr.encodings.ImageFormat(
        width=picture.shape[1], height=picture.shape[0], color_model="RGB", channel_datatype="U8"
    )
    columns = rr.Image.columns(buffer=[picture.tobytes()], format=[shape])
    send_rows(stream, f"{entity}/picture", timeline, [place], columns)
    values = rr.Tensor.columns(data=tensor(error_map.mean))
    send_rows(stream, f"{entity}/values", timeline, [place], values)


def send_frame(
    stream: RecordingStream, entity: str, error_map: ErrorMap, reach: float, words: tuple[str, str]
) -> None:
    """Sends ticks, names, colour bar and border of a map, for all times.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where the map lies.
    error_map
        The map.
    reach
        Mean error of full colour [unit].
    words
        Names of x and y.

    """
    labels = map_labels(error_map, reach, words)
    points = rr.Points2D(
        labels.places,
        labels=[drawable(text) for text in labels.texts],
        show_labels=True,
        radii=0.01,
        colors=_GREY,
    )
    stream.log(f"{entity}/axes", points, static=True)
    rows, columns = error_map.mean.shape
    border = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows], [0, 0]]) * CELL
    stream.log(f"{entity}/frame", rr.LineStrips2D([border], colors=_GREY, radii=0.17), static=True)
    place = rr.Transform3D(translation=[columns * CELL + BAR_GAP, 0.0, 0.0])
    stream.log(f"{entity}/bar", place, rr.Image(bar_picture(rows)), static=True)


def map_view(entity: str, error_map: ErrorMap, name: str) -> Spatial2DView:
    """The view of a map, with room for its labels.

    Parameters
    ----------
    entity
        Where the map lies.
    error_map
        The map.
    name
        Of the view.

    """
    rows, columns = error_map.mean.shape
    bounds: Any = rrb.VisualBounds2D(
        x_range=(-3.0 * CELL, CELL * columns + BAR_GAP + BAR_WIDTH + 3.8 * CELL),
        y_range=(-1.9 * CELL, CELL * rows + 2.9 * CELL),
    )
    return rrb.Spatial2DView(
        origin=entity,
        contents=[f"{entity}/{part}" for part in PARTS],
        name=drawable(name),
        visual_bounds=bounds,
    )
