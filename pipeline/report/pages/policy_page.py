"""The page of all constants of judgement, built from the policies themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

from pipeline.records.policy import Entry, Number, entries

_HEAD = """# Constants of judgement

Thresholds, shares and factors with unit, meaning and origin: *derived* from
something else, *calibrated* by a command on data, or *chosen*. To override some of them:

    python -m pipeline diagnose policy.selection.tie=9.0 ...
    python -m pipeline run fit.policy.SECTION.FIELD=number ...

The first is of models (`compare`, `diagnose`, residual test of `run`), the second of estimators.
`policy=NAME` takes `conf/policy/NAME.yaml`. A model carries its policy (`Model.policy`), and a
diagnosis names it by digest (`policy` in `diagnosis/MOTOR.json`). What moves when a number that was
chosen is halved or doubled is in [policy-sensitivity.md](policy-sensitivity.md).

Not here: constants of physics and mathematics, of formats and pictures, seeds, guards against
rounding (1e-300, cut-offs of pseudo-inverses), and sizes that a plug-in states for itself, such as
the negligible size of an effect.

This page is built by `python -m pipeline schemas`.
"""


def policy_page(policies: Mapping[str, Any]) -> str:
    """Markdown with one table a section of each policy, under the policies' titles.

    Parameters
    ----------
    policies
        Policies by title.

    """
    lines = [_HEAD]
    for title, policy in policies.items():
        lines += [f"## {title}\n", *_sections(policy)]
    return "\n".join([*lines, ""])


def _sections(policy: Any) -> Iterator[str]:
    for name, rows in groupby(entries(policy), key=lambda entry: entry.name.rpartition(".")[0]):
        yield f"### {name}\n"
        yield "| field | value | unit | meaning | origin |"
        yield "| --- | --- | --- | --- | --- |"
        yield from (_row(entry) for entry in rows)
        yield ""


def _row(entry: Entry) -> str:
    field = entry.name.rpartition(".")[2]
    origin = f"{entry.origin.kind}: {entry.origin.reason}"
    cells = (f"`{field}`", _value(entry.value), entry.unit, entry.meaning, origin)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _value(value: Number) -> str:
    return ", ".join(f"{one:.4g}" for one in value) if isinstance(value, tuple) else f"{value:g}"
