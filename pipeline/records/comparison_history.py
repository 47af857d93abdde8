"""Which models of a motor were compared before, and what each came to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pipeline.records.comparison import Comparison
from pipeline.records.plain_form import plain_of, record_of

SCHEMA = "comparison-history/1"
MOST = 50


@dataclass(frozen=True, slots=True)
class Earlier:
    """One comparison in short: the model, its held-out error, and that without what was added."""

    name: str
    effects: tuple[str, ...]
    held_out: float
    bare: float | None

    @classmethod
    def of(cls, result: Comparison) -> Earlier:
        """What is kept of a comparison.

        Parameters
        ----------
        result
            The comparison.

        Raises
        ------
        ValueError
            Nothing was compared.

        """
        if result.held_out is None:
            raise ValueError(f"{result.motor_id}: nothing was compared")
        return cls(result.name, result.effects, result.held_out, result.bare)


def history_of(document: Mapping[str, Any] | None) -> tuple[Earlier, ...]:
    """The comparisons that a document holds.

    Parameters
    ----------
    document
        As `document_of` writes it, or None where there is no file.

    Returns
    -------
    tuple of Earlier
        Oldest first; empty for a document of any other form.

    """
    if document is None or document.get("schema") != SCHEMA:
        return ()
    try:
        return tuple(record_of(Earlier, one) for one in document["comparisons"])
    except (LookupError, TypeError, ValueError):
        return ()


def with_latest(earlier: Sequence[Earlier], latest: Earlier) -> tuple[Earlier, ...]:
    """The history with one more; the same model again takes the place of its last one.

    Parameters
    ----------
    earlier
        The comparisons so far, oldest first.
    latest
        The new one; it replaces an earlier one of the same model and effects.

    Returns
    -------
    tuple of Earlier
        The last `MOST` of them.

    """
    others = [e for e in earlier if (e.name, e.effects) != (latest.name, latest.effects)]
    return (*others, latest)[-MOST:]


def document_of(motor_id: str, history: Sequence[Earlier]) -> dict[str, Any]:
    """The JSON form of a motor's history, schema comparison-history/1.

    Parameters
    ----------
    motor_id
        The motor.
    history
        Oldest first.

    """
    return {"schema": SCHEMA, "motor_id": motor_id, "comparisons": plain_of(history)}
