"""What every recording shares: how tables become components and streams become bytes.

A blueprint belongs to an application id, not to a recording, so each workspace that is laid out in
its own way has an application id of its own. Two files of equal input differ in the ids that Rerun
draws, so compare their content, never their bytes.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import rerun as rr
import rerun_bindings as bindings
from numpy.typing import NDArray
from rerun import RecordingStream
from rerun.blueprint import Blueprint

from pipeline.io.recordings.font import drawable

Array = NDArray[np.float64]

ROWS_A_CHUNK = 4096
OPEN_FILES = Path("/proc/self/fd")
TIME, ROW, PACK = "t", "row", "samples"
FLUSH_S = 300.0
FAINT = (140, 140, 140, 60)
Colour = tuple[int, int, int]
Tinted = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Trace:
    """A table on its way into a recording: `index` names its column of times or of whole numbers.

    Each column is a component. Of a `packed` one all columns are fields of the component `PACK`,
    which is written in two thirds of the time, but shows as one column in a table.
    """

    entity: str
    index: str
    frame: pl.DataFrame
    packed: bool = False

    @property
    def columns(self) -> tuple[str, ...]:
        """The components, the index left out."""
        return tuple(name for name in self.frame.columns if name != self.index)


@dataclass(slots=True)
class Recording:
    """A recording being made in memory; `content` is the .rrd once the `with` block is left."""

    stream: RecordingStream
    content: bytes = b""


@contextmanager
def recording(
    name: str, identity: Sequence[str], layout: Blueprint | None, ids: tuple[str, str] | None = None
) -> Iterator[Recording]:
    """A recording called `name` with an id made of `identity`: equal work, equal id.

    The layout is made active at once, since the web viewer lays out what comes first by itself.
    `ids` are application and recording where they mean something by themselves. Made in memory,
    since a stream onto a full disk may wait for its dead writer for ever.

    Parameters
    ----------
    name
        Shown in the viewer.
    identity
        What its id is made of: equal work has an equal id.
    layout
        Made active at once, since the web viewer lays out what comes first by itself; None for
        none.
    ids
        Ids of application and recording, where they have a meaning by themselves.

    Yields
    ------
    Recording
        Its content is there once the block is left. In memory, since a stream onto a full disk may
        wait for ever.

    """
    rr.set_strict_mode(True)
    # a stream that nobody holds any more keeps two threads and its buffers until this is called
    bindings.flush_and_cleanup_orphaned_recordings()
    shown = drawable(name)
    home, recording_id = ids or (application(shown), digest(identity))
    stream = rr.RecordingStream(home, recording_id=recording_id, send_properties=False)
    with _kept_in_memory(stream) as finished:
        if layout is not None:
            _send_layout(stream, home, layout)
        stream.send_recording_name(shown)
        recorded = Recording(stream)
        yield recorded
        stream.flush(timeout_sec=FLUSH_S)
        recorded.content = finished()


@contextmanager
def _kept_in_memory(stream: RecordingStream) -> Iterator[Callable[[], bytes]]:
    """Gives a stream its place, and what ends it and returns its bytes.

    In a file without a name, which lies in memory, samples are compressed as they come; the
    stream's own memory keeps them as they are until the end, which takes half as long again.
    """
    if not _has_nameless_files():
        memory = stream.memory_recording()

        def drained() -> bytes:
            content = memory.drain_as_bytes()
            stream.disconnect()
            return content

        yield drained
        return
    with os.fdopen(os.memfd_create("recording"), "rb") as file:

        def finished() -> bytes:
            stream.disconnect()
            return file.read()

        stream.save(OPEN_FILES / str(file.fileno()))
        yield finished


def _send_layout(stream: RecordingStream, home: str, layout: Blueprint) -> None:
    """Makes a layout the active and the default one of the application `home`.

    As Rerun's `send_blueprint` does, which leaves the stream of the layout connected to its memory:
    the two hold each other, and two threads, for as long as the process lives.
    """
    own = RecordingStream._from_native(
        bindings.new_blueprint(
            application_id=home, make_default=False, make_thread_default=False, default_enabled=True
        )
    )
    own.set_time("blueprint", sequence=0)
    layout._log_to_stream(own)
    storage = own.memory_recording().storage
    bindings.send_blueprint(storage, True, True, recording=stream.to_native())
    own.disconnect()


def _has_nameless_files() -> bool:
    """Whether this is Linux, and no file, nameless ones included, has a largest size."""
    if not hasattr(os, "memfd_create") or not OPEN_FILES.is_dir():
        return False
    import resource

    return resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def application(name: str) -> str:
    """The application id of a workspace, which the viewer takes unchanged.

    Parameters
    ----------
    name
        Any text. The viewer would replace what is no ASCII letter, digit, space, `-` or `_`, and
        two names could become one; such a name gets a digest.

    """
    readable = "".join(c if c.isascii() and (c.isalnum() or c in " -_") else "-" for c in name)
    return readable if readable == name else f"{readable} {digest((name,))[:6]}"


def digest(parts: Sequence[str]) -> str:
    """32 hexadecimal digits that stand for some texts.

    Parameters
    ----------
    parts
        The texts, in their order.

    """
    return hashlib.sha256("\n".join(parts).encode("utf-8", "surrogatepass")).hexdigest()[:32]


def timed(entity: str, t_s: Array, values: pl.DataFrame) -> Trace:
    """A trace on the time line; rows whose instant is not finite have no place there.

    Parameters
    ----------
    entity
        Where it lies.
    t_s
        Instants [n]; rows whose instant is not finite are left out.
    values
        Columns [n].

    """
    finite = np.isfinite(t_s)
    index = pl.Series(TIME, nanoseconds(t_s[finite])).cast(pl.Duration("ns"))
    finite_values = values if finite.all() else values.filter(pl.Series(finite))
    return Trace(entity, TIME, finite_values.insert_column(0, index))


def placed(
    entity: str, index: str, values: pl.DataFrame, places: NDArray[np.int64] | None = None
) -> Trace:
    """A trace on a timeline of whole numbers.

    Parameters
    ----------
    entity
        Where it lies.
    index
        The timeline.
    values
        Columns [n].
    places
        Where the rows stand [n]; None for 0, 1, ...

    """
    numbers = np.arange(values.height) if places is None else places
    return Trace(entity, index, values.insert_column(0, pl.Series(index, numbers, pl.Int64)))


def nanoseconds(t_s: Array) -> NDArray[np.int64]:
    """Instants as whole nanoseconds; a float of seconds would lose some.

    Parameters
    ----------
    t_s
        [n].

    Returns
    -------
    array [n] of int
        In ns.

    """
    return np.rint(t_s * 1e9).astype(np.int64)


def send_trace(stream: RecordingStream, trace: Trace) -> None:
    """Sends a table in slices of `ROWS_A_CHUNK` rows.

    Parameters
    ----------
    stream
        The recording.
    trace
        The table.

    """
    frame = trace.frame
    if trace.packed:
        frame = frame.select(trace.index, pl.struct(trace.columns).alias(PACK))
    for batch in frame.to_arrow().to_batches(max_chunksize=ROWS_A_CHUNK):
        rr.send_record_batch(batch, stream, index=trace.index, entity_path=trace.entity)


def send_rows(
    stream: RecordingStream, entity: str, timeline: str, places: Sequence[int], columns: Any
) -> None:
    """Sends columns whose rows stand at places of a timeline of whole numbers.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where they lie.
    timeline
        Its name.
    places
        One a row.
    columns
        Of one archetype.

    """
    index = rr.TimeColumn(timeline, sequence=list(places))
    rr.send_columns(entity, indexes=[index], columns=columns, recording=stream)


def send_page(stream: RecordingStream, entity: str, markdown: str) -> None:
    """Sends a page of text, for all times.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where it lies.
    markdown
        The text.

    """
    page = rr.TextDocument(drawable(markdown), media_type=rr.MediaType.MARKDOWN)
    stream.log(entity, page, static=True)


def send_property(stream: RecordingStream, name: str, values: dict[str, Any]) -> None:
    """Sends values that a table of recordings shows, one column each.

    Parameters
    ----------
    stream
        The recording.
    name
        Of the property.
    values
        By key; None is left out.

    """
    stated = {key: _drawable(value) for key, value in values.items() if value is not None}
    if stated:
        stream.send_property(name, rr.AnyValues(**stated))


@dataclass(frozen=True, slots=True)
class Bars:
    """Bars of one width and colour.

    Attributes
    ----------
    values
        Heights [B].
    left
        Left edges [B].
    width
        Of each bar.
    colour
        Of all bars.

    """

    values: Array
    left: Array
    width: float
    colour: Colour

    @classmethod
    def between(cls, edges: Array, values: Array, colour: Colour) -> Bars:
        """Bars that fill the cells between even edges.

        Parameters
        ----------
        edges
            [B + 1].
        values
            Heights [B].
        colour
            Of all bars.

        """
        return cls(values, edges[:-1], float(edges[1] - edges[0]), colour)


def send_bars(
    stream: RecordingStream, entity: str, bars: Bars, at: tuple[str, int] | None = None
) -> None:
    """Sends bars of one width.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where they lie.
    bars
        Heights, left edges, width and colour.
    at
        A timeline and a place on it; None for all times.

    """
    if at is None:
        shown = rr.BarChart(bars.values, abscissa=bars.left, color=bars.colour, widths=[bars.width])
        stream.log(entity, shown, static=True)
        return
    columns = rr.BarChart.columns(
        values=tensor(bars.values),
        abscissa=tensor(bars.left),
        color=[bars.colour],
        widths=[bars.width],
    )
    send_rows(stream, entity, at[0], [at[1]], columns)


def send_axis_ends(
    stream: RecordingStream, entity: str, ends: Sequence[float], beyond: float
) -> None:
    """Sends faint marks beyond the last bar that fix the range of the axis of a bar chart.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where the bars lie.
    ends
        Values that the axis must reach.
    beyond
        Right edge of the last bar.

    """
    step = 0.005 * abs(beyond) or 1.0
    places = [beyond + step * (1 + 2 * place) for place in range(len(ends))]
    widths = [step] * len(places)
    marks = rr.BarChart(list(ends), abscissa=places, color=FAINT, widths=widths)
    stream.log(entity, marks, static=True)


def tensor(values: Array) -> Any:
    """One row of a column of tensors; a bare list of arrays would become one of more axes.

    Parameters
    ----------
    values
        The array.

    """
    return rr.encodings.TensorData(array=np.ascontiguousarray(values))


def _drawable(value: Any) -> Any:
    if isinstance(value, str):
        return drawable(value)
    return [_drawable(one) for one in value] if isinstance(value, list) else value
