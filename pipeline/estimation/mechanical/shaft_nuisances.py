"""Names of what may turn a shaft beside the torque of its current: columns of its rows."""

from __future__ import annotations

OFFSET, COAST_LOAD = "offset", "coast load"
"""A constant torque that the drives show beyond their current; and the same in the coasts."""
BY_SENSE = "viscous drag by sense"
"""What viscous drag has more in one sense than in the other: in coasts of one sense it is drag."""
CURRENT_LAG, JUMPS = "current lag", "current jumps"
"""A current that is late, and one that jumps between its samples."""
CURVATURE = "curvature of the current"
"""Second derivative of the q current: what a lag leaves of a late current, to second order."""
LOAD_BETWEEN = "load between its samples"
"""What the current does between the samples of a load that is slower than it."""
LATE_LOAD = ("late load", "curvature of the load")
"""What a load [N·m] that is late by half of its row lacks, to first and to second order."""
LATE_CURRENT = ("late current", "late bend of the current")
"""What a current [A] that is late by half of its row lacks, to first and to second order."""
TIMING = frozenset({CURRENT_LAG, JUMPS})
"""What is not known of a current's instant."""
SAMPLED = "sampled current"
"""A current that is sampled off the middle of its pulse: by a dead time pulses are late, and the
back-EMF moves the current on in proportion to speed."""
NUISANCES = (
    OFFSET, "load friction", "load lag", LOAD_BETWEEN, *sorted(TIMING), "d current",
    "d current cos", "d current sin", "q current cubed", "d squared q current", "d q current cubed",
    "eccentric cos", "eccentric sin", "unbalance cos", "unbalance sin",
)  # fmt: skip
"""What may join any fit."""
OF_CURRENT = ("torque", "load", "current", "d current", "q current", "d q current", "d squared")
"""How the names of columns begin that the current makes."""
RELUCTANCE = "d q current"
"""What reluctance adds to the torque, where nothing shows how much."""


def is_of_current(name: str) -> bool:
    """Whether the current makes a column of the rows, be it a wave over the angle.

    Parameters
    ----------
    name
        Of the column.

    """
    return name.startswith(OF_CURRENT) or "q current" in name
