"""What every result of the public functions is: one thing a motor, by motor_id."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

One = TypeVar("One")


@dataclass(frozen=True, slots=True)
class ByMotor(Generic[One]):
    """Results by motor_id, in the order of the motors."""

    motors: Mapping[str, One]

    def __getitem__(self, motor_id: str) -> One:
        """The result of one motor."""
        return self.motors[motor_id]

    def __iter__(self) -> Iterator[str]:
        return iter(self.motors)

    def __len__(self) -> int:
        return len(self.motors)

    def motor_or_first(self, motor: str | None) -> str:
        """The motor_id that is asked for, the first one where none is."""
        return next(iter(self.motors)) if motor is None else motor
