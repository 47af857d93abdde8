"""The words by which versions are chosen: `lot:2026-W*,station:bench-1`.

A selector is a list of terms separated by commas. A term is `field:value` or `field=value`; a value
alone belongs to the field before it. Values of one field are alternatives, different fields must
all hold: `lot:A,B,station:S1` is lot A or B on station S1. `*` and `?` stand for any text and any
character, and a value in quotes is taken as it stands, commas and all. A first value without field
is looked up as a lot, then as a tag, a motor type, a station, a motor, a version.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from fnmatch import fnmatchcase

from pipeline.records.errors import UsageError
from pipeline.records.ledger import Version
from pipeline.records.parse import utc_moment

FIELDS: Mapping[str, str] = {
    "lot": "lot",
    "type": "motor type",
    "station": "station of any capture",
    "motor": "serial number",
    "tag": "name given by `registry tag`",
    "status": "released, provisional, refused or revoked",
    "version": "beginning of the version's digest, four hex digits at least",
    "revision": "1, 2, ... of the motor",
    "code": "beginning of the code version that made it",
    "date": "day, month or year of the tests, or FROM..TO",
    "since": "first day of the tests",
    "until": "last day of the tests",
}
ALIASES = {"motor_type": "type", "motor_id": "motor", "lots": "lot", "code_version": "code"}
LOOKED_UP = ("lot", "tag", "type", "station", "motor", "version")
OF_CONTENT = ("code", "date", "since", "until")
TERM = re.compile(
    r"""\s*(?:(?P<field>[A-Za-z_]+)\s*[:=]\s*)?"""
    r"""(?:"(?P<double>[^"]*)"|'(?P<single>[^']*)'|(?P<bare>[^,;"']*))\s*(?:[,;]|$)"""
)
DIGEST = re.compile("[0-9a-f]{4,64}")
MAX_CHARS = 4096


@dataclass(frozen=True, slots=True)
class Wanted:
    """One value of a selector; `literal` where it was quoted, so that `*` is a star."""

    text: str
    literal: bool = False

    def fits(self, value: str | None) -> bool:
        """Whether a text is meant.

        Parameters
        ----------
        value
            The text; None is never meant.

        """
        if value is None:
            return False
        return value == self.text or (not self.literal and fnmatchcase(value, self.text))


@dataclass(frozen=True, slots=True)
class Query:
    """A selector taken apart: alternatives by field, in the order given."""

    text: str
    terms: Mapping[str, tuple[Wanted, ...]]

    def takes(self, version: Version) -> bool:
        """Whether the row and the decisions of a version are meant.

        Parameters
        ----------
        version
            The version; a revoked one is meant only by its status.

        """
        if "status" not in self.terms and version.status == "revoked":
            return False
        return all(
            any(ROW[name](version, one) for one in wanted)
            for name, wanted in self.terms.items()
            if name not in OF_CONTENT
        )

    def takes_content(self, code_version: str, when: str) -> bool:
        """Whether a datasheet is meant by its code and the time of its tests.

        Parameters
        ----------
        code_version
            Of the datasheet.
        when
            ISO 8601.

        """
        day = _instant(when)
        for name, wanted in self.terms.items():
            if name == "code" and not any(
                code_version.startswith(one.text) or one.fits(code_version) for one in wanted
            ):
                return False
            spans = (
                [_span(one.text) for one in wanted] if name in ("date", "since", "until") else []
            )
            if name == "date" and not any(low <= day < high for low, high in spans):
                return False
            if name == "since" and any(day < low for low, _ in spans):
                return False
            if name == "until" and any(day >= high for _, high in spans):
                return False
        return True


def parse_selector(text: str, versions: Sequence[Version]) -> Query:
    """The query of a selector.

    Parameters
    ----------
    text
        As described in the module, such as `lot:A,B,station:bench-1`.
    versions
        What a value without field is looked up in.

    Returns
    -------
    Query
        Alternatives by field.

    Raises
    ------
    UsageError
        The selector is empty or too long, a field unknown, a quote open, a value no date, revision
        or digest; or nothing bears a value without field.

    """
    if not text.strip() or len(text) > MAX_CHARS:
        raise UsageError("the selector is empty or too long", _example())
    terms: dict[str, list[Wanted]] = {}
    field: str | None = None
    for name, term in _terms(text):
        if name is not None:
            field = ALIASES.get(name.lower(), name.lower())
            if field not in FIELDS:
                raise UsageError(
                    f"selector {text!r}: no field {name!r}", f"known are {', '.join(FIELDS)}"
                )
        elif field is None:
            field = _looked_up(text, term, versions)
        _checked(text, field, term)
        terms.setdefault(field, []).append(term)
    return Query(text, {name: tuple(wanted) for name, wanted in terms.items()})


def _terms(text: str) -> Iterable[tuple[str | None, Wanted]]:
    place = 0
    while place < len(text):
        match = TERM.match(text, place)
        if match is None or match.end() == place:
            raise UsageError(f"selector {text!r}: cannot read {text[place:]!r}", _example())
        place = match.end()
        quoted = match["double"] if match["double"] is not None else match["single"]
        value = (match["bare"] or "").strip() if quoted is None else quoted
        if not value:
            raise UsageError(f"selector {text!r}: a value is missing", _example())
        yield match["field"], Wanted(value, quoted is not None)


def _example() -> str:
    return "write lot:A, or lot:A,B,station:bench-1; `regress --help` lists the fields"


def _looked_up(text: str, one: Wanted, versions: Sequence[Version]) -> str:
    for name in LOOKED_UP:
        if name == "version" and not DIGEST.fullmatch(one.text):
            continue
        if any(ROW[name](version, one) for version in versions):
            return name
    raise UsageError(f"selector {text!r}: nothing is called {one.text!r}", known(versions))


def known(versions: Sequence[Version], most: int = 12) -> str:
    """The values that selectors can name, in one line.

    Parameters
    ----------
    versions
        Versions of the registry.
    most
        How many of each kind are listed.

    """
    published = [version.published for version in versions]
    groups = (
        ("lots", {row.lot for row in published}),
        ("types", {row.motor_type for row in published}),
        ("stations", {station for row in published for station in row.stations}),
        ("tags", {tag for version in versions for tag in version.tags}),
    )
    parts = []
    for name, texts in groups:
        names = sorted(text for text in texts if text)
        if names:
            more = f" and {len(names) - most} more" if len(names) > most else ""
            parts.append(f"{name} {', '.join(names[:most])}{more}")
    return (
        "there are " + "; ".join(parts) if parts else "the registry names no lot, type or station"
    )


def _checked(text: str, field: str, one: Wanted) -> None:
    if field in ("date", "since", "until"):
        try:
            _span(one.text)
        except (ValueError, OverflowError) as error:
            raise UsageError(
                f"selector {text!r}: {one.text!r} is no date", "write 2026-03-01 or 2026-03"
            ) from error
    if field == "revision" and not (one.text.isascii() and one.text.isdigit()):
        raise UsageError(f"selector {text!r}: {one.text!r} is no revision", "write 1, 2, ...")
    if field == "version" and not DIGEST.fullmatch(one.text):
        raise UsageError(f"selector {text!r}: {one.text!r} is no digest", "at least 4 hex digits")


def _span(text: str) -> tuple[datetime, datetime]:
    """The time from, and the time before which: of a day, a month, a year or `FROM..TO`."""
    if ".." in text:
        first, last = text.split("..", 1)
        return _span(first)[0], _span(last)[1]
    parts = [int(part) for part in text.strip().split("-")]
    if len(parts) == 1:
        return _midnight(date(parts[0], 1, 1)), _midnight(date(parts[0] + 1, 1, 1))
    if len(parts) == 2:
        year, month = parts
        after = date(year + month // 12, month % 12 + 1, 1)
        return _midnight(date(year, month, 1)), _midnight(after)
    day = date(*parts)
    return _midnight(day), _midnight(day + timedelta(days=1))


def _midnight(day: date) -> datetime:
    return datetime(day.year, day.month, day.day, tzinfo=UTC)


def _instant(when: str) -> datetime:
    instant = utc_moment(when)
    if instant is None:
        raise ValueError(f"{when[:60]!r} is no date")
    return instant


ROW: Mapping[str, Callable[[Version, Wanted], bool]] = {
    "lot": lambda version, one: one.fits(version.published.lot),
    "type": lambda version, one: one.fits(version.published.motor_type),
    "station": lambda version, one: any(map(one.fits, version.published.stations)),
    "motor": lambda version, one: one.fits(version.motor_id),
    "tag": lambda version, one: any(map(one.fits, version.tags)),
    "status": lambda version, one: one.fits(version.status),
    "version": lambda version, one: version.version.startswith(one.text),
    "revision": lambda version, one: version.revision == int(one.text),
}
