"""The datasheet as a markdown page inside a recording."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache

from pipeline.physics.notation import reading
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.views.motor import check_number, ordered_checks

_MARKS = {"fail": "✗ fail", "marginal": "⚠ marginal", "not_evaluated": "–", "pass": "✓ pass"}
_SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#+\-!|~&])")


def sheet_markdown(datasheet: Datasheet, first: Sequence[str]) -> str:
    """Status, constants and checks of a motor as a page.

    Parameters
    ----------
    datasheet
        The datasheet.
    first
        Constants that come first.

    """
    lines = [f"# {plain(datasheet.motor_id)}: {datasheet.status}", ""]
    lines += [f"- {plain(reason)}" for reason in datasheet.why]
    names = [name for name in first if name in datasheet.constants]
    lines += _constants_and_checks(datasheet, names, "Key constants")
    return "\n".join([*lines, "", f"version {datasheet.version}", ""])


def capture_markdown(datasheet: Datasheet, path: str) -> str:
    """Constants and checks of a motor as a page beside one of its captures.

    The status is not in it: it may change while the capture does not.

    Parameters
    ----------
    datasheet
        The datasheet; its status, reasons and verdict on the model are not read.
    path
        Constants that rest on this capture come first.

    """
    names = [
        name for name in sorted(datasheet.constants) if path in datasheet.constants[name].captures
    ]
    lines = [f"# {plain(datasheet.motor_id)}"]
    lines += _constants_and_checks(datasheet, names, "Constants from this capture")
    return "\n".join([*lines, "", "Its status is in the recording of the motor.", ""])


def _constants_and_checks(datasheet: Datasheet, leading: Sequence[str], heading: str) -> list[str]:
    further = [name for name in sorted(datasheet.constants) if name not in leading]
    lines = ["", f"## {heading}", "", *_table(datasheet, leading)] if leading else []
    if further:
        lines += ["", "## Other constants", "", *_table(datasheet, further)]
    return [*lines, "", "## Checks", "", *_checks(datasheet)]


def checks_markdown(datasheet: Datasheet) -> str:
    """Every check with its value and limit, and the captures that a datasheet rests on, as a page.

    Parameters
    ----------
    datasheet
        The datasheet.

    """
    lines = [f"# {plain(datasheet.motor_id)}: checks", "", *_checks(datasheet), ""]
    lines += ["## Captures", "", "| capture | test | integrity |", "| --- | --- | --- |"]
    lines += [
        f"| {plain(one.path)} | {plain(one.test)} | {plain(one.integrity)} |"
        for one in datasheet.captures
    ]
    return "\n".join([*lines, ""])


def _checks(datasheet: Datasheet) -> Iterator[str]:
    """The failed ones first."""
    yield "| | check | value | limit | meaning |"
    yield "| --- | --- | --- | --- | --- |"
    for check in ordered_checks(datasheet.checks):
        suspect = f"; suspect: {check.suspect}" if check.suspect else ""
        value = check_number(check.value, check.unit)
        limit = check_number(check.limit, check.unit, 3)
        yield (
            f"| {_MARKS[check.status]} | {plain(check.name)} | {value} | {limit} "
            f"| {plain(check.meaning + suspect)} |"
        )


def _table(datasheet: Datasheet, names: Sequence[str]) -> list[str]:
    head = ["| constant | value ± U (k = 2) | method |", "| --- | --- | --- |"]
    return head + [_line(datasheet.constants[name]) for name in names]


def _line(estimate: Estimate) -> str:
    text = "not identifiable"
    if estimate.known:
        text = _text(estimate.number, estimate.u, estimate.unit)
        text += " (at its bound)" if estimate.at_bound else ""
    return f"| {plain(estimate.name)} | {text} | {plain(estimate.method)} |"


@lru_cache(1024)
def _text(value: float, u: float, unit: str) -> str:
    """A reading as text; every capture of a motor shows the same ones."""
    return reading(value, u, unit).text()


@lru_cache(1024)
def plain(text: str) -> str:
    """Text that Markdown leaves unchanged, on one line.

    Parameters
    ----------
    text
        Any text.

    """
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))
