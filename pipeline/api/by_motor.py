"""The base of the results of the public functions: one record a motor, by motor_id."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

import polars as pl

from pipeline.records.errors import meant
from pipeline.records.naming import counted

One = TypeVar("One")


def of_name(kind: str, name: str, known: Mapping[str, One]) -> One:
    """One of several by its name.

    Parameters
    ----------
    kind
        What they are, for the message.
    name
        The name.
    known
        All of them by name.

    Raises
    ------
    KeyError
        There is none of that name; the message has those there are.

    """
    if name not in known:
        raise KeyError(f"no {kind} {name!r}; {meant(str(name), known)}")
    return known[name]


class Shown(ABC):
    """What a terminal and a notebook show of a result: a title over one table, not its arrays."""

    __slots__ = ()

    @abstractmethod
    def _table(self) -> pl.DataFrame:
        """What is worth a look first."""

    def _title(self) -> str:
        return type(self).__name__

    def __repr__(self) -> str:
        return f"{self._title()}\n{self._table()}"

    def _repr_html_(self) -> str:
        return f"<p>{self._title()}</p>{self._table()._repr_html_()}"


@dataclass(frozen=True, slots=True, repr=False)
class ByMotor(Shown, Mapping[str, One]):
    """Results by motor_id, in the order of the motors.

    Attributes
    ----------
    motors : mapping
        The results by motor_id.

    """

    motors: Mapping[str, One]

    def __getitem__(self, motor_id: str) -> One:
        """The result of one motor."""
        return of_name("motor", motor_id, self.motors)

    def __iter__(self) -> Iterator[str]:
        return iter(self.motors)

    def __len__(self) -> int:
        return len(self.motors)

    def _title(self) -> str:
        return f"{type(self).__name__}: {counted(len(self), 'motor')}"

    def motor_or_first(self, motor: str | None) -> str:
        """A motor_id, or the first one.

        Parameters
        ----------
        motor : str, optional
            A motor_id.

        Returns
        -------
        str
            `motor`, or the first motor_id where it is None.

        Raises
        ------
        KeyError
            If `motor` is None and there is no motor.

        """
        if motor is None and not self.motors:
            raise KeyError("there is no motor")
        return next(iter(self.motors)) if motor is None else motor
