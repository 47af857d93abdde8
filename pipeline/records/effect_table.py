"""What a found effect adds to the ideal machine, as a table of what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.records.plain_form import PlainRecord


@dataclass(frozen=True, slots=True)
class EffectTable(PlainRecord):
    """One quantity that one effect adds, over a grid.

    Parameters
    ----------
    effect
        Name of the effect.
    quantity, unit
        `torque_nm`: torque that opposes positive rotation [N·m]. `psi_d_wb`, `psi_q_wb`: flux
        linkage, phase peak [Wb].
    axes
        Grid of each variable by its glossary name, whose last part is the unit: `omega_mech_rad_s`,
        `theta_mech_rad`, or `id_a` and `iq_a`.
    values
        In the unit, the last axis fastest.
    note
        Where the table holds, if not everywhere.

    """

    effect: str
    quantity: str
    unit: str
    axes: Mapping[str, tuple[float, ...]]
    values: tuple[float, ...]
    note: str = ""

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the axes."""
        return tuple(self.axes)


@dataclass(frozen=True, slots=True)
class EffectTables:
    """The tables of a motor's effects.

    Attributes
    ----------
    tables
        One for each quantity that an effect adds.
    without
        Why an effect has no table, by its name.

    """

    tables: tuple[EffectTable, ...] = ()
    without: Mapping[str, str] = field(default_factory=dict)
