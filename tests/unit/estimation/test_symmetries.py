"""What every estimator must say of a motor in a mirror, and of captures that are there twice."""

from __future__ import annotations

import math
from dataclasses import replace

import polars as pl
import pytest

from pipeline.records.capture import Campaign, Capture
from pipeline.records.estimate import Estimate
from tests.unit.estimation.test_scales import FEW, PLANS, by_source, campaign, fitted, plain_fit

# In a mirror a motor turns the other way: phases b and c are exchanged, d stays and q turns round.
EXCHANGED = {
    "vab_v": ("vca_v", -1.0), "vbc_v": ("vbc_v", -1.0), "vca_v": ("vab_v", -1.0),
    "va_v": ("va_v", 1.0), "vb_v": ("vc_v", 1.0), "vc_v": ("vb_v", 1.0),
    "ia_a": ("ia_a", 1.0), "ib_a": ("ic_a", 1.0), "ic_a": ("ib_a", 1.0),
    "lab_h": ("lca_h", 1.0), "lbc_h": ("lbc_h", 1.0), "lca_h": ("lab_h", 1.0),
}  # fmt: skip
TURNED = (
    "theta_mech_rad", "theta_elec_rad", "theta_elec_deg", "omega_mech_rad_s", "iq_a", "vq_v",
    "torque_shaft_nm", "psi_q_wb",
)  # fmt: skip
PAIRS = {"ab": "ca", "bc": "bc", "ca": "ab"}
NAMES = {"r_b_ohm": "r_c_ohm", "r_ab_ohm": "r_ca_ohm"} | {
    "r_c_ohm": "r_b_ohm", "r_ca_ohm": "r_ab_ohm"
}  # fmt: skip
ODD = {"angle_offset_elec_rad", "lcr_angle_offset_deg", "holding_offset_a"}


def mirrored(capture: Capture) -> Capture:
    """The capture as a mirror shows it."""

    def table(one: pl.DataFrame) -> pl.DataFrame:
        turned = one.with_columns(
            **{n: -pl.col(n) for n in TURNED if n in one.columns},
        )
        moved = {n: EXCHANGED[n] for n in one.columns if n in EXCHANGED}
        kept = [n for n in turned.columns if n not in moved]
        return turned.select(
            *kept, *(pl.col(n).mul(sign).alias(other) for n, (other, sign) in moved.items())
        )

    angle, pair = capture.meta.theta_elec_deg, capture.meta.pair
    meta = replace(
        capture.meta,
        theta_elec_deg=None if angle is None else -angle,
        pair=None if pair is None else PAIRS[pair],
    )
    return replace(capture, meta=meta, tables=tuple(table(t) for t in capture.tables))


def by_kind(estimate: Estimate) -> dict[str, float]:
    """The size of what each kind of source makes, whose names end in angles and phases."""
    total: dict[str, float] = {}
    for source, u in by_source(estimate).items():
        kind = source.split(":")[0]
        total[kind] = math.hypot(total.get(kind, 0.0), u)
    return total


def alike(one: Estimate, other: Estimate, sign: float = 1.0) -> None:
    """Equal but for rounding and the last steps of a search: number, budget, freedom, captures."""
    assert one.status == other.status, (one.name, one.note, other.note)
    if not one.known:
        return
    # The sectors that are held out are no mirror images of each other.
    room = 1.0 if one.name == "holding_residual_a" else 1e-3
    size = room * one.u + 1e-9 * abs(one.number)
    assert other.number == pytest.approx(sign * one.number, rel=1e-9, abs=size), one.name
    if room == 1.0:
        return
    expected, found = by_kind(one), by_kind(other)
    for source in expected.keys() | found.keys():
        part = pytest.approx(expected.get(source, 0.0), rel=2e-3, abs=1e-3 * one.u)
        assert found.get(source, 0.0) == part, (one.name, source)
    assert other.dof == pytest.approx(one.dof, rel=1e-3), one.name
    assert sorted(other.captures) == sorted(one.captures)
    for name, value in one.at.items():
        if isinstance(value, float):
            assert abs(other.at[name]) == pytest.approx(abs(value), rel=1e-6), name


@pytest.mark.parametrize("name", FEW)
def test_a_motor_in_a_mirror_has_the_same_constants(name: str) -> None:
    made = campaign(name)
    shown = replace(made, captures=tuple(mirrored(c) for c in made.captures))
    plain, other = plain_fit(name), fitted(name, shown)
    seen = {e.name: e for e in other.estimates}
    for one in plain.estimates:
        sign = -1.0 if one.name in ODD else 1.0
        alike(one, seen[NAMES.get(one.name, one.name)], sign)


def twice(made: Campaign) -> Campaign:
    """Each capture and a copy of it, as if the day had repeated itself."""
    again = tuple(
        replace(c, path=f"again_{c.path}", sha256=f"{k:064d}") for k, c in enumerate(made.captures)
    )
    return replace(made, captures=(*made.captures, *again))


# Of u_a, that a repetition leaves; else 1/sqrt(2), and what few turns or points do not know of it.
SHARE = {
    # The surest run alone counts.
    "heat_run": (0.99, 1.01),
    "thermal": (0.99, 1.01),
    # One turn a sense has a freedom of one, two have three: 1/sqrt(3).
    "holding_current": (0.57, 0.8),
    # Regimes disagree in what is no noise.
    "inertia": (0.7, 1.0),
}


@pytest.mark.parametrize("name", PLANS)
def test_twice_the_captures_halve_the_variance_of_chance_and_nothing_else(name: str) -> None:
    made = campaign(name)
    plain = plain_fit(name)
    other = {e.name: e for e in fitted(name, twice(made)).estimates}
    for one in plain.estimates:
        two = other[one.name]
        if not one.known:
            continue
        assert two.known, (one.name, two.note)
        assert two.number == pytest.approx(one.number, abs=0.05 * one.u + 1e-6 * abs(one.number))
        low, high = SHARE.get(name, (0.6, 0.8))
        if one.u_a > 1e-9 * abs(one.number):
            assert low < two.u_a / one.u_a < high, one.name
        chance = {p.source for p in one.budget if p.kind == "A"}
        for source, u in by_source(one).items():
            # What an assumption weighs goes with the noise of the rows that it is held against.
            if source not in chance and not source.startswith("assumed:temp_coeff"):
                part = by_source(two).get(source, 0.0)
                assert part == pytest.approx(u, rel=0.05, abs=0.02 * one.u), (one.name, source)
