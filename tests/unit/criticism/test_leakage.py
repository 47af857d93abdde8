"""Criticism sees signals, tests and nameplate numbers: no names, no truth, no disk."""

from __future__ import annotations

import ast
from pathlib import Path

import pipeline.criticism as room

FILES = sorted(Path(room.__file__).parent.rglob("*.py"))
READS = {
    *("test", "pole_pairs", "slots", "ambient_degc", "pair", "theta_elec_deg", "voltage_timing"),
    # what the station states of its own instruments
    *("voltage_kind", "u_rel_current", "u_rel_voltage", "u_rel_torque", "u_temp_degc", "extra"),
}


def _trees():
    return [(path.name, ast.parse(path.read_text(encoding="utf-8"))) for path in FILES]


def test_only_harmless_metadata_is_read():
    """`capture.meta.KEY` and `campaign.nameplate(KEY)` name nothing that tells the motor."""
    read = set()
    for _, tree in _trees():
        for node in ast.walk(tree):
            inner = node.value if isinstance(node, ast.Attribute) else None
            if isinstance(inner, ast.Attribute) and inner.attr == "meta":
                read.add(node.attr)
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "nameplate":
                read.add(node.args[0].value)
    assert read and read <= READS


def test_no_file_is_opened_but_a_users_effects():
    touching = {"open", "read_text", "read_bytes", "glob", "iterdir", "scan_csv", "read_csv"}
    for name, tree in _trees():
        if name == "registry.py":
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                called = getattr(node.func, "attr", getattr(node.func, "id", ""))
                assert called not in touching, (name, called)
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert ".json" not in node.value, name


def test_the_motor_id_is_only_passed_through():
    """It goes from the campaign to the result, in the two entry points and nowhere else."""
    using = set()
    for name, tree in _trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr == "motor_id":
                using.add(name)
    assert using <= {"comparison.py", "diagnosis.py"}
