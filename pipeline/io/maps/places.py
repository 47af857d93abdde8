"""Where source maps lie: a file anywhere, `conf/source` here, the user's folder, the package's."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from pipeline.io.maps.map_file import find_maps, load_source_file, load_source_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.settings import configuration_folder

AUTO = "auto"


def map_folders(config_dir: str | None = None) -> tuple[Path, ...]:
    """Folders of source maps, the weakest first.

    Parameters
    ----------
    config_dir
        Configuration folder that the user names; it takes precedence.

    Returns
    -------
    tuple of Path
        The package's, the user's, the current folder's, and that of `config_dir`.

    """
    places = [configuration_folder() / "source", *_users(), Path("conf") / "source"]
    if config_dir is not None:
        places.append(Path(config_dir) / "source")
    existing = {place.resolve(): place for place in places if place.is_dir()}
    return tuple(existing.values())


def source_maps(source: str = AUTO, config_dir: str | None = None) -> dict[str, SourceMap]:
    """The maps to read foreign files by.

    Parameters
    ----------
    source
        A file, a name, or `auto` for all maps. A map of the same name in a nearer folder replaces
        one farther away.
    config_dir
        Configuration folder that the user names.

    Raises
    ------
    UsageError
        There is no such file or name, or a map cannot be read.

    """
    if source.endswith((".yaml", ".yml")):
        return load_source_file(Path(source))
    maps: dict[str, SourceMap] = {}
    for folder in map_folders(config_dir):
        nearer = load_source_maps(folder)
        names = {name.partition("/")[0] for name in nearer}
        maps = {n: one for n, one in maps.items() if n.partition("/")[0] not in names} | nearer
    return maps if source == AUTO else find_maps(maps, source)


def map_file(name: str, config_dir: str | None = None) -> Path:
    """The file of a map that `source_maps` found by name.

    Parameters
    ----------
    name
        Name of the map.
    config_dir
        Configuration folder that the user names.

    Returns
    -------
    Path
        In the nearest folder that has it.

    """
    places = [folder / f"{name}.yaml" for folder in map_folders(config_dir)]
    return [place for place in places if place.is_file()][-1]


def _users() -> list[Path]:
    """The user's folder of source maps, as the XDG base directory specification names it."""
    named = os.environ.get("XDG_CONFIG_HOME", "")
    if named and Path(named).is_absolute():
        return [Path(named) / "motor-datasheets" / "source"]
    with suppress(RuntimeError):
        return [Path.home() / ".config" / "motor-datasheets" / "source"]
    return []
