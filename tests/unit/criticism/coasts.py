"""Coasts of a shaft by an equation of their own, in no model of the project."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp


@dataclass(frozen=True, slots=True)
class Shaft:
    """Decelerations of a shaft, from a top speed to an end, in rows of an angle.

    Dry friction [rad/s²] is `excess` higher at rest, which falls over a speed; viscous friction is
    in 1/s, windage in 1/rad.
    """

    dry: float
    excess: float
    slow_rad_s: float
    viscous: float
    windage: float = 0.0
    top_rad_s: float = 96.0
    end_rad_s: float = 2.9
    row_s: float = 5e-3

    def slowed(self, omega: float) -> float:
        """Deceleration [rad/s²] at a speed above zero."""
        bump = self.excess * np.exp(-((omega / self.slow_rad_s) ** 2))
        return float(self.dry + bump + self.viscous * omega + self.windage * omega**2)

    def coast(self, sense: float) -> dict[str, np.ndarray]:
        """Times [s] and angles [rad], known to 60 µrad, of a coast."""

        def ended(_: float, state: np.ndarray) -> float:
            return state[1] - self.end_rad_s

        ended.terminal = True  # type: ignore[attr-defined]
        solved = solve_ivp(
            lambda _, state: [state[1], -self.slowed(state[1])],
            (0.0, 60.0),
            (0.0, self.top_rad_s),
            events=ended,
            dense_output=True,
            rtol=1e-10,
        )
        t_s = np.arange(0.0, solved.t[-1], self.row_s)
        noise = np.random.default_rng(4).normal(0.0, 6e-5, t_s.size)
        return {"t_s": t_s, "theta_mech_rad": sense * solved.sol(t_s)[0] + noise}
