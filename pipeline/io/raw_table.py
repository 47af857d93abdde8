"""What every reader hands on: named arrays of one clock, before units, signs and glossary names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class RawTable:
    """Fields [rows] by their own names.

    `log_time_ns` [rows] counts from the capture's first message, or is None where the file has no
    log clock; `blocks` says that rows of one message share it. `units` holds what a units row said.
    """

    name: str
    fields: dict[str, NDArray[Any]]
    log_time_ns: NDArray[np.uint64] | None = None
    blocks: bool = False
    joint_state: bool = False
    units: tuple[tuple[str, str], ...] = ()

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return next((int(values.size) for values in self.fields.values()), 0)
