"""Each check: passes a sound motor, fails the fault it exists for, and names the suspect."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.signal import lfilter

from pipeline.crosscheck import registry
from pipeline.crosscheck.protocol import Rule
from pipeline.crosscheck.registry import rules
from pipeline.crosscheck.rules import torque_equation
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_a, type_b

P, PSI, LD, LQ, R = 7, 0.0071, 1.9e-4, 2.35e-4, 0.42
EMPTY = Campaign("m", ())
SOUND: dict[str, tuple[float, str]] = {
    "kt_peak_nm_a": (1.5 * P * PSI, "torque_map"),
    "kt_reluctance_nm_a2": (1.5 * P * (LD - LQ), "torque_map"),
    "kt_from_ke_nm_a": (1.5 * P * PSI, "open_circuit"),
    "pole_pairs": (P, "open_circuit"),
    "ld_h": (LD, "current_step"),
    "lq_h": (LQ, "current_step"),
    "r_phase_ohm": (R, "resistance"),
    "resistance_imbalance": (0.004, "resistance"),
    "temp_coeff_copper_1_k": (1.0 / 259.5, "heat_run"),
    "cogging_order": (84, "cogging"),
}


def constants(changed: Mapping[str, float | None] | None = None, u_rel: float = 0.002) -> Constants:
    """The sound motor's constants, some changed; None takes one away."""
    found = []
    for name, (value, method) in SOUND.items():
        now = (changed or {}).get(name, value)
        if now is not None:
            budget = type_a(f"scatter:{name}", u_rel * abs(now))
            found.append(Estimate(name, now, "1", "measured", method, budget))
    return Constants(tuple(found))


def judge(name: str, known: Constants, campaign: Campaign = EMPTY) -> Check:
    rule = next(rule for rule in rules() if rule.name == name)
    return rule.check(known, campaign, rule.options)


def campaign_of(test: str, columns: Mapping[str, np.ndarray], **meta: object) -> Campaign:
    said = CaptureMeta("m", test, **meta)  # type: ignore[arg-type]
    capture = Capture(f"{test}.csv", "0", "verified", said, (pl.DataFrame(dict(columns)),))
    return Campaign("m", (capture,))


def nameplate(**meta: object) -> Campaign:
    return campaign_of("resistance", {"t_s": np.arange(3.0)}, **meta)


def test_the_names_are_those_of_the_contract() -> None:
    assert [rule.name for rule in rules()] == sorted(
        [
            "kt_vs_ke",
            "saliency_ratio",
            "resistance_temperature",
            "resistance_balance",
            "pole_pairs_nameplate",
            "lcr_vs_step_inductance",
            "torque_equation",
            "cogging_order_vs_slots",
            "power_balance",
            "tau_elec_vs_l_over_r",
            "time_base",
            "stated_constants",
        ]
    )


@pytest.mark.parametrize("name", [rule.name for rule in rules()])
def test_nothing_known_is_never_a_pass(name: str) -> None:
    check = judge(name, Constants())
    assert check.status == "not_evaluated"
    assert check.value is None
    assert "needs" in check.meaning


@pytest.mark.parametrize(
    ("factor", "number"),
    [(2 / math.sqrt(3), "1.1547"), (math.sqrt(2), "1.4142"), (1.5, "1.5"), (1 / 7, "pole pairs")],
)
def test_kt_against_ke_names_the_convention(factor: float, number: str) -> None:
    assert judge("kt_vs_ke", constants()).status == "pass"
    check = judge("kt_vs_ke", constants({"kt_peak_nm_a": 1.5 * P * PSI * factor}))
    assert check.status == "fail"
    assert check.value == pytest.approx(factor)
    assert number in (check.suspect or "")


def test_kt_from_back_emf_is_no_measurement_of_kt() -> None:
    """With both from the open-circuit spin the comparison would be of a number with itself."""
    same = Estimate("kt_peak_nm_a", 0.07, "1", "derived", "open_circuit", type_b("v@r", 1e-4))
    rest = [e for e in constants().estimates if e.name != "kt_peak_nm_a"]
    assert judge("kt_vs_ke", Constants((*rest, same))).status == "not_evaluated"


def test_exchanged_axes_are_told_from_a_flux_intensifying_machine() -> None:
    exchanged = {"ld_h": LQ, "lq_h": LD}
    assert judge("saliency_ratio", constants()).status == "pass"
    against = judge("saliency_ratio", constants(exchanged))
    assert against.status == "fail"
    assert "exchanged" in (against.suspect or "")
    agreeing = {**exchanged, "kt_reluctance_nm_a2": 1.5 * P * (LQ - LD)}
    assert judge("saliency_ratio", constants(agreeing)).status == "pass"
    unknown = {**exchanged, "kt_reluctance_nm_a2": None}
    assert judge("saliency_ratio", constants(unknown)).status == "marginal"
    assert judge("saliency_ratio", constants({"lq_h": 12 * LD})).status == "fail"


def test_resistance_follows_copper() -> None:
    assert judge("resistance_temperature", constants()).status == "pass"
    off = judge("resistance_temperature", constants({"temp_coeff_copper_1_k": 0.0032}))
    assert off.status == "fail"


def test_balance_of_the_phases() -> None:
    assert judge("resistance_balance", constants()).status == "pass"
    check = judge("resistance_balance", constants({"resistance_imbalance": 0.05}))
    assert "0.0500 ± 0.0002 (k=2), at most 0.02" in check.meaning
    assert (check.status, check.limit) == ("fail", pytest.approx(0.02 + 2 * 0.002 * 0.05))


@pytest.mark.parametrize(
    ("stated", "status", "words"), [(7, "pass", ""), (14, "fail", "poles"), (8, "fail", "gear")]
)
def test_nameplate(stated: int, status: str, words: str) -> None:
    check = judge("pole_pairs_nameplate", constants(), nameplate(pole_pairs=stated))
    assert check.status == status
    assert words in (check.suspect or "")


def plates(*stated: int) -> Campaign:
    """Captures a.csv, b.csv, ... that each state pole pairs."""
    captures = [
        Capture(f"{chr(97 + n)}.csv", "0", "verified", CaptureMeta("m", "drive", pole_pairs=p), ())
        for n, p in enumerate(stated)
    ]
    return Campaign("m", tuple(captures))


@pytest.mark.parametrize(
    ("stated", "named"),
    [
        ((7, 14, 7), ("b.csv", "1 of 3 captures")),
        ((7, 6, 7, 7, 8), ("b.csv, e.csv", "2 of 5 captures")),
        ((7, 14), ("poles, not pole pairs",)),
        ((14, 14, 7), ("poles, not pole pairs",)),
        ((6, 6), ("another motor's nameplate",)),
    ],
)
def test_the_odd_nameplate_is_named_where_most_are_right(
    stated: tuple[int, ...], named: tuple[str, ...]
) -> None:
    check = judge("pole_pairs_nameplate", constants(), plates(*stated))
    assert check.status == "fail"
    for words in named:
        assert words in (check.suspect or "")
    if "captures" not in named[-1]:
        assert ".csv" not in (check.suspect or "")


def test_a_rule_that_breaks_has_judged_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other checks stand; the broken one is not evaluated and says why."""

    def breaks(known: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
        raise ZeroDivisionError(f"{len(known.estimates)} {campaign.motor_id} {len(options)}")

    odd = Rule("odd", breaks)
    monkeypatch.setattr(registry, "rules", lambda: (odd, *rules()))
    first, *others = registry.check_all(constants(), nameplate(pole_pairs=7), {})
    assert (first.name, first.status) == ("odd", "not_evaluated")
    assert "broke on this data: ZeroDivisionError" in first.meaning
    assert {check.name: check.status for check in others}["pole_pairs_nameplate"] == "pass"


@pytest.mark.parametrize(("value", "limit"), [(math.nan, 1.0), (1.0, math.inf), (1.0, math.nan)])
def test_a_check_against_no_number_has_judged_nothing(
    monkeypatch: pytest.MonkeyPatch, value: float, limit: float
) -> None:
    odd = Rule("odd", lambda *_: Check("odd", "pass", "fine", value, limit))
    monkeypatch.setattr(registry, "rules", lambda: (odd,))
    (check,) = registry.check_all(constants(), EMPTY, {})
    assert (check.status, check.value, check.limit) == ("not_evaluated", None, None)


@pytest.mark.parametrize(
    ("order", "status"),
    [(84, "pass"), (168, "pass"), (12, "marginal"), (14, "marginal"), (1, "marginal"), (5, "fail")],
)
def test_cogging_order(order: int, status: str) -> None:
    check = judge(
        "cogging_order_vs_slots", constants({"cogging_order": order}), nameplate(slots=12)
    )
    assert check.status == status


def test_meter_against_steps_takes_the_worse_axis() -> None:
    meter = [
        Estimate("ld_h", LD, "H", "measured", "lcr", type_a("a", 1e-7)),
        Estimate("lq_h", 2 * LQ, "H", "measured", "lcr", type_a("b", 1e-7)),
    ]
    check = judge("lcr_vs_step_inductance", constants().adding(meter))
    assert check.status == "fail"
    assert check.value == pytest.approx(2.0)
    assert (check.suspect or "").startswith("2:")


def torque_map(gain: float = 1.0, ringing_nm: float = 0.0, lag_s: float = 0.0) -> Campaign:
    """A dynamometer test from the dq equations: 3 speeds, 30 current pairs, losses and noise."""
    rng = np.random.default_rng(3)
    rows = 200
    omega = np.repeat([50.0, -50.0, 150.0], 30 * rows)
    levels = rng.uniform([-5.0, -9.0], [0.0, 9.0], (90, 2))
    id_a, iq_a = np.repeat(levels, rows, axis=0).T
    torque = 1.5 * P * (PSI * iq_a + (LD - LQ) * id_a * iq_a)
    ring = ringing_nm * np.sin(0.9 * np.arange(omega.size) + np.repeat(rng.uniform(0, 6, 90), rows))
    drop = 0.2 * np.array([id_a, iq_a]) / np.hypot(id_a, iq_a)
    vd = R * id_a - P * omega * LQ * iq_a + drop[0]
    vq = R * iq_a + P * omega * (LD * id_a + PSI) + drop[1]
    shaft = torque - 0.005 * np.sign(omega) - 2e-5 * omega
    share = math.exp(-1e-4 / lag_s) if lag_s else 0.0
    shaft = lfilter([1.0 - share], [1.0, -share], shaft)
    columns = {
        "t_s": 1e-4 * np.arange(omega.size),
        "id_a": id_a,
        "iq_a": iq_a,
        "vd_v": gain * vd + rng.normal(0, 0.05, omega.size),
        "vq_v": gain * vq + rng.normal(0, 0.05, omega.size),
        "omega_mech_rad_s": omega,
        "torque_shaft_nm": shaft + ring + rng.normal(0, 0.005, omega.size),
    }
    return campaign_of("torque_map", columns)


def test_power_balance_sees_no_loss_as_a_fault() -> None:
    """Friction, copper and an inverter's drop are there; the slope on shaft power is 1."""
    check = judge("power_balance", constants(), torque_map())
    assert check.status == "pass"
    assert check.value == pytest.approx(1.0, abs=0.005)


def test_a_ringing_shaft_does_not_unbalance_the_power() -> None:
    check = judge("power_balance", constants(), torque_map(ringing_nm=1.0))
    assert check.status in ("pass", "not_evaluated")


def test_a_transducer_that_lags_does_not_unbalance_the_power() -> None:
    """3 ms behind steps of 20 ms; without its rate the ratio would be 1.17 of what it is."""
    check = judge("power_balance", constants(), torque_map(lag_s=3e-3))
    assert check.value == pytest.approx(1.0, abs=0.01)


def test_what_rotor_and_field_store_does_not_unbalance_the_power() -> None:
    """A heavy rotor whose speed swings by half, before a transducer in the shaft, and an inductance
    of 20 ms R: what they store comes back, and is most of the power for a while.
    """
    rng, t = np.random.default_rng(4), 1e-4 * np.arange(80_000)
    omega = 120.0 + 70.0 * np.sin(7.0 * t)
    load = 0.3 + 0.2 * np.sin(2.3 * t + 1.0)
    id_a = -8.0 - 6.0 * np.cos(2.3 * t + 1.0)
    stored = 2e-3 * np.gradient(omega, t)
    iq_a = (load + stored) / (1.5 * P * PSI)
    inductance = 0.02 * R
    vd = R * id_a + inductance * (np.gradient(id_a, t) - P * omega * iq_a)
    vq = R * iq_a + inductance * (np.gradient(iq_a, t) + P * omega * id_a) + P * omega * PSI
    columns = {
        "t_s": t,
        "id_a": id_a,
        "iq_a": iq_a,
        "vd_v": vd + rng.normal(0, 0.05, t.size),
        "vq_v": vq + rng.normal(0, 0.05, t.size),
        "omega_mech_rad_s": omega,
        "torque_shaft_nm": load + rng.normal(0, 0.005, t.size),
    }
    check = judge("power_balance", constants(), campaign_of("torque_map", columns))
    assert check.status == "pass"
    assert check.value == pytest.approx(1.0, abs=0.01)


def test_line_voltage_taken_for_phase_unbalances_the_power() -> None:
    check = judge("power_balance", constants(), torque_map(gain=math.sqrt(3.0)))
    assert check.status == "fail"
    assert "1.7321" in (check.suspect or "")


def test_gains_widen_the_power_in_proportion_to_the_ratio() -> None:
    """Current, voltage and torque are known to 1 % each, of whatever the ratio is."""
    check = judge("power_balance", constants(), torque_map(gain=math.sqrt(3.0)))
    assert check.limit is not None
    assert check.limit - 0.02 == pytest.approx(
        2.0 * math.sqrt(3.0) * 0.01 * math.sqrt(3.0), rel=0.05
    )


def test_where_the_angle_is_there_the_angle_counts_in_the_power() -> None:
    """The bench's own speed is a tenth high; a gate lets it pass because the angle is used."""
    capture = torque_map().captures[0]
    omega = capture.tables[0]["omega_mech_rad_s"].to_numpy()
    table = capture.tables[0].with_columns(
        pl.Series("theta_mech_rad", np.cumsum(omega) * 1e-4), pl.col("omega_mech_rad_s") * 1.1
    )
    check = judge("power_balance", constants(), Campaign("m", (replace(capture, tables=(table,)),)))
    assert check.status == "pass"
    assert check.value == pytest.approx(1.0, abs=0.005)


def test_the_power_is_as_sure_as_the_worse_of_its_stations() -> None:
    """A transducer known to 3 % widens the limit, whichever capture it made."""
    capture = torque_map().captures[0]
    poor = replace(capture, path="z.csv", meta=replace(capture.meta, u_rel_torque=0.03))
    limits = [
        judge("power_balance", constants(), Campaign("m", order)).limit
        for order in ((capture, poor), (poor, capture))
    ]
    assert limits == pytest.approx([0.08, 0.08], abs=0.01)


def test_torque_equation_needs_both_terms() -> None:
    whole = torque_map()
    assert judge("torque_equation", constants(), whole).status == "pass"
    wrong_sign = constants({"kt_reluctance_nm_a2": -10 * P * (LD - LQ)})
    assert judge("torque_equation", wrong_sign, whole).status == "fail"


@pytest.mark.parametrize(("gain", "suspect"), [(1.0, "saturation"), (1.1547, "1.1547")])
def test_a_convention_is_in_the_torque_at_no_d_current_too(gain: float, suspect: str) -> None:
    """A reluctance torque that is off by itself lands on 1.1547; a convention scales all of it."""
    whole = torque_map()
    id_a = min(torque_equation._strongest_d_current_a(whole), 0.0)
    kt, slope = 1.5 * P * PSI, 1.5 * P * (LD - LQ)
    off = (1.1547 * (kt + slope * id_a) - kt) / id_a if gain == 1.0 else gain * slope
    made = constants({"kt_peak_nm_a": gain * kt, "kt_reluctance_nm_a2": off})
    check = judge("torque_equation", made, whole)
    assert check.value == pytest.approx(1.1547, abs=1e-3)
    assert suspect in (check.suspect or "")


def current_step(tau_s: float, temp_degc: float | None = 25.0) -> Campaign:
    """A step up and down on pair ab with d on it, from the closed form, with noise."""
    rng = np.random.default_rng(5)
    t_s = 1e-5 * np.arange(1200)
    on = (t_s >= 1e-3) & (t_s < 7e-3)
    top = 2.0 * (1.0 - math.exp(-6e-3 / tau_s))
    rising = 2.0 * (1.0 - np.exp(-(t_s - 1e-3) / tau_s))
    falling = top * np.exp(-np.maximum(t_s - 7e-3, 0.0) / tau_s)
    i = np.where(on, rising, np.where(t_s < 1e-3, 0.0, falling))
    columns = {
        "t_s": t_s,
        "vab_v": np.where(on, 4.0 * R, 0.0) + rng.normal(0, 0.003, t_s.size),
        "ia_a": i + rng.normal(0, 0.004, t_s.size),
    }
    if temp_degc is not None:
        columns["temp_winding_degc"] = np.full(t_s.size, temp_degc)
    return campaign_of("current_step", columns, pair="ab", theta_elec_deg=-30.0)


def test_the_current_s_own_time_constant() -> None:
    """2 Ld over 2 R on the d axis; a lead resistance of 8 % shortens it by as much."""
    sound = judge("tau_elec_vs_l_over_r", constants(), current_step(LD / R))
    assert sound.status == "pass"
    assert sound.value == pytest.approx(1.0, abs=0.005)
    leads = judge("tau_elec_vs_l_over_r", constants(), current_step(LD / (1.08 * R)))
    assert leads.status == "fail"
    assert leads.value == pytest.approx(1.0 / 1.08, abs=0.005)


def test_a_warm_winding_without_a_thermometer_is_no_lead() -> None:
    """At 45 degC a sound winding settles 7 % sooner, which refused its datasheet."""
    warm = LD / (R * (1.0 + 20.0 / 259.5))
    assert judge("tau_elec_vs_l_over_r", constants(), current_step(warm, 45.0)).status == "pass"
    unlogged = judge("tau_elec_vs_l_over_r", constants(), current_step(warm, None))
    assert unlogged.status == "pass"
    delta = judge("tau_elec_vs_l_over_r", constants(), current_step(LD / (1.5 * R), None))
    assert delta.status == "fail"


@pytest.mark.parametrize("source_share", [0.05, 0.12, 0.25, 1.0])
def test_a_healthy_motor_on_a_supply_that_sags_is_not_refused(source_share: float) -> None:
    """Ratios of 0.79 to 0.90 refused healthy motors: the current settles with L/(R + R_source).

    A step of 4 V open circuit behind `source_share` of the pair's resistance, from the closed form,
    with offsets in both channels; the edges lie between samples.
    """
    rng = np.random.default_rng(6)
    source_ohm = source_share * 2.0 * R
    whole_ohm, tau_s = 2.0 * R + source_ohm, LD / (R * (1.0 + source_share))
    t_s = 1e-5 * np.arange(1200)

    def rise(start_s: float) -> np.ndarray:
        return np.where(t_s > start_s, -np.expm1(-np.maximum(t_s - start_s, 0.0) / tau_s), 0.0)

    current = 4.0 / whole_ohm * (rise(1.003e-3) - rise(7.006e-3))
    opened = np.where((t_s > 1.003e-3) & (t_s < 7.006e-3), 4.0, 0.0)
    columns = {
        "t_s": t_s,
        "vab_v": opened - source_ohm * current + 0.01 + rng.normal(0, 0.003, t_s.size),
        "ia_a": current - 0.03 + rng.normal(0, 0.004, t_s.size),
    }
    campaign = campaign_of("current_step", columns, pair="ab", theta_elec_deg=-30.0)
    check = judge("tau_elec_vs_l_over_r", constants(), campaign)
    assert check.status == "pass"
    assert check.value == pytest.approx(1.0, abs=0.005)


def test_either_line_shows_the_step() -> None:
    """The current of terminal b, which leaves the motor there, and some values missing."""
    capture = current_step(LD / R).captures[0]
    table = capture.tables[0].select(
        "t_s",
        pl.when(pl.col("t_s") > 1.19e-2).then(math.nan).otherwise("vab_v").alias("vab_v"),
        (-pl.col("ia_a")).alias("ib_a"),
    )
    other = Campaign("m", (replace(capture, tables=(table,)),))
    assert judge("tau_elec_vs_l_over_r", constants(), other).status == "pass"


def test_a_voltage_without_an_edge_has_no_time_constant() -> None:
    """A command that stands from the first row on is not evaluated."""
    capture = current_step(LD / R).captures[0]
    held = capture.tables[0].with_columns(pl.lit(1.0).alias("vab_v"))
    campaign = Campaign("m", (replace(capture, tables=(held,)),))
    check = judge("tau_elec_vs_l_over_r", constants(), campaign)
    assert check.status == "not_evaluated"
    assert "settle" in check.meaning
