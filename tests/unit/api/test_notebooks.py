"""The notebooks of the manual run, and say what they are kept to say."""

from __future__ import annotations

import json

import pytest

from tests.notebooks import notebooks, run, text_of

FIRST, *OTHERS = notebooks()


@pytest.mark.parametrize(
    "path",
    # what the second does, test_models.py does on fewer captures
    [FIRST, *(pytest.param(path, marks=pytest.mark.slow) for path in OTHERS)],
    ids=lambda path: path.stem,
)
def test_a_notebook_runs_and_its_texts_are_up_to_date(path):
    kept = json.loads(path.read_text(encoding="utf-8"))
    now = text_of(run(path))
    assert now == text_of(kept), "run `python -m tests.notebooks` and look at what changed"


def test_the_first_ends_in_a_refusal_and_the_second_in_the_effect():
    first, second = ("\n".join(text_of(json.loads(p.read_text()))) for p in notebooks())
    assert "refused" in first
    assert "resistance_balance" in first
    assert '["stribeck"]' in second
