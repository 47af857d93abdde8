"""What a recording holds, read back from its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.records.errors import RecordingError

_OVERVIEW = "/overview/"


def recording_property(path: Path, name: str, key: str) -> list[Any]:
    """The values of a property that was sent to a recording.

    Parameters
    ----------
    path
        The .rrd file.
    name
        Of the property.
    key
        Of the value.

    Returns
    -------
    list
        Empty where there is none.

    Raises
    ------
    RecordingError
        The file cannot be read.

    """
    from rerun.chunk import RrdReader

    try:
        stream = RrdReader(str(path)).stream()
        for chunk in stream.filter(content=f"/__properties/{name}", is_static=True):
            batch = chunk.to_record_batch()
            if key in batch.schema.names:
                return batch.column(key)[0].as_py()
    except (RuntimeError, ValueError, OSError) as error:
        raise RecordingError(f"{path.name} cannot be read: {error}", "make it again") from error
    return []


def entities(path: Path) -> tuple[str, ...]:
    """Addresses of everything in a recording except its properties, sorted.

    Parameters
    ----------
    path
        The .rrd file.

    """
    from rerun.chunk import RrdReader

    paths = {str(chunk.entity_path) for chunk in RrdReader(str(path)).stream()}
    return tuple(sorted(name for name in paths if not name.startswith("/__properties")))


@dataclass(frozen=True, slots=True)
class FleetShape:
    """What a layout for many motors must have room for."""

    signals: tuple[str, ...]
    captures: int


def fleet_shape(motors: Sequence[Path]) -> FleetShape:
    """What a layout for many motors must have room for.

    Parameters
    ----------
    motors
        Their recordings.

    Returns
    -------
    FleetShape
        Quantities that any of them shows, and the most captures of one.

    """
    overviews = {name for path in motors for name in entities(path) if name.startswith(_OVERVIEW)}
    counts = [recording_property(path, "motor", "captures") for path in motors]
    signals = tuple(sorted(name.removeprefix(_OVERVIEW) for name in overviews))
    return FleetShape(signals, max((int(count[0]) for count in counts if count), default=1))
