"""Reasons for a status at the top of a page: each once, with all that it holds for."""

from __future__ import annotations

from pipeline.views.status_text import status_points


def test_a_reason_is_listed_once_with_all_its_names():
    why = (
        "unverified: drive_0.mcap",
        "missing: ld_h (record current_step captures; or pairs at one angle)",
        "unverified: drive_2.mcap",
        "missing: lq_h (record current_step captures)",
        "missing: kt_peak_nm_a (record a torque_map)",
        "stated, not measured: pole_pairs",
        "not approved: approve it (in the registry)",
    )
    assert status_points(why) == (
        "unverified: drive_0.mcap, drive_2.mcap",
        "missing: ld_h, lq_h (record current_step captures)",
        "missing: kt_peak_nm_a (record a torque_map)",
        "stated, not measured: pole_pairs",
        "not approved: approve it (in the registry)",
    )


def test_the_same_of_a_required_and_of_another_constant_are_two_reasons():
    why = ("missing: b_visc_nm_s_rad (no coast)", "impossible: torque_coulomb_nm (no coast)")
    assert status_points(why) == why
