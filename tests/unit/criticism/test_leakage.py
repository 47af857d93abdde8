"""Criticism sees signals, tests and nameplate numbers: no names, no truth, no disk."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import pipeline.criticism as criticism_package

FILES = sorted(Path(criticism_package.__file__).parent.rglob("*.py"))
READS = {
    *("test", "pole_pairs", "slots", "ambient_degc", "pair", "theta_elec_deg", "voltage_timing"),
    # what the station states of its own instruments
    *("voltage_kind", "u_rel_current", "u_rel_voltage", "u_rel_torque", "u_temp_degc"),
    *("u_rel_clock", "stated_u_rel", "station"),
    # what it states of its inverter
    *("vdc_v", "pwm_hz"),
}
EXTRA = {"u_rel_lcr", "u_zero_angle_rad"}
"""Keys beyond the contract, each asked for by name: `meta.extra[KEY]`, `meta.stated_u_rel(KEY)`."""


def _trees():
    return [(path.name, ast.parse(path.read_text(encoding="utf-8"))) for path in FILES]


def _is_meta(node: ast.AST, names: set[str]) -> bool:
    """Whether an expression is a capture's metadata: `x.meta`, or a name that stands for it."""
    if isinstance(node, ast.NamedExpr):
        return _is_meta(node.value, names)
    if isinstance(node, ast.Attribute):
        return node.attr == "meta"
    return isinstance(node, ast.Name) and node.id in names


def _aliases(tree: ast.AST) -> set[str]:
    """Names that stand for metadata: assigned from it, or arguments annotated as it."""
    names = {
        node.arg
        for node in ast.walk(tree)
        if isinstance(node, ast.arg) and "CaptureMeta" in ast.unparse(node.annotation or node)
    }
    for node in ast.walk(tree):
        for target, value in _assigned(node):
            if _is_meta(value, names) and isinstance(target, ast.Name):
                names.add(target.id)
        if isinstance(node, ast.NamedExpr) and _is_meta(node.value, names):
            names.add(node.target.id)
    return names


def _assigned(node: ast.AST) -> list[tuple[ast.AST, ast.AST]]:
    """Targets of an assignment with their values, those of `a, b = c, d` one by one."""
    if not isinstance(node, ast.Assign):
        return []
    pairs = []
    for target in node.targets:
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            pairs += zip(target.elts, node.value.elts, strict=True)
        else:
            pairs.append((target, node.value))
    return pairs


def reads_of(tree: ast.AST) -> tuple[set[str], set[str]]:
    """Keys of the metadata, and of its `extra`, that a module reads: `?` is a key not written out,
    or the whole of it in the hands of something that is not looked into.
    """
    names = _aliases(tree)
    parent = {id(child): node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}
    named = {id(value) for node in ast.walk(tree) for _, value in _assigned(node)}
    read, extra = set(), set()
    for node in ast.walk(tree):
        above = parent.get(id(node))
        if isinstance(node, ast.Attribute) and _is_meta(node.value, names):
            read.add(_key(node, above) if node.attr == "instrument_u" else node.attr)
            if node.attr in ("extra", "stated_u_rel"):
                extra.add(_key(node, above))
        elif _is_meta(node, names) and isinstance(getattr(node, "ctx", None), ast.Load):
            own = isinstance(above, ast.Call) and getattr(above.func, "id", "").startswith("_")
            kept = id(node) in named or isinstance(above, ast.NamedExpr)
            if not isinstance(above, ast.Attribute) and not own and not kept:
                read.add("?")
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "nameplate":
            read.add(getattr(node.args[0], "value", "?"))
    return read, extra


def _key(extra: ast.AST, above: ast.AST | None) -> str:
    """The key of `extra[KEY]`, `stated_u_rel(KEY)` or `instrument_u(KEY)`."""
    if isinstance(above, ast.Subscript) and above.value is extra:
        return str(getattr(above.slice, "value", "?"))
    if isinstance(above, ast.Call) and above.func is extra and len(above.args) == 1:
        return str(getattr(above.args[0], "value", "?"))
    return "?"


@pytest.mark.parametrize(
    ("source", "read", "extra"),
    [
        ("capture.meta.test", {"test"}, set()),
        ("meta = capture.meta\nmeta.lot", {"lot"}, set()),
        ("if (said := capture.meta).operator: pass", {"operator"}, set()),
        ("def f(m: CaptureMeta | None): return m.station", {"station"}, set()),
        ("getattr(capture.meta, name)", {"?"}, set()),
        ("asdict(capture.meta)", {"?"}, set()),
        ("meta = capture.meta\nfor k in meta.extra: pass", {"extra"}, {"?"}),
        ("capture.meta.extra['truth']", {"extra"}, {"truth"}),
        ("capture.meta.stated_u_rel('truth')", {"stated_u_rel"}, {"truth"}),
        ("meta, found = capture.meta, {}\nmeta.lot", {"lot"}, set()),
        ("both = capture.meta, {}", {"?"}, set()),
        ("capture.meta.instrument_u('u_rel_current')", {"u_rel_current"}, set()),
        ("capture.meta.instrument_u(key)", {"?"}, set()),
        ("capture.meta.stated_u_rel(key)", {"stated_u_rel"}, {"?"}),
        ("ask = capture.meta.stated_u_rel\nask('truth')", {"stated_u_rel"}, {"?"}),
        ("more = capture.meta.extra\nmore['truth']", {"extra"}, {"?"}),
        ("campaign.nameplate(key)", {"?"}, set()),
    ],
)
def test_whoever_reads_metadata_by_another_name_is_seen(source, read, extra):
    assert reads_of(ast.parse(source)) == (read, extra)


def test_only_harmless_metadata_is_read():
    """`capture.meta.KEY` and `campaign.nameplate(KEY)` name nothing that tells the motor."""
    read, extra = set(), set()
    for _, tree in _trees():
        here, more = reads_of(tree)
        read, extra = read | here, extra | more
    assert read == READS
    assert extra == EXTRA


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
