"""How far a batch is, on a terminal; silent anywhere else."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol


class Progress(Protocol):
    """Takes note of what is done."""

    def advance(self, number: int) -> None:
        """The motor of that number is done.

        Parameters
        ----------
        number
            Number of the motor in the batch.

        """
        ...


class _Silent:
    def advance(self, number: int) -> None:
        """Nothing is shown."""


@contextmanager
def progress(sizes: Sequence[tuple[int, int]]) -> Iterator[Progress]:
    """Shows motors, captures, MB/s and the time left; `sizes` are captures and bytes a motor.

    Parameters
    ----------
    sizes
        Captures and bytes of each motor.

    """
    if not sizes or not sys.stderr.isatty():
        yield _Silent()
        return
    with _Bar(sizes).shown() as bar:
        yield bar


class _Bar:
    def __init__(self, sizes: Sequence[tuple[int, int]]) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            TextColumn,
            TimeRemainingColumn,
            TransferSpeedColumn,
        )
        from rich.progress import Progress as Rich

        self.sizes = sizes
        self.motors = self.captures = 0
        # Speed and time left count bytes, since motors differ in how much was recorded of them.
        self.rich = Rich(
            TextColumn("{task.fields[motors]} motors"),
            BarColumn(),
            TextColumn("{task.fields[captures]} captures"),
            TransferSpeedColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        total = sum(size for _, size in sizes)
        self.task = self.rich.add_task("", total=total, **self._counts())

    def _counts(self) -> dict[str, Any]:
        captures = sum(count for count, _ in self.sizes)
        return {
            "motors": f"{self.motors}/{len(self.sizes)}",
            "captures": f"{self.captures}/{captures}",
        }

    @contextmanager
    def shown(self) -> Iterator[Progress]:
        """The bar on standard error, and gone at the end."""
        with self.rich:
            yield self

    def advance(self, number: int) -> None:
        """The motor of that number is done."""
        captures, size = self.sizes[number]
        self.motors += 1
        self.captures += captures
        self.rich.update(self.task, advance=size, **self._counts())
