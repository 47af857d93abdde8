"""What the iron's loss takes from the winding: a current in parallel with the magnetising one."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.operating import Array, Complex, Operating
from pipeline.criticism.parameter import choice

PARALLEL = choice(
    "parallel",
    (1.0, 0.0, 2.0),
    "1: a winding with current feeds the loss, 0: the shaft alone does, 2: as 1, and the iron's "
    "own current flows beside an open winding as well",
)
"""Parameter of an iron loss by which `loss_current` counts."""


def loss_current(x: Operating, drag_nm: Array, parallel: float) -> Complex:
    """Current [n, A] that feeds the iron's loss, by the drag [n, N·m] that the loss makes.

    Parameters
    ----------
    x
        True state, with its flux linkage [n].
    drag_nm
        Drag that the loss makes [n].
    parallel
        The value of `PARALLEL`.

    Returns
    -------
    array [n], complex
        In A; zero where no inverter feeds the machine, but for 2.

    Notes
    -----
    The loss is fed at the terminals by the induced voltage e = j ω_e ψ, so its power is
    T ω = 1.5 Re(e i*) and i = j ψ T / (1.5 p |ψ|²). Of a resistance R in parallel, i = j ω_e ψ / R.
    What is left of the terminal's current magnetises: ψ = ψ(i_s − i). An open winding has no
    current to feed a loss, so there the shaft alone does. Eddy currents are a shorted secondary
    all the same: the flux that they make is then v_d = ω_e² L_q ψ / R of the open terminals.

    References
    ----------
    Morimoto, Tong, Takeda & Hirasa, IEEE Trans. Ind. Electron. 41 (1994), loss minimization
    control of permanent magnet synchronous motor drives. doi:10.1109/41.293899

    """
    psi = x.flux_wb
    if parallel == 0.0 or (parallel < 2.0 and not x.inverter):
        return np.zeros_like(psi)
    return 1j * psi * drag_nm / (1.5 * x.machine.pole_pairs * abs(psi) ** 2)
