"""`registry` as a person types it: what it prints, and one line for each mistake."""

from __future__ import annotations

import shlex
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.cli.commands import COMMANDS
from pipeline.io.registry.store import Registry
from pipeline.records.errors import UsageError
from pipeline.stages.registry import moment
from tests.registered import HOUR, NOON, document, version_of

SERIAL = "joint/7\x1b[31m"
ESCAPED = r"joint/7\x1b[31m"
WHO = ("by=A. Smith", "why=bench 2 agrees")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Revisions 1, 2, 3 of a motor (the last refused), 10 mohm apart; one of another."""
    place = str(tmp_path_factory.mktemp("built") / "registry")
    registry = Registry(place)
    registry.publish([document(SERIAL, 1, r_ohm=0.30), document("00123", 1)], NOON)
    registry.publish([document(SERIAL, 2, r_ohm=0.31)], NOON + HOUR)
    why = ["check kt_vs_ke failed: Kt over 1.5 p psi"]
    registry.publish([document(SERIAL, 3, status="refused", why=why)], NOON + 2 * HOUR)
    return place


@pytest.fixture
def place(built: str, tmp_path: Path) -> str:
    """A copy to write to; a registry may be moved."""
    return str(shutil.copytree(built, tmp_path / "registry"))


def told(capsys: pytest.CaptureFixture[str], place: str, *words: str) -> tuple[int, str, str]:
    code = main(["registry", *words, f"registry={place}"])
    seen = capsys.readouterr()
    return code, seen.out, seen.err


def test_list(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A row a version; nothing in a serial number reaches the terminal as a command."""
    code, out, _ = told(capsys, place, "list")
    assert code == 0
    lines = out.splitlines()
    assert lines[0].split()[:3] == ["motor", "revision", "status"]
    assert [line.split()[:3] for line in lines[1:5]] == [
        ["00123", "1", "provisional"],
        ["joint/7\\x1b[31m", "1", "provisional"],
        ["joint/7\\x1b[31m", "2", "provisional"],
        ["joint/7\\x1b[31m", "3", "refused"],
    ]
    assert lines[-2] == "2 motors, 4 versions"
    assert lines[-1].endswith(f"registry show 00123 registry={place}")
    assert "\x1b" not in out
    assert max(map(len, lines[:-1])) <= 80
    assert told(capsys, place, "list", "00123")[1].splitlines()[-2] == "1 motor, 1 version"


def test_show_takes_the_newest_or_the_one_named(
    place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    newest = told(capsys, place, "show", SERIAL)[1]
    assert newest.startswith("joint/7\\x1b[31m revision 3: refused\n")
    assert "kt_vs_ke failed" in newest
    second = told(capsys, place, "show", SERIAL, "revision=2")[1]
    assert "310.0 \u00b1 1.0 m\u03a9" in second
    prefix = version_of(SERIAL, 2)[:8]
    assert told(capsys, place, "show", SERIAL, f"version={prefix}")[1] == second


def test_diff_in_units_of_uncertainty(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    """10 mohm; u 0.5 mohm each, of which 0.4 mohm is one voltmeter's: 14.14 and 23.57."""
    code, out, _ = told(capsys, place, "diff", SERIAL, "from=1", "to=2")
    assert code == 0
    lines = out.splitlines()
    assert max(map(len, lines[:-1])) <= 80
    words = [w for line in lines if line.startswith("r_phase_ohm") for w in line.split()[1:]]
    assert words[-4:] == ["+10.0", "m\u03a9", "+14.14", "+23.57"]
    unknown = [w for line in lines if line.startswith("j_rotor_kgm2") for w in line.split()[1:]]
    assert unknown == ["-"] * 5


def test_approve_revoke_and_at(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is valid before the approval, revision 1 after it, nothing after its revocation."""
    decision = [SERIAL, "revision=1", "by=A. Smith", "why=bench 2 agrees"]
    code, out, _ = told(capsys, place, "approve", *decision)
    assert (code, "revision 1 is released: approved by A. Smith on" in out) == (0, True)
    assert "already so" in told(capsys, place, "approve", *decision)[1]
    out = told(capsys, place, "at", "2999-01-01")[1]
    (row,) = [line for line in out.splitlines() if line.startswith("joint/7")]
    assert "revision 1" in row
    assert row.endswith("revision 3, refused")
    then = told(capsys, place, "at", "2026-03-01")[1]
    assert "2 motors, 0 with a released datasheet at 2026-03-01T23:59:59Z" in then
    assert "nothing was published" in told(capsys, place, "at", "2026-02-28")[1]
    told(capsys, place, "revoke", *decision)
    again = told(capsys, place, "at", "date=2999-01-01", f"motor={SERIAL}")[1]
    assert "1 motor, 0 with" in again


def test_a_refused_version_may_be_revoked_and_is_never_released(
    place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Wrong bytes may be refused ones; revoked, they make way for the right ones."""
    decision = [SERIAL, "revision=3", "by=A. Smith", "why=wrong unit"]
    code, out, _ = told(capsys, place, "revoke", *decision)
    assert (code, "revision 3 is revoked: revoked by A. Smith" in out) == (0, True)
    code, _, err = told(capsys, place, "approve", *decision)
    assert (code, "is refused: check kt_vs_ke" in err) == (2, True)


def test_verify(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = told(capsys, place, "verify")
    assert (code, err) == (0, "")
    assert "4 versions, 0 decisions, all of it as published" in out
    for path in Path(place).rglob("_versions/*/*.json"):
        path.write_bytes(path.read_bytes() + b" ")
    code, out, err = told(capsys, place, "verify")
    assert code == 1
    assert "4 mismatches" in out
    assert err.count("mismatch: _versions/") == 4


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["list"], "registry show 00123 registry={}"),
        (["show", "00123"], "registry approve 00123 revision=1 by=NAME why=REASON registry={}"),
        (["diff", SERIAL, "from=1", "to=2"], f"registry approve '{ESCAPED}' revision=2 "),
        (["diff", SERIAL, "from=2", "to=3"], f"plan motor='{ESCAPED}' output=reports/demo"),
        (["at", "2999-01-01"], "registry show 00123 revision=1 registry={}"),
        (["verify"], "registry list registry={}"),
        (["tag", "00123", "tag=gold", "by=A"], "regress baseline=tag:gold candidate=lot:LOT "),
        (["untag", "00123", "tag=gold", "by=A"], "registry list registry={}"),
        (["approve", "00123", "revision=1", *WHO], "export json 00123 revision=1 registry={}"),
        (["revoke", "00123", "revision=1", *WHO], "registry list 00123 registry={}"),
    ],
)
def test_every_action_ends_with_the_next_command(
    place: str, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    """It names the registry that was worked on, and is one of the command line's own."""
    code, out, err = told(capsys, place, *words)
    assert (code, err) == (0, "")
    program, _, command = out.splitlines()[-1].removeprefix("next: ").partition("pipeline ")
    assert program == "python -m "
    assert command.startswith(said.format(place))
    assert place in command or command.startswith("plan")
    assert shlex.split(command)[0] in COMMANDS


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "the action is missing"),
        (["dance"], "no action 'dance'"),
        (["list", "nobody"], "no motor 'nobody'"),
        (["show"], "motor= is missing"),
        (["show", "nobody"], "no motor 'nobody'"),
        (["show", "00123", "revision=2"], "no motor '00123' revision 2"),
        (["show", "00123", "revision=-1"], "revision=-1 is no revision"),
        (["show", "00123", "revision=1e3"], "revision=1e3 is no revision"),
        (["show", "00123", "version=x"], "version=x is no digest"),
        (["diff", "00123"], "from=, to= are missing; add from=... to=..."),
        (["diff", "00123", "from=1"], "to= is missing"),
        (["diff", "00123", "from=1", "to=5"], "no motor '00123' revision 5"),
        (["at"], "the date is missing"),
        (["at", "yesterday"], "date=yesterday is no date"),
        (["approve", "00123", "by=A", "why=B"], "revision= is missing"),
        (["approve", "00123", "version=", "by=A", "why=B"], "version= is missing"),
        (["approve", "00123"], "revision=, by=, why= are missing"),
        (["revoke"], "motor=, revision=, by=, why= are missing"),
        (["tag", "00123"], "tag=, by= are missing"),
        (["approve", "00123", "revision=1", "why=B"], "by= is missing"),
        (["approve", "00123", "revision=1", "by=A", "why= "], "why= is missing"),
        (["approve", "00123", "revision=9", "by=A", "why=B"], "revision 9"),
        (["approve", SERIAL, "revision=3", "by=A", "why=B"], "is refused: check kt_vs_ke"),
    ],
)
def test_a_mistake_is_one_line_and_exit_2(
    built: str, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    code, out, err = told(capsys, built, *words)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err
    assert "\x1b" not in err


def test_no_registry_is_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for action in ("list", "verify"):
        code, _, err = told(capsys, str(tmp_path / "none"), action)
        assert code == 2
        assert "no registry at" in err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2026-03-01", datetime(2026, 3, 1, 23, 59, 59, 999999, tzinfo=UTC)),
        ("2026-03-01T12:00", datetime(2026, 3, 1, 12, tzinfo=UTC)),
        ("2026-03-01T12:00Z", datetime(2026, 3, 1, 12, tzinfo=UTC)),
        ("2026-03-01T12:00:00.25+05:30", datetime(2026, 3, 1, 6, 30, 0, 250000, tzinfo=UTC)),
    ],
)
def test_moments(text: str, expected: datetime) -> None:
    assert moment(text) == expected


@pytest.mark.parametrize("text", ["", "2026", "2026-13-01", "0001-01-01T00:00+12:00", "now"])
def test_no_moments(text: str) -> None:
    with pytest.raises(UsageError):
        moment(text)
