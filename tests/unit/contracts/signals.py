"""Signals of a motor for captures that are made for one number of a gate."""

from __future__ import annotations

import numpy as np

from tests.unit.contracts.test_gate_limits import GATES, TURN

VOLTS = ("vab_v", "vbc_v", "vca_v")
AMPS = ("ia_a", "ib_a", "ic_a")


def turned(names, phase, size=10.0):
    """Three signals of a vector that turns forward with the phase [n]."""
    return {n: size * np.cos(phase - k * TURN / 3.0) for k, n in enumerate(names)}


OPTIONS = {name: GATES[name].options for name in GATES}
