"""Projection of sampled residuals on smooth windows times harmonics of the shaft angle.

Test functions that vanish smoothly at both ends move time derivatives off the noisy signal
without taking any, and the harmonics show at which order of the shaft an error sits.

References: [1] Messenger & Bortz, J. Comput. Phys. 443 (2021) 110525, section 3: test functions
(1 − u²)^p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Projection:
    """Test functions over one clock.

    Attributes
    ----------
    starts
        First samples of the windows [W].
    functions
        Test functions [W, M, N], of unit sum of squares each.
    orders
        Order a turn of each function [M]; 0 for the plain window.
    valid
        Where a window [W, M] holds enough cycles of the order and enough samples a cycle.

    """

    starts: NDArray[np.int64]
    functions: Array
    orders: NDArray[np.int64] | Array
    valid: NDArray[np.bool_]

    @property
    def length(self) -> int:
        """Samples a window."""
        return int(self.functions.shape[2])

    def project(self, residuals: Array) -> Array:
        """Weak residuals: sums of sampled ones times the test functions.

        Parameters
        ----------
        residuals
            [C, n], any unit.

        Returns
        -------
        array [C, W, M]
            In the same unit, of the same standard deviation where the residuals are white: the
            functions have unit sum of squares.

        """
        windows = sliding_window_view(residuals, self.length, axis=1)[:, self.starts, :]
        return np.matmul(self.functions, windows.transpose(1, 2, 0)).transpose(2, 0, 1)

    def means(self, signals: Array) -> Array:
        """Means over each window, weighted with the plain window.

        Parameters
        ----------
        signals
            [C, n], any unit.

        Returns
        -------
        array [C, W]
            Same unit.

        """
        order_zero = self.functions[:, :1, :]
        weights = order_zero / order_zero.sum(axis=2, keepdims=True)
        windows = sliding_window_view(signals, self.length, axis=1)[:, self.starts, :]
        return np.matmul(weights, windows.transpose(1, 2, 0))[:, 0, :].T

    def only(self, windows: NDArray[np.bool_]) -> Projection:
        """The same test functions over some of the windows.

        Parameters
        ----------
        windows
            Which [W] are kept.

        """
        return Projection(
            self.starts[windows], self.functions[windows], self.orders, self.valid[windows]
        )


def bump(length: int) -> Array:
    """A smooth window that vanishes, with three derivatives, at both ends.

    Parameters
    ----------
    length
        Samples [1].

    Returns
    -------
    array [length]
        (1 − u²)⁴ with u from −1 to 1 at the centres of equal cells.

    """
    u = (2.0 * np.arange(length) + 1.0) / length - 1.0
    return (1.0 - u * u) ** 4


def window_starts(
    keep: NDArray[np.bool_], length: int, hop: int | None = None, most: int | None = None
) -> NDArray[np.int64]:
    """First samples of the windows that hold usable samples only.

    Parameters
    ----------
    keep
        Which samples are usable [n].
    length
        Samples a window.
    hop
        Samples from one window to the next; half a window by default.
    most
        Most windows; of more than that an even selection stays.

    Returns
    -------
    array [W]
        Rising row numbers.

    Examples
    --------
    >>> keep = np.array([True, True, True, True, False, True, True, True])
    >>> window_starts(keep, 3, hop=1).tolist()
    [0, 1, 5]

    """
    starts: NDArray[np.int64] = np.arange(
        0, max(keep.size - length, -1) + 1, hop or max(length // 2, 1)
    )
    missing = np.concatenate([[0], np.cumsum(~keep)])
    starts = starts[missing[starts + length] == missing[starts]]
    if most is not None and starts.size > most:
        starts = starts[np.linspace(0, starts.size - 1, most).round().astype(np.int64)]
    return starts


def projection(
    theta_rad: Array,
    starts: NDArray[np.int64],
    length: int,
    orders: tuple[float, ...],
    cycles: float = 3.0,
    margin: float = 16.0,
) -> Projection:
    """Test functions over one clock: smooth windows, plain and times harmonics of the shaft angle.

    Parameters
    ----------
    theta_rad
        Unwrapped shaft angle [n, rad].
    starts
        First samples of the windows [W].
    length
        Samples a window.
    orders
        Orders [1/turn]; one that counts in no window is left out.
    cycles
        Least cycles of an order in a window where it counts [1].
    margin
        Least samples a cycle there [1].

    Returns
    -------
    Projection
        Of each order a cosine and a sine, after the plain window.

    """
    window = bump(length)
    tags: list[float] = [0]
    functions = [np.broadcast_to(window, (starts.size, length))]
    angle = sliding_window_view(theta_rad, length)[starts] if starts.size else np.empty((0, length))
    turns = np.abs(angle[:, -1] - angle[:, 0]) / (2 * np.pi)
    valid = [np.ones(starts.size, dtype=bool)]
    for order in orders:
        held = turns * order
        enough = (held >= cycles) & (held * margin <= length)
        if not enough.any():
            continue
        for wave in (np.cos(order * angle), np.sin(order * angle)):
            tags.append(order)
            functions.append(window * wave)
            valid.append(enough)
    stacked = np.stack(functions, axis=1)
    norm = np.sqrt((stacked**2).sum(axis=2, keepdims=True))
    # the sine of an angle that stays at zero
    stacked = np.divide(stacked, norm, out=np.zeros(stacked.shape), where=norm > 0.0)
    return Projection(starts, stacked, np.array(tags), np.stack(valid, axis=1))
