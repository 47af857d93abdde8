"""Every number of the gate of resistances and link voltages from both sides."""

from __future__ import annotations

import numpy as np
import pytest

from tests.unit.contracts.test_gate_limits import capture, said


@pytest.mark.parametrize(("volts", "expected"), [(1.9e-3, "warned"), (2.1e-3, ""), (990.0, ""),
                                                 (1010.0, "warned")])  # fmt: skip
def test_resistances_that_windings_have(volts: float, expected: str) -> None:
    for pair, line in (("ab", "ia_a"), ("bc", "ic_a")):
        columns = {f"v{pair}_v": np.full(99, volts), line: np.full(99, -1.0)}
        made = capture("resistance", meta={"pair": pair}, **columns)
        assert said("plausible_terminals", made) == expected


@pytest.mark.parametrize(("volts", "expected"), [(26.3, ""), (26.5, "warned")])
def test_a_voltage_above_its_link(volts: float, expected: str) -> None:
    made = capture("current_step", vab_v=np.full(99, -volts), ia_a=1.0, meta={"vdc_v": 24.0})
    assert said("plausible_terminals", made) == expected


def test_a_line_without_current_is_passed_over() -> None:
    """A dead first line: the pair's other one tells the resistance."""
    for volts, expected in ((1.0, ""), (1e-3, "warned")):
        made = capture("resistance", vab_v=np.full(99, volts), ia_a=0.0, ib_a=-1.0)
        assert said("plausible_terminals", made) == expected
