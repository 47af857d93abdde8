"""The base of the results of the public functions: one record a motor, by motor_id."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

One = TypeVar("One")


@dataclass(frozen=True, slots=True)
class ByMotor(Generic[One]):
    """Results by motor_id, in the order of the motors.

    Attributes
    ----------
    motors : mapping
        The results by motor_id.

    """

    motors: Mapping[str, One]

    def __getitem__(self, motor_id: str) -> One:
        """The result of one motor."""
        return self.motors[motor_id]

    def __iter__(self) -> Iterator[str]:
        return iter(self.motors)

    def __len__(self) -> int:
        return len(self.motors)

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

        """
        return next(iter(self.motors)) if motor is None else motor
