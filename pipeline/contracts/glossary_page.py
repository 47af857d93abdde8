"""`docs/glossary.md`, built from the glossary and the table of what each test holds at least."""

from __future__ import annotations

from collections.abc import Iterable

from pipeline.contracts.requirements import requirements
from pipeline.physics.glossary import COLUMNS, CONSTANTS, METADATA, TESTS, Term
from pipeline.physics.units import SUFFIX_UNITS

HEAD = """# Glossary

Every name once, with its unit. Names end in their unit; the suffixes are a closed table.
Built by `python -m pipeline schemas`; a test compares it with the code. Do not edit.
"""


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def _range(term: Term) -> str:
    if term.low is None or term.high is None:
        return ""
    whole = ", whole" if term.integer else ""
    return f"{term.low:g} to {term.high:g}{whole}"


def _terms(terms: Iterable[Term]) -> str:
    rows = ((f"`{t.name}`", t.unit, t.words, _range(t)) for t in terms)
    return _table(("name", "unit", "meaning", "plausible"), rows)


def _tests() -> str:
    rows = (
        (f"`{name}`", words, "; ".join(r.text() for r in requirements(name)))
        for name, words in TESTS.items()
    )
    return _table(("test", "what was done", "holds at least"), rows)


def glossary_page() -> str:
    """The page in Markdown: suffixes, columns, tests, metadata, constants."""
    suffixes = _table(("suffix", "unit"), ((f"`_{s}`", u) for s, u in SUFFIX_UNITS.items()))
    parts = {
        "Columns of a capture": _terms(COLUMNS.values()),
        "Tests": _tests(),
        "Metadata of a capture": _terms(METADATA.values()),
        "Constants of a datasheet": _terms(CONSTANTS.values()),
        "Unit suffixes": suffixes,
    }
    return HEAD + "".join(f"\n## {title}\n\n{body}" for title, body in parts.items())
