"""Whole comparisons of simulated production: what passes, what fails, what is not decided."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.io.storage.publish import canonical_json
from pipeline.lots.regression import compare_lots
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.estimate import Order
from pipeline.records.limits import Amount, ConstantLimits
from pipeline.records.lot_regression import LotRegression
from pipeline.records.plain_form import record_of
from tests.unit.lots import production as line

THREE = ("r_phase_ohm", "psi_pm_wb", "j_rotor_kgm2")
MARGIN = (Amount(0.02, "nominal"),)


def compare(base, candidate, limits=None, repeats=(), golden=()) -> LotRegression:
    samples = line.samples(base, candidate, repeats, golden)
    return compare_lots(samples, limits or line.limits(THREE), CONSTANTS)


def base_lots(rng: np.random.Generator, count: int = 10, **options: object):
    return [
        line.lot(rng, f"L{k:02d}", names=THREE, motors=12, **options)  # type: ignore[arg-type]
        for k in range(count)
    ]


def with_margin(**options: object):
    limits = line.limits(THREE)
    constants = tuple(ConstantLimits(name, margins=MARGIN, **options) for name in THREE)  # type: ignore[arg-type]
    return replace(limits, constants=constants)


def verdicts(found: LotRegression) -> dict[str, str]:
    return {one.name: one.verdict for one in found.constants}


def test_a_healthy_lot_passes_and_a_shifted_one_names_its_constant() -> None:
    rng = np.random.default_rng(1)
    base = base_lots(rng)
    healthy = compare(base, line.lot(rng, "N", names=THREE, motors=12))
    assert healthy.verdict == "pass"
    assert healthy.history == "sufficient"
    shifted = compare(
        base, line.lot(rng, "N", names=THREE, motors=12, shift=3.0, shifted="psi_pm_wb")
    )
    assert shifted.verdict == "fail"
    assert verdicts(shifted)["psi_pm_wb"] == "fail"
    assert verdicts(shifted)["r_phase_ohm"] == "pass"
    assert "psi_pm_wb" in shifted.headline


@pytest.mark.slow
def test_family_false_alarm_of_whole_comparisons() -> None:
    """400 healthy lots, 12 constants, 20 baseline lots, the whole way: at most 5 %, band 8 %."""
    rng = np.random.default_rng(21)
    alarms = 0
    for _ in range(400):
        base = [line.lot(rng, f"L{k}", motors=8) for k in range(20)]
        found = compare(base, line.lot(rng, "N", motors=8), line.limits())
        alarms += found.verdict == "fail"
    assert alarms / 400 <= 0.08


def test_too_few_lots_never_pass_on_absence_of_evidence() -> None:
    """Seven lots and no margin: INSUFFICIENT_HISTORY, however alike they look."""
    rng = np.random.default_rng(2)
    found = compare(base_lots(rng, 7), line.lot(rng, "N", names=THREE, motors=12))
    assert found.verdict == "INSUFFICIENT_HISTORY"
    assert found.history == "INSUFFICIENT_HISTORY"
    assert {one.test.status for one in found.constants} == {"INSUFFICIENT_HISTORY"}
    assert all(one.test.p_value is None for one in found.constants)


def test_two_lots_alone_pass_where_sameness_is_shown() -> None:
    """One baseline lot: equivalence within 2 % decides; the lot-level test still says so."""
    rng = np.random.default_rng(3)
    base = base_lots(rng, 1)
    found = compare(base, line.lot(rng, "N", names=THREE, motors=12), with_margin())
    assert found.verdict == "pass"
    assert found.history == "INSUFFICIENT_HISTORY"
    assert all(one.equivalence.status == "equivalent" for one in found.constants)


def test_two_lots_alone_fail_on_a_clear_shift() -> None:
    """4 sd (4 %) against a margin of 2 %: beyond it and beyond the chance of drawing motors."""
    rng = np.random.default_rng(4)
    moved = line.lot(rng, "N", names=THREE, motors=12, shift=-4.0, shifted="psi_pm_wb")
    found = compare(base_lots(rng, 1), moved, with_margin())
    assert found.verdict == "fail"
    assert verdicts(found) == {"r_phase_ohm": "pass", "psi_pm_wb": "fail", "j_rotor_kgm2": "pass"}


def test_three_motors_show_nothing() -> None:
    """Too few motors for the margin: neither the same nor different, and no pass."""
    rng = np.random.default_rng(5)
    limits = with_margin()
    tight = replace(
        limits,
        constants=tuple(
            replace(one, margins=(Amount(0.005, "nominal"),)) for one in limits.constants
        ),
    )
    base = [line.lot(rng, "L", names=THREE, motors=3)]
    found = compare(base, line.lot(rng, "N", names=THREE, motors=3), tight)
    assert found.verdict == "INSUFFICIENT_HISTORY"


def test_one_unreferenced_station_is_never_a_pass() -> None:
    """40 lots from a station that measured nothing else: CONFOUNDED each time."""
    rng = np.random.default_rng(6)
    base = base_lots(rng, 9)
    for _ in range(40):
        new = line.lot(rng, "N", names=THREE, motors=12, station="S2", bias=0.0)
        found = compare(base, new, with_margin())
        assert found.verdict == "CONFOUNDED"
        assert {one.test.status for one in found.constants} == {"CONFOUNDED"}


def test_stations_that_are_not_stated_are_not_the_same() -> None:
    rng = np.random.default_rng(7)
    base = base_lots(rng, 9, station=None)
    new = line.lot(rng, "N", names=THREE, motors=12, station=None)
    assert compare(base, new, with_margin()).verdict == "CONFOUNDED"


def test_limits_fail_even_a_confounded_lot() -> None:
    """A motor outside its tolerance is out, whichever station measured it."""
    rng = np.random.default_rng(8)
    limits = with_margin(nominal=1.0, tolerance=Amount(0.05, "nominal"))
    new = line.lot(rng, "N", names=THREE, station="S2", motors=12, shift=-9.0, shifted="psi_pm_wb")
    found = compare(base_lots(rng, 9), new, limits)
    assert found.verdict == "fail"
    assert verdicts(found)["psi_pm_wb"] == "fail"
    assert verdicts(found)["r_phase_ohm"] == "CONFOUNDED"


def golden_readings(rng: np.random.Generator, biases: dict[str, float]):
    """Three golden motors, three times on every station; bias in sd of motors."""
    sheets = []
    for g in range(3):
        own = rng.standard_normal()
        for station, bias in biases.items():
            for run in range(3):
                values = {
                    name: 1.0 + 0.01 * (own + bias + 0.02 * rng.standard_normal()) for name in THREE
                }
                sheets.append(
                    line.sheet(f"G{g}", None, station, values, run=run + 10 * len(station))
                )
    return sheets


def test_golden_motors_take_off_the_stations_bias() -> None:
    """Station S2 reads 2 sd high; with golden motors on both its healthy lots pass."""
    rng = np.random.default_rng(9)
    base = base_lots(rng, 12)
    golden = golden_readings(rng, {"S1": 0.0, "S2": 2.0})
    alarms = 0
    for _ in range(20):
        new = line.lot(rng, "N", names=THREE, motors=12, station="S2", bias=2.0)
        found = compare(base, new, None, golden, ("G0", "G1", "G2"))
        alarms += found.verdict != "pass"
    assert alarms <= 3
    biases = {b.station: b for b in found.constants[0].stations}
    gap = biases["S2"].bias - biases["S1"].bias
    assert gap == pytest.approx(0.02, abs=0.001)
    assert biases["S2"].by == "golden"
    assert found.golden == ("G0", "G1", "G2")
    gauge = found.constants[0].gauge
    assert gauge is not None
    assert (gauge.motors, gauge.stations, gauge.repeats) == (3, 2, 3)
    assert gauge.reproducibility == pytest.approx(0.02 / np.sqrt(2.0), rel=0.15)


def test_the_links_uncertainty_is_in_the_difference() -> None:
    """One golden motor, read once on each station with 0.5 % of scatter: U cannot be below that."""
    rng = np.random.default_rng(18)
    golden = [
        line.sheet("G0", None, station, dict.fromkeys(THREE, 1.0 + bias), u=0.005)
        for station, bias in (("S1", 0.0), ("S2", 0.02))
    ]
    new = line.lot(rng, "N", names=THREE, motors=200, station="S2", bias=2.0)
    found = compare(base_lots(rng, 12, lot_sd=0.0), new, None, golden, ("G0",))
    link = 0.005 * np.sqrt(2.0)
    for one in found.constants:
        assert one.effect.u == pytest.approx(link, rel=0.2)
        assert one.effect.u > link


def test_what_one_instrument_adds_to_both_sides_cancels() -> None:
    """A gain of 5 % that one station's meter may be off by is in both means alike."""
    rng = np.random.default_rng(19)
    lots = [line.lot(rng, name, names=THREE, motors=12, lot_sd=0.0) for name in ("A", "N")]

    def stated(gain: float):
        return [
            [
                line.sheet(
                    s.motor_id, s.lot, "S1", {n: e.number for n, e in s.constants.items()},
                    u_gain=gain,
                )
                for s in lot
            ]
            for lot in lots
        ]  # fmt: skip

    bare, sure = stated(0.0), stated(0.05)
    without = compare([bare[0]], bare[1], with_margin()).constants[0].effect.u
    with_gain = compare([sure[0]], sure[1], with_margin()).constants[0].effect.u
    assert without == pytest.approx(0.01 * np.sqrt(2.0 / 12.0), rel=0.35)
    assert with_gain == pytest.approx(without, rel=1e-9)


def test_a_shift_is_still_seen_through_the_correction() -> None:
    rng = np.random.default_rng(10)
    base = base_lots(rng, 12)
    golden = golden_readings(rng, {"S1": 0.0, "S2": 2.0})
    new = line.lot(
        rng, "N", names=THREE, motors=12, station="S2", bias=2.0, shift=4.0, shifted="psi_pm_wb"
    )
    found = compare(base, new, None, golden, ("G0", "G1", "G2"))
    assert verdicts(found) == {"r_phase_ohm": "pass", "psi_pm_wb": "fail", "j_rotor_kgm2": "pass"}


def test_lots_split_over_stations_link_them() -> None:
    """Every lot half on S1, half on S2, which reads 3 sd low: no golden motor is needed."""
    rng = np.random.default_rng(11)

    def split(name: str):
        one = line.lot(rng, name, names=THREE, motors=16)
        return [
            line.sheet(
                sheet.motor_id,
                name,
                "S1" if k % 2 else "S2",
                {n: e.number - (0.0 if k % 2 else 0.03) for n, e in sheet.constants.items()},
            )
            for k, sheet in enumerate(one)
        ]

    found = compare([split(f"L{k}") for k in range(10)], split("N"))
    assert found.verdict == "pass"
    assert {s.by for s in found.constants[0].stations} == {"lots"}
    assert found.constants[0].variance[1].sd == pytest.approx(0.03 / np.sqrt(2.0), rel=0.2)


def test_one_temperature_or_none() -> None:
    """R at 60 °C is brought to 25 °C by copper's law; R without a temperature is left out."""
    rng = np.random.default_rng(12)
    base = base_lots(rng, 9)
    warm = 1.0 + 35.0 / 259.5
    new = [
        line.sheet(
            s.motor_id, "N", "S1",
            {n: e.number * (warm if n == "r_phase_ohm" else 1.0) for n, e in s.constants.items()},
            at={"temp_winding_degc": 60.0, "temp_magnet_degc": 25.0},
        )
        for s in line.lot(rng, "N", names=THREE, motors=12)
    ]  # fmt: skip
    assert compare(base, new).verdict == "pass"
    silent = [
        line.sheet(s.motor_id, "N", "S1", {n: e.number for n, e in s.constants.items()}, at={})
        for s in new
    ]
    found = compare(base, silent)
    assert verdicts(found)["r_phase_ohm"] == "not_evaluated"
    assert "temp_winding_degc" in found.constants[0].missing[0]
    assert found.verdict != "pass"


def test_an_outlier_is_named_with_its_capture() -> None:
    rng = np.random.default_rng(13)
    new = line.lot(rng, "N", names=THREE, motors=12)
    odd = {n: e.number for n, e in new[4].constants.items()} | {"psi_pm_wb": 1.12}
    new[4] = line.sheet("N-4", "N", "S1", odd)
    found = compare(base_lots(rng, 9), new)
    assert next((o.motor_id, o.constant, o.capture) for o in found.outliers) == (
        "N-4",
        "psi_pm_wb",
        "N-4/test_0.mcap",
    )
    first = found.outliers[0]
    assert first.z > 10.0
    assert f"is {first.z:.0f} robust standard deviations above" in first.why, "no decimals"


def _cogging(lot: str, orders: dict[int, float], rng: np.random.Generator, motors: int = 12):
    sheets = []
    for k in range(motors):
        spectrum = tuple(
            Order(order, size * (1.0 + 0.05 * rng.standard_normal()), 1e-6, rng.uniform(-3, 3))
            for order, size in orders.items()
        )
        values = {name: 1.0 + 0.01 * rng.standard_normal() for name in THREE}
        sheets.append(line.sheet(f"{lot}-{k}", lot, "S1", values, orders=spectrum))
    return sheets


def test_a_new_cogging_order_is_named() -> None:
    rng = np.random.default_rng(14)
    base = [_cogging("A", {84: 0.008}, rng)]
    found = compare(base, _cogging("B", {84: 0.008, 12: 0.003}, rng), with_margin())
    (new,) = [one for one in found.effects if one.verdict == "fail"]
    assert new.name == "cogging_order_12"
    assert (new.baseline_shown, new.candidate_shown) == (0, 12)
    assert new.candidate_amplitude == pytest.approx(0.003, rel=0.1)
    assert found.verdict == "fail"
    levels = {(one.side, one.order): one for one in found.orders}
    assert levels["candidate", 12].shown == 12
    assert levels["baseline", 12].mean == 0.0
    assert {band.side for band in found.cogging} == {"baseline", "candidate"}
    peaks = {band.side: max(band.mean_nm) for band in found.cogging}
    assert peaks["baseline"] == pytest.approx(0.008, rel=0.05)
    assert peaks["candidate"] == pytest.approx(0.011, rel=0.05)


def test_a_faint_order_is_no_news() -> None:
    """Below a tenth of the leading amplitude it does not count."""
    rng = np.random.default_rng(15)
    base = [_cogging("A", {84: 0.008}, rng)]
    found = compare(base, _cogging("B", {84: 0.008, 12: 0.0004}, rng), with_margin())
    assert found.verdict == "pass"


def test_the_report_crosses_json() -> None:
    import json

    rng = np.random.default_rng(16)
    base = [_cogging("A", {84: 0.008}, rng)]
    found = compare(base, _cogging("B", {84: 0.008, 12: 0.003}, rng), with_margin())
    document = json.loads(canonical_json(found.document()))
    assert document["schema"] == "lot-regression/1"
    assert record_of(LotRegression, document) == found


def test_equal_input_equal_bytes() -> None:
    made = []
    for _ in range(2):
        rng = np.random.default_rng(17)
        found = compare(base_lots(rng, 9), line.lot(rng, "N", names=THREE, motors=12))
        made.append(canonical_json(found.document()))
    assert made[0] == made[1]
