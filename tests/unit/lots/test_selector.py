"""The words by which versions are chosen."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from pipeline.lots.selector import parse_selector
from pipeline.records.errors import UsageError
from pipeline.records.ledger import Event, Version

NOON = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


def version(
    motor: str,
    lot: str | None = "A",
    station: str = "S1",
    digest: str = "ab" * 32,
    tags: tuple[str, ...] = (),
    decisions: tuple[str, ...] = (),
) -> Version:
    row = Event(1, NOON, "publish", motor, digest, 1, "gimbal", lot, (station,), "provisional", ())
    made = tuple(Event(2, NOON, kind, motor, digest, 1) for kind in decisions)  # type: ignore[arg-type]
    return Version(row, made, frozenset(tags))


SHELF = (
    version("m1", "A", "S1", "ab12" * 16),
    version("m2", "B", "S2", "cd34" * 16, tags=("golden",)),
    version("m3", "2026-W06", "S1", "ef56" * 16),
    version("m4", "lot, with comma", "S2", "1234" * 16),
    version("m5", "A*", "S3", "9876" * 16),
    version("m6", "A", "S3", "5555" * 16, decisions=("revoke",)),
)


def chosen(text: str) -> list[str]:
    query = parse_selector(text, SHELF)
    return [one.motor_id for one in SHELF if query.takes(one)]


@pytest.mark.parametrize(
    ("text", "motors"),
    [
        ("lot:A", ["m1"]),
        ("lot=A", ["m1"]),
        ("A", ["m1"]),
        (" lot : A ", ["m1"]),
        ("lot:A,B", ["m1", "m2"]),
        ("lot:A,lot:B", ["m1", "m2"]),
        ("A,B", ["m1", "m2"]),
        ("lot:A,B;station:S2", ["m2"]),
        ("2026-W*", ["m3"]),
        ("lot:2026-W??", ["m3"]),
        ("golden", ["m2"]),
        ("tag:golden", ["m2"]),
        ("type:gimbal", ["m1", "m2", "m3", "m4", "m5"]),
        ("motor_type=gimbal,station=S1", ["m1", "m3"]),
        ("version:cd34", ["m2"]),
        ("motor:m1,m3", ["m1", "m3"]),
        ('"lot, with comma"', ["m4"]),
        ("lot:'lot, with comma'", ["m4"]),
        ("lot:'A*'", ["m5"]),
        ("lot:A*", ["m1", "m5"]),
        ("status:revoked", ["m6"]),
        ("status:provisional", ["m1", "m2", "m3", "m4", "m5"]),
        ("revision:1", ["m1", "m2", "m3", "m4", "m5"]),
        ("lot:C", []),
    ],
)
def test_what_a_selector_takes(text: str, motors: list[str]) -> None:
    assert chosen(text) == motors


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("   ", "empty"),
        ("colour:red", "no field 'colour'"),
        ("nothing-like-it", "nothing is called"),
        ("lot:", "a value is missing"),
        ('lot:"A', "cannot read"),
        ("lot:A,,B", "a value is missing"),
        ("revision:one", "no revision"),
        ("version:zz", "no digest"),
        ("date:tomorrow", "no date"),
        ("date:2026-13", "no date"),
        ("x" * 5000, "too long"),
    ],
)
def test_what_it_refuses(text: str, words: str) -> None:
    """One line that says what is wrong; an unknown name is answered by what there is."""
    with pytest.raises(UsageError, match=words) as caught:
        parse_selector(text, SHELF)
    assert "\n" not in str(caught.value)


def test_an_unknown_name_is_told_what_there_is() -> None:
    with pytest.raises(UsageError, match=r"lots 2026-W06, A, A\*, B, .*stations S1, S2, S3"):
        parse_selector("C", SHELF)


@pytest.mark.parametrize(
    ("text", "taken"),
    [
        ("date:2026-03-01", True),
        ("date:2026-03", True),
        ("date:2026", True),
        ("date:2026-03-02", False),
        ("date:2026-02-01..2026-03-01", True),
        ("date:2026-02..2026-02", False),
        ("since:2026-03-01", True),
        ("since:2026-03-02", False),
        ("until:2026-03-01", True),
        ("until:2026-02-28", False),
        ("since:2026-01,until:2026-12", True),
        ("date:2025,2026", True),
        ("code:0.1.0+ab", True),
        ("code:0.1.0+cd", False),
    ],
)
def test_dates_and_code(text: str, taken: bool) -> None:
    """Days are whole days in UTC; the last instant of one belongs to it."""
    query = parse_selector(text, SHELF)
    assert query.takes_content("0.1.0+abcdef", "2026-03-01T23:59:59Z") == taken


def test_a_zone_is_heeded() -> None:
    query = parse_selector("date:2026-03-01", SHELF)
    assert query.takes_content("x", "2026-03-02T00:30:00+01:00")
    assert not query.takes_content("x", "2026-03-02T00:30:00")


@pytest.mark.parametrize(
    ("text", "first", "after"),
    [
        ("date:2025", "2025-01-01", "2026-01-01"),
        ("date:2025-12", "2025-12-01", "2026-01-01"),
        ("date:2025-11", "2025-11-01", "2025-12-01"),
        ("date:2024-02", "2024-02-01", "2024-03-01"),
        ("date:2024-02-28", "2024-02-28", "2024-02-29"),
        ("date:2025-12-31", "2025-12-31", "2026-01-01"),
        ("date:2024-02..2025", "2024-02-01", "2026-01-01"),
    ],
)
def test_a_span_holds_its_first_instant_and_not_the_next_ones(
    text: str, first: str, after: str
) -> None:
    query = parse_selector(text, SHELF)
    before = (datetime.fromisoformat(first) - timedelta(seconds=1)).isoformat()
    last = (datetime.fromisoformat(after) - timedelta(seconds=1)).isoformat()
    assert [query.takes_content("x", when) for when in (before, first, last, after)] == [
        False,
        True,
        True,
        False,
    ]


def test_a_selector_has_4096_characters() -> None:
    long = "lot:A" + ",A" * 2045
    assert len(long) == 4095
    assert parse_selector(f"{long} ", SHELF).takes(SHELF[0])
    with pytest.raises(UsageError, match="too long"):
        parse_selector(f"{long}  ", SHELF)


def test_any_of_several_codes_or_days_will_do() -> None:
    for text in ("code:0.1.0+ab,0.2.0", "date:2026-03-01,2026-03-05"):
        query = parse_selector(text, SHELF)
        assert query.takes_content("0.2.0+ffff", "2026-03-05T08:00:00Z")
        assert query.takes_content("0.1.0+abcd", "2026-03-01T08:00:00Z")
        assert not query.takes_content("0.3.0", "2026-03-03T08:00:00Z")
