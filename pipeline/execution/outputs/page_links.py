"""Links between the pages of an output folder: those to files that are there.

Which pages there are depends on the commands that were given, in any order; each that writes a page
brings the links of its motor's other pages up to date.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection
from pathlib import Path
from urllib.parse import quote

from pipeline.execution.caches.run_cache import note_files
from pipeline.io.storage.publish import write_whole
from pipeline.records.naming import file_stem
from pipeline.report.pages.page import Link, with_links

INDEX, LOTS = "report/index.html", "regression/report.html"
MOTOR, DIAGNOSIS = "report/{}.html", "diagnosis/{}.html"
_DATASHEET = ("Datasheet", MOTOR)
_DIAGNOSIS = ("Diagnosis", DIAGNOSIS)
_COMPARISON = ("Comparison", "comparison/{}.html")
_LOTS = ("Lots", LOTS)
_OF_PAGE = {
    MOTOR: (
        _DIAGNOSIS,
        _COMPARISON,
        _LOTS,
        ("Recording (review)", "recordings/motor-{}.rrd"),
    ),
    DIAGNOSIS: (
        ("All motors", INDEX),
        _DATASHEET,
        _COMPARISON,
        _LOTS,
        ("Recording of the ladder (review)", "recordings/ladder-{}.rrd"),
        ("JSON", "diagnosis/{}.json"),
    ),
    "comparison/{}.html": (
        ("All motors", INDEX),
        _DATASHEET,
        _DIAGNOSIS,
        _LOTS,
        ("Recording (review)", "recordings/comparison-{}.rrd"),
        ("JSON", "comparison/{}.json"),
    ),
    INDEX: (
        _LOTS,
        ("Constants as CSV", "fleet.csv"),
        ("Parquet", "fleet.parquet"),
        ("Findings", "findings.json"),
    ),
    LOTS: (("All motors", INDEX), ("JSON", "regression/report.json")),
}
"""What each kind of page leads to, relative to the output folder; `{}` is the motor's file name."""


def links_of(
    output: Path, page: str, motor_id: str = "", coming: Collection[str] = ()
) -> tuple[Link, ...]:
    """The links of a page of `output`: a key of the table above, of a motor where it has one.

    Parameters
    ----------
    output
        The output folder of a run.
    page
        Kind of the page.
    motor_id
        The motor, empty for a page of all motors.
    coming
        Files that do not exist yet and will when the page does.

    """
    stem = file_stem(motor_id) if motor_id else ""
    links = []
    for text, target in _OF_PAGE[page]:
        name = target.format(stem)
        if name in coming or (output / name).is_file():
            links.append(Link(text, f"../{quote(name, safe='/~')}"))
    return tuple(links)


def relink(output: Path, motor_id: str, but: Collection[str] = ()) -> dict[str, str]:
    """Rewrites the pages of a motor whose links are out of date; names and digests of them.

    What a run keeps of its work learns of its own pages: they are still what that work came to.
    Pages of the kinds `but` are left alone.

    Parameters
    ----------
    output
        The output folder of a run.
    motor_id
        The motor.
    but
        Kinds of pages that are left alone.

    """
    changed: dict[str, str] = {}
    for page in _OF_PAGE:
        if "{}" in page and page not in but:
            changed |= _relinked(output, page, motor_id)
    if changed:
        note_files(output, motor_id, tuple(changed.items()))
    return changed


def relink_index(output: Path) -> None:
    """Rewrites the page of all motors where its links are out of date.

    Parameters
    ----------
    output
        The output folder of a run.

    """
    _relinked(output, INDEX)


def _relinked(output: Path, page: str, motor_id: str = "") -> dict[str, str]:
    name = page.format(file_stem(motor_id) if motor_id else "")
    links = links_of(output, page, motor_id)
    return rewritten(output, name, lambda before: with_links(before, links))


def rewritten(output: Path, name: str, change: Callable[[str], str]) -> dict[str, str]:
    """Name and digest of a page that was there and that the change made another; else empty.

    Parameters
    ----------
    output
        The output folder of a run.
    name
        Name of the page in it.
    change
        The page as it should be, of the page as it is.

    """
    path = output / name
    if not path.is_file():
        return {}
    before = path.read_bytes()
    after = change(before.decode()).encode()
    if after == before:
        return {}
    write_whole(path, after)
    return {name: hashlib.sha256(after).hexdigest()}
