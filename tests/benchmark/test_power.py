"""a* by simulation: the test that knows the answer finds it in nine of ten noisy campaigns."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmark.bench import MOTORS, recorded, station
from tests.benchmark.innovation import base_of, innovations, nuisances, priors
from tests.benchmark.sensitivity import changed, noncentrality_of, typical

KEEP = ("resistance_ab", "torque_map_1", "cogging_cw", "cogging_ccw")
LIMIT = 2.5758
REPLICATES = 120


class Programme:
    """A few captures of one motor, the same seed noise-free and noisy."""

    def __init__(self, motor: str, seed: int) -> None:
        self.place, self.seed = station(motor), seed
        self.base = base_of(self.place.motor)
        self.plain = self.quiet(self.place.motor)
        columns = [nuisances(r, self.place.motor, self.place.bench) for r in self._quiet()]
        self.fixed = [np.stack(list(c.values()), axis=1) for c in columns]
        known = priors(self.place.bench)
        self.prior = np.array([1.0 if name in known else 0.0 for name in columns[0]])

    def _quiet(self):
        place = self.place
        return recorded(place.motor, place.quiet, place.plan, self.seed, KEEP)

    def _seen(self, made):
        return [innovations(r, self.place.motor, self.place.bench, self.base) for r in made]

    def quiet(self, motor):
        place = self.place
        return self._seen(recorded(motor, place.quiet, place.plan, self.seed, KEEP))

    def noisy(self, motor):
        place = self.place
        made = self._seen(recorded(motor, place.bench, place.plan, self.seed, KEEP))
        return [one - two for one, two in zip(made, self.plain, strict=True)]

    def column(self, effect: str, size: float):
        made = self.quiet(changed(self.place.motor, effect, size))
        return [one - two for one, two in zip(made, self.plain, strict=True)]

    def statistic(self, column, seen) -> float:
        """(gᵀMe)/√(gᵀMg), M the inverse covariance of noise and nuisances."""
        g, e, n = (np.concatenate(x) for x in (column, seen, self.fixed))
        solved = np.linalg.lstsq(n.T @ n + np.diag(self.prior), n.T @ g, rcond=1e-12)[0]
        weighed = g - n @ solved
        return float(weighed @ e) / float(np.sqrt(weighed @ g))


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["torque_offset", "dead_time"])
def test_power_is_nine_in_ten_at_a_star(effect: str) -> None:
    """Noise, resolution, closed loop and the station's gains are the simulator's own."""
    motor = MOTORS[1]
    place = station(motor)
    first = Programme(motor, 1)
    whole = typical(effect, place.motor)
    seen = noncentrality_of(first.column(effect, whole), first.fixed, first.prior)
    star = whole * np.sqrt(14.8794 / seen)
    found, false = 0, 0
    for seed in range(100, 100 + REPLICATES):
        bench = Programme(motor, seed)
        column = bench.column(effect, star)
        found += (
            abs(bench.statistic(column, bench.noisy(changed(place.motor, effect, star)))) > LIMIT
        )
        false += abs(bench.statistic(column, bench.noisy(place.motor))) > LIMIT
    assert 0.81 < found / REPLICATES < 0.97
    assert false <= 5
