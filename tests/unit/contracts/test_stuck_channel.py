"""Every number of the gate of stuck channels from both sides, a few per cent away."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.gates import (
    saturation,
    stuck_channel,
)
from tests.unit.contracts.signals import OPTIONS
from tests.unit.contracts.test_gate_limits import capture, said


@pytest.mark.parametrize(("fall", "frozen"), [(0.19, False), (0.21, True)])
def test_zeros_count_where_the_signal_drops_to_them_from_afar(fall: float, frozen: bool) -> None:
    """Range ±5: a fifth is 2."""
    rng = np.random.default_rng(1)
    values = rng.uniform(-4.9, 4.9, 4000)
    values[:2] = -5.0, 5.0
    values[999] = 10.0 * fall
    values[1000:1200] = 0.0
    rows = stuck_channel.frozen_rows(values, OPTIONS["stuck_channel"])
    assert np.count_nonzero(rows) == (200 if frozen else 0)
    start = np.concatenate([np.zeros(200), values[:800], values[1200:-1], [4.9]])
    assert not stuck_channel.frozen_rows(start, OPTIONS["stuck_channel"]).any()


@pytest.mark.parametrize(("share", "expected"), [(0.19, "warned"), (0.21, "refused")])
def test_a_fifth_of_the_rows_may_stand_still(share: float, expected: str) -> None:
    rng = np.random.default_rng(2)
    values = rng.standard_normal(5000)
    values[1000 : 1000 + round(share * 5000)] = 0.5
    made = capture("drive", iq_a=values, vq_v=rng.standard_normal(5000))
    assert said("stuck_channel", made) == expected
    dead = capture("drive", iq_a=np.ones(500), vq_v=values[:500])
    assert said("stuck_channel", dead) == "refused"


@pytest.mark.parametrize(
    ("kind", "expected"), [("commanded", ""), ("measured", "refused"), (None, "refused")]
)
def test_a_step_of_the_voltage_is_one_command_in_every_row(kind, expected) -> None:
    """A drive in open loop that began before its log; a sensor of a voltage would show noise."""
    speed = 50.0 * -np.expm1(-np.arange(500) / 80.0)
    meta = {"voltage_kind": kind}
    made = capture("drive", meta=meta, vq_v=np.full(500, 1.9), omega_mech_rad_s=speed)
    assert said("stuck_channel", made) == expected


def shorted(motoring: float = 0.0) -> dict[str, np.ndarray]:
    """Columns of a winding with shorted terminals on a shaft that slows down from 400 rad/s.

    Steady state of R 0.2 ohm, L 1 mH, psi 0.02 Wb, 4 pole pairs; `motoring` [1] of its q current
    drives the shaft.

    """
    omega = np.linspace(400.0, 20.0, 2000)
    electrical = 4.0 * omega
    iq = -electrical * 0.02 * 0.2 / (0.2**2 + (1e-3 * electrical) ** 2)
    noise = np.random.default_rng(3).standard_normal((2, omega.size))
    turned = np.where(np.arange(omega.size) < motoring * omega.size, -1.0, 1.0)
    return {
        "id_a": electrical * 1e-3 * iq / 0.2 + 0.01 * noise[0],
        "iq_a": turned * iq + 0.01 * noise[1],
        "omega_mech_rad_s": omega,
        "vd_v": np.zeros(omega.size),
        "vq_v": np.zeros(omega.size),
    }


def test_no_voltage_in_any_row_is_a_short_circuit_where_the_current_only_brakes() -> None:
    """A voltage column that nobody filled stands beside currents that motor as well."""
    log = shorted()
    assert said("stuck_channel", capture("drive", **log)) == ""
    backwards = {**log, "iq_a": -log["iq_a"], "omega_mech_rad_s": -log["omega_mech_rad_s"]}
    assert said("stuck_channel", capture("drive", **backwards)) == ""
    assert said("stuck_channel", capture("drive", **shorted(motoring=0.5))) == "refused"
    weakened = {**log, "id_a": -log["id_a"]}
    assert said("stuck_channel", capture("drive", **weakened)) == "refused"
    assert (
        said("stuck_channel", capture("drive", **{**log, "vq_v": log["vq_v"] + 1.0})) == "refused"
    )
    del log["id_a"]
    assert said("stuck_channel", capture("drive", **log)) == "refused"


@pytest.mark.parametrize(("repeats", "settles"), [(24, False), (25, True)])
def test_a_signal_that_repeats_beside_a_run_settles(repeats: int, settles: bool) -> None:
    """Of the 49 steps of the 50 rows before it, more than half repeat."""
    rng = np.random.default_rng(5)
    before = np.cumsum(np.concatenate([[1.0], np.where(np.arange(49) < repeats, 0.0, 0.01)]))
    values = np.concatenate(
        [rng.standard_normal(60), before, np.full(30, 7.0), rng.standard_normal(60)]
    )
    assert stuck_channel._settles(values, 110, 30) is settles
    turned = values[::-1]
    assert stuck_channel._settles(turned, 60, 30) is settles


@pytest.mark.parametrize("gate", ["stuck_channel", "saturation"])
def test_a_run_is_by_chance_at_one_in_a_million(gate: str) -> None:
    """Half of the samples repeat: a run just shorter than 1 + log(1e-6/n)/log(p) is chance."""
    from pipeline.contracts.waveform import longest_likely_run

    found = {}
    for repeats in range(340, 410):
        rng = np.random.default_rng(repeats)
        values = rng.uniform(-1.0, 1.0, 1000)
        pairs = rng.permutation(np.r_[1:440:2, 601:1000:2])[:repeats]  # none beside the run
        values[pairs] = values[pairs - 1]
        for length in range(22, 30):
            one = values.copy()
            one[500 : 500 + length] = 0.3 if gate == "stuck_channel" else 1.5
            inside = one if gate == "stuck_channel" else one[one != 1.5]
            inside = inside if gate == "stuck_channel" else inside[inside != inside.min()]
            found[repeats, length] = (longest_likely_run(inside, 1e-6) - length, one)
    near = {k: v for k, v in found.items() if abs(v[0]) < 0.12}
    assert {v[0] > 0.0 for v in near.values()} == {True, False}
    rows_of_ = {"stuck_channel": stuck_channel.frozen_rows, "saturation": saturation.clipped_rows}
    for over, values in near.values():
        assert bool(rows_of_[gate](values, OPTIONS[gate]).any()) is (over < 0.0)


def test_one_value_is_no_dead_channel() -> None:
    values = np.full(500, np.nan)
    values[3] = 2.0
    rng = np.random.default_rng(0)
    one = capture("drive", iq_a=values, vq_v=rng.standard_normal(500))
    assert said("stuck_channel", one) == ""
    values[9] = 2.0
    two = capture("drive", iq_a=values, vq_v=rng.standard_normal(500))
    assert said("stuck_channel", two) == "refused"
