"""Docstrings of the whole package: examples run, and what they say of the code is so."""

from __future__ import annotations

import ast
import doctest
import importlib
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "pipeline").rglob("*.py"))
PUBLIC = ROOT / "pipeline" / "api"
EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in FILES
    if ">>> " in path.read_text() and PUBLIC not in path.parents
]
OF_OTHERS = {"ia_ma", "time_ms", "cogging_order_12"}
"""Names that files of others may have, and examples of such."""
PARAMETERS = re.compile(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+\n|\Z)", re.DOTALL | re.MULTILINE)


@cache
def trees() -> dict[Path, ast.Module]:
    """The syntax of every file."""
    return {path: ast.parse(path.read_text()) for path in FILES}


@cache
def nodes(tree: ast.Module) -> tuple[ast.AST, ...]:
    """Every node of a syntax tree; walking those of all files takes a second."""
    return tuple(ast.walk(tree))


def named(text: str) -> list[str]:
    """The names that a Parameters section describes, in order."""
    heads = [line.partition(" :")[0] for line in text.splitlines() if line[:1].strip()]
    return [name.strip(" *") for head in heads for name in head.split(",")]


def wrong(tree: ast.Module) -> Iterator[str]:
    """Functions whose Parameters section leaves one out, invents one or changes their order."""
    for node in nodes(tree):
        if not isinstance(node, ast.FunctionDef):
            continue
        section = PARAMETERS.search(ast.get_docstring(node) or "")
        every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        every += [one for one in (node.args.vararg, node.args.kwarg) if one is not None]
        taken = [one.arg for one in every if one.arg not in ("self", "cls")]
        if section is not None and named(section[1]) != taken:
            yield f"{node.name}: {named(section[1])} for {taken}"


def words_of(tree: ast.Module) -> set[str]:
    """Every name of the code: of functions, arguments, attributes, and in short texts."""
    found: set[str] = set()
    for node in nodes(tree):
        kinds = (ast.FunctionDef, ast.ClassDef, ast.Name, ast.Attribute, ast.arg, ast.keyword)
        if isinstance(node, kinds):
            found |= {str(getattr(node, key, "")) for key in ("name", "id", "attr", "arg")}
        elif isinstance(node, ast.alias):
            found |= set(node.name.split("."))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found |= set(re.findall(r"\w+", node.value)) if len(node.value) < 60 else set()
    return found


def quoted(tree: ast.Module) -> Iterator[str]:
    """Names in backticks in docstrings; those with capitals in them are patterns, as `u_NAME`."""
    for node in nodes(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.Module)):
            text = ast.get_docstring(node) or ""
            for name in re.findall(r"`([A-Za-z_][\w.]*_[\w.]*)`", text):
                if name.islower() or name.isupper():
                    yield name.rpartition(".")[2]


def raised(body: Iterable[ast.stmt]) -> Iterator[str]:
    """Exceptions that statements raise by name, not in a `try` or a nested function."""
    for node in body:
        if isinstance(node, ast.Raise) and node.exc is not None:
            made = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            if isinstance(made, ast.Name) and made.id[0].isupper():
                yield made.id
        elif isinstance(node, ast.Try):
            for handler in node.handlers:
                yield from raised(handler.body)
        elif not isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            inner = [one for one in ast.iter_child_nodes(node) if isinstance(one, ast.stmt)]
            yield from raised(inner)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_in_docstrings_run(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def test_a_parameters_section_names_the_parameters_of_its_function() -> None:
    found = [f"{path}: {one}" for path in FILES for one in wrong(trees()[path])]
    assert found == []


def test_a_docstring_names_what_its_function_raises() -> None:
    """Not of commands, whose errors are the user's, nor of gates, which have them from `Gate`."""
    silent = [
        f"{path}: {node.name}: {error}"
        for path in FILES
        if "stages" not in path.parts
        for node in nodes(trees()[path])
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
        if not ("gates" in path.parts and node.name == "check")
        for error in raised(node.body)
        if error not in (ast.get_docstring(node) or "")
    ]
    assert silent == []


def test_a_docstring_names_nothing_that_is_gone() -> None:
    """A function, field, option or column in backticks is in the code."""
    known = {path.stem for path in FILES}.union(*(words_of(tree) for tree in trees().values()))
    gone = {
        f"{path}: {name}"
        for path in FILES
        for name in quoted(trees()[path])
        if name not in known | OF_OTHERS and not name.startswith("_")
    }
    assert gone == set()


def test_a_section_that_does_not_fit_is_seen() -> None:
    source = 'def f(a, b):\n    """Adds.\n\n    Parameters\n    ----------\n    a, c\n        X."""'
    assert list(wrong(ast.parse(source))) == ["f: ['a', 'c'] for ['a', 'b']"]
    assert list(wrong(ast.parse(source.replace("a, c", "b, a")))) == [
        "f: ['b', 'a'] for ['a', 'b']"
    ]
    assert list(wrong(ast.parse(source.replace("a, c", "a, b")))) == []


def test_only_classes_have_attributes() -> None:
    """A function states its result under Returns; attributes would repeat its summary."""
    found = [
        f"{path}: {node.name}"
        for path in FILES
        for node in nodes(trees()[path])
        if isinstance(node, ast.FunctionDef)
        and re.search(r"^Attributes\n-+$", ast.get_docstring(node) or "", re.MULTILINE)
    ]
    assert found == []


def test_every_entry_of_a_section_of_attributes_is_a_name() -> None:
    entry = re.compile(r"\w+(?:, \w+)*(?: : .+)?")
    found = [
        f"{path}: {node.name}: {line}"
        for path in FILES
        for node in nodes(trees()[path])
        if isinstance(node, ast.ClassDef)
        for text in re.split(r"^Attributes\n-+\n", ast.get_docstring(node) or "", flags=re.M)[1:]
        for line in re.split(r"^\w+\n-+$", text, flags=re.M)[0].splitlines()
        if line and not line.startswith(" ") and not entry.fullmatch(line)
    ]
    assert found == []
