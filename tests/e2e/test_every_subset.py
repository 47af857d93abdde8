"""Every subset of tests, and of columns of one capture: nothing breaks, every interval holds."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest
from scipy.special import bdtrc

import pipeline
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate

P0 = Path(__file__).parents[3] / "shared" / "data" / "rig" / "P0"
needs_p0 = pytest.mark.skipif(not P0.is_dir(), reason="../shared/data/rig/P0 is not here")
LEVEL, SURE, FARTHEST, SAME = 0.05, 1e-3, 4.0, 0.25
"""Share of intervals that may miss; chance at which too many do; standard uncertainties beyond
which not even one may: by chance once in 16,000; those within which two estimates are one draw."""


def true_constants(said: Mapping[str, float]) -> dict[str, float]:
    """What is known of a motor, and what follows of it, by constant."""
    ke = said["pole_pairs"] * said["psi_pm_wb"]
    r, j = said["r_phase_ohm"], said["j_rotor_kgm2"]
    return {k: v for k, v in said.items() if v is not None} | {
        "r_ll_ohm": 2.0 * r,
        "ld_rated_h": said["ld_h"],
        "lq_rated_h": said["lq_h"],
        "saliency_ratio": said["lq_h"] / said["ld_h"],
        "ke_phase_peak_v_s_rad": ke,
        "ke_ll_rms_v_s_rad": math.sqrt(1.5) * ke,
        "kt_from_ke_nm_a": 1.5 * ke,
        "kt_rms_nm_a": 1.5 * math.sqrt(2.0) * ke,
        "motor_constant_nm_sqrt_w": 1.5 * ke / math.sqrt(1.5 * r),
        "coast_coulomb_rad_s2": said["torque_coulomb_nm"] / j,
        "coast_viscous_1_s": said["b_visc_nm_s_rad"] / j,
        "tau_mech_s": j * r / (1.5 * ke**2),
        "kt_reluctance_nm_a2": 1.5 * said["pole_pairs"] * (said["ld_h"] - said["lq_h"]),
    }


def subsets(names: Iterable[str]) -> Iterator[frozenset[str]]:
    every = sorted(names)
    for size in range(1, len(every) + 1):
        yield from map(frozenset, combinations(every, size))


def of_kinds(whole: Campaign) -> Iterator[Campaign]:
    for kinds in subsets({one.meta.test for one in whole.captures}):
        yield replace(whole, captures=whole.of(*kinds))


def of_columns(whole: Campaign, path: str) -> Iterator[Campaign]:
    (one,) = (c for c in whole.captures if c.path.startswith(path))
    names = {name for table in one.tables for name in table.columns} - {"t_s"}
    for kept in subsets(names):
        tables = (t.select([n for n in t.columns if n in kept | {"t_s"}]) for t in one.tables)
        cut = replace(one, tables=tuple(t for t in tables if t.width > 1))
        yield replace(whole, captures=(cut,))


def fitted(recordings: pipeline.Recordings, parts: Iterable[Campaign]) -> Iterator[Estimate]:
    """What `fit` says of each part; none may break, and every refusal has words."""
    for part in parts:
        fits = pipeline.fit(replace(recordings, campaigns={part.motor_id: part}))
        assert fits[part.motor_id].failures == ()
        for one in fits[part.motor_id].constants.estimates:
            if not one.known:
                assert len(one.note) > 15, (one.name, one.note)
            yield one


def _alike(one: Estimate, other: Estimate) -> bool:
    near = SAME * min(one.u, other.u)
    return abs(one.number - other.number) <= near and abs(one.u - other.u) <= near


def judged(found: Iterable[Estimate], true: Mapping[str, float], least: int) -> None:
    """No constant misses more often than chance lets a sound one, and none by far.

    Subsets that leave an estimate about as it is are one draw, which is counted once. `least`
    constants are known by some subset, so that silence is no pass.
    """
    drawn: dict[tuple[str, str], list[Estimate]] = {}
    for one in found:
        same = drawn.setdefault((one.name, one.method), [])
        if one.known and one.name in true and not any(_alike(one, other) for other in same):
            same.append(one)
    tried, missed, far = Counter[str](), Counter[str](), []
    for one in (one for same in drawn.values() for one in same):
        low, high = one.interval()
        tried[one.name] += 1
        missed[one.name] += not low <= true[one.name] <= high
        if abs(one.number - true[one.name]) > FARTHEST * one.u + 1e-12:
            far.append((one.name, one.method, one.number, one.u, one.note))
    assert far == []
    often = {
        name: (missed[name], n)
        for name, n in tried.items()
        if missed[name] and bdtrc(missed[name] - 1, n, LEVEL) < SURE
    }
    assert often == {}
    assert len(tried) >= least, sorted(tried)


@pytest.fixture(scope="module")
def rig() -> tuple[pipeline.Recordings, Campaign, dict[str, float]]:
    recordings = pipeline.read(P0)
    (whole,) = recordings.campaigns.values()
    said = json.loads((P0 / "truth.json").read_bytes())["constants"]
    return recordings, whole, true_constants(said)


@pytest.mark.slow
@needs_p0
def test_every_set_of_tests_of_the_rig(rig):
    recordings, whole, true = rig
    judged(fitted(recordings, of_kinds(whole)), true, 23)


@pytest.mark.slow
@needs_p0
@pytest.mark.parametrize(
    ("path", "least"),
    [
        ("drive_0", 5),
        ("torque_map_0", 5),
        ("heat_run", 1),
        ("open_circuit_1", 5),
        ("cogging_cw", 0),
    ],
)
def test_every_set_of_columns_of_the_rig(rig, path, least):
    recordings, whole, true = rig
    judged(fitted(recordings, of_columns(whole, path)), true, least)


@pytest.mark.slow
def test_every_test_alone_and_every_pair_of_columns():
    recordings = pipeline.simulate("gimbal-5208", exact=True)
    (whole,) = recordings.campaigns.values()
    (said,) = recordings.truth.values()
    true = true_constants(said["constants"])
    alone = [
        replace(whole, captures=whole.of(test)) for test in {c.meta.test for c in whole.captures}
    ]
    pairs = [p for p in of_columns(whole, "drive_1") if len(p.captures[0].columns) <= 3]
    judged(fitted(recordings, alone + pairs), true, 20)
