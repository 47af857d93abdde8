"""The datasheet as a markdown page inside a recording."""

from __future__ import annotations

import re

from pipeline.physics.notation import reading
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate

_SPECIAL = re.compile(r"([\\`*_{}\[\]<>()#+\-!|~&])")


def sheet_markdown(datasheet: Datasheet, path: str) -> str:
    """Status, checks and constants of a motor; those that rest on the capture `path` come first."""
    names = sorted(datasheet.constants)
    own = [name for name in names if path in datasheet.constants[name].captures]
    rest = [name for name in names if name not in own]
    lines = [f"# {plain(datasheet.motor_id)}: {datasheet.status}", ""]
    lines += [f"- {plain(reason)}" for reason in datasheet.why]
    if own:
        lines += ["", "## Constants from this capture", "", *_table(datasheet, own)]
    if rest:
        lines += ["", "## Other constants", "", *_table(datasheet, rest)]
    lines += ["", "## Checks", "", "| check | result | meaning |", "| --- | --- | --- |"]
    for check in datasheet.checks:
        suspect = f"; suspect: {check.suspect}" if check.suspect else ""
        meaning = plain(check.meaning + suspect)
        lines.append(f"| {plain(check.name)} | {plain(check.status)} | {meaning} |")
    return "\n".join([*lines, "", f"version {datasheet.version}", ""])


def _table(datasheet: Datasheet, names: list[str]) -> list[str]:
    head = ["| constant | value ± U (k = 2) | method |", "| --- | --- | --- |"]
    return head + [_line(datasheet.constants[name]) for name in names]


def _line(estimate: Estimate) -> str:
    text = "not identifiable"
    if estimate.known:
        text = reading(estimate.number, estimate.u, estimate.unit).text()
        text += " (at its bound)" if estimate.at_bound else ""
    return f"| {plain(estimate.name)} | {text} | {plain(estimate.method)} |"


def plain(text: str) -> str:
    """Text that markdown leaves alone, on one line."""
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))
