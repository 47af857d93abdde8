"""Constants of judgement: every one is explained, can be overridden, and nothing else can."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.policy.policy import DEFAULT, policy_changes, policy_of
from pipeline.records.errors import UsageError
from pipeline.records.policy import entries, policy_digest


def test_every_number_has_unit_meaning_and_origin():
    found = list(entries(DEFAULT))
    assert len({entry.name for entry in found}) == len(found) > 40
    for entry in found:
        assert entry.unit and entry.meaning and entry.origin.reason, entry.name
        assert "\n" not in entry.meaning + entry.origin.reason, entry.name


def test_an_override_changes_its_number_and_the_digest_alone():
    changes = policy_changes({"selection": {"tie": 9, "quick_starts": [1, 0.5]}})
    assert changes == (("selection.quick_starts", (1.0, 0.5)), ("selection.tie", 9.0))
    changed = policy_of(changes)
    expected = replace(DEFAULT.selection, tie=9.0, quick_starts=(1.0, 0.5))
    assert changed == replace(DEFAULT, selection=expected)
    assert policy_digest(changed) != policy_digest(DEFAULT)


def test_what_says_the_default_is_no_change():
    assert policy_changes({"selection": {"tie": 12}}) == ()
    assert policy_of(()) is DEFAULT


@pytest.mark.parametrize(
    ("given", "message", "hint"),
    [
        ({"selection": {"tei": 9.0}}, "no field 'selection.tei'", "did you mean selection.tie?"),
        ({"tie": 9.0}, "no field 'tie'", "did you mean selection.tie?"),
        ({"selection": 9.0}, "no field 'selection'", ""),
        ({"zzzz": {"qqqq": 1.0}}, "no field 'zzzz.qqqq'", "docs/policy.md"),
        ({"selection": {"tie": "9"}}, "policy.selection.tie=9 is no finite number", ""),
        ({"selection": {"tie": True}}, "no finite number", ""),
        ({"selection": {"tie": float("nan")}}, "no finite number", ""),
        ({"selection": {"tie": -9.0}}, "not of the default's sign", "12"),
        ({"selection": {"tie": 0.0}}, "not of the default's sign", "12"),
        ({"selection": {"refits": 2.5}}, "no whole number", "such as 3"),
        ({"selection": {"quick_starts": 1.0}}, "no list", "[1, ...]"),
        ({"selection": {"quick_starts": []}}, "no list", ""),
    ],
)
def test_a_field_or_number_that_is_none_is_one_clear_error(given, message, hint):
    with pytest.raises(UsageError) as raised:
        policy_changes(given)
    assert message in str(raised.value)
    assert hint in str(raised.value) + (raised.value.remedy or "")
