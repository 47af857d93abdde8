"""What is assumed of a quantity that nobody logged, by estimates and by models."""

from __future__ import annotations

UNLOGGED_U_K = 20.0
"""Standard uncertainty of a temperature that nobody logged [K]."""
UNLOGGED_D_SHARE = 0.02
"""Reluctance torque of a d current that nobody logged, over the magnet's torque [1]."""
