"""Current steps on a simulated scope: its converter, its gains, its edges."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulator.bench import campaign, record
from pipeline.simulator.design import EXACT, Bench, Instruments, Scope
from tests.simulated import design

MOTOR = design("gimbal-5208")


def step(scope: Scope, instruments: Instruments | None = EXACT, **how):
    bench = Bench(scope=scope, instruments=instruments)
    return record("current_step", MOTOR, bench, np.random.default_rng(4), level=0.5, **how)


@pytest.mark.parametrize("bits", [8, 11, 14])
def test_readings_lie_on_the_steps_of_a_range_that_is_not_clipped(bits: int) -> None:
    recording = step(Scope(bits=bits))
    for name in ("vab_v", "ia_a"):
        values = recording.tables[0][name]
        spacing = np.diff(np.unique(values))
        least = spacing.min()
        assert np.round(values / least) * least == pytest.approx(values, abs=1e-9 * least)
        codes = np.abs(values) / least
        assert 0.35 * 2.0 ** (bits - 1) < codes.max() < 2.0 ** (bits - 1)


def test_clamp_and_probe_have_gains_of_their_own() -> None:
    quiet = Scope(bits=24, noise_steps=0.0, u_rel_clamp=0.03, u_rel_probe=0.02)
    plain = step(quiet).tables[0]
    real = Instruments(clamp=1.03, probe=0.98, clamp_offset=0.01, current=2.0, voltage=2.0)
    other = step(quiet, real)
    settled = np.argmax(plain["ia_a"])
    assert other.tables[0]["vab_v"][settled] == pytest.approx(0.98 * plain["vab_v"][settled])
    amps = other.tables[0]["ia_a"]
    assert amps[settled] - amps[0] == pytest.approx(1.03 * plain["ia_a"][settled], rel=1e-4)
    assert amps[0] > 0.0
    assert (other.meta["u_rel_current"], other.meta["u_rel_voltage"]) == ("0.03", "0.02")


def test_gains_of_a_scope_are_drawn_once_a_station_and_the_rest_stays() -> None:
    plain = Bench().drawn(np.random.default_rng(1))
    scoped = Bench(scope=Scope()).drawn(np.random.default_rng(1))
    assert (scoped.current, scoped.voltage) == (plain.current, plain.voltage)
    assert 0.0 < abs(scoped.clamp - 1.0) < 0.01
    assert 0.0 < abs(scoped.probe - 1.0) < 0.005
    two = campaign(MOTOR, Bench(scope=Scope()), 3, (("a", "current_step", {}),))
    assert two[0].meta["u_rel_current"] == "0.002"


def test_edges_lie_anywhere_between_samples() -> None:
    """The first sample after an edge has a current by how early the edge was."""
    quiet = Scope(bits=24, noise_steps=0.0)
    first = []
    for seed in range(40):
        bench = Bench(scope=quiet, instruments=EXACT)
        rng = np.random.default_rng(seed)
        table = record("current_step", MOTOR, bench, rng, random_edges=True).tables[0]
        edge = int(np.argmax(table["vab_v"] > 0.5 * table["vab_v"].max()))
        rise = table["ia_a"][edge : edge + 2]
        first.append(rise[0] / (rise[1] - rise[0]))
    assert 0.0 < min(first) < 0.15
    assert 0.85 < max(first) < 1.05
    assert np.mean(first) == pytest.approx(0.5, abs=0.15)
