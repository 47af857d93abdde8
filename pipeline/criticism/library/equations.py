"""Finds the equations: one file each in `equations/`, and in other packages."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.equation import Equation
from pipeline.plugins import discover


@cache
def equations() -> Mapping[str, Equation]:
    """Every equation by name, in the order in which a capture's segments are made."""
    discovered = discover("pipeline.criticism.equations", "EQUATION", Equation)
    ordered = sorted((one.value for one in discovered), key=lambda one: (one.rank, one.name))
    return {equation.name: equation for equation in ordered}


def equation_of(segment: Segment) -> Equation:
    """The equation that a segment is of.

    Parameters
    ----------
    segment
        The segment.

    """
    return equations()[segment.kind]
