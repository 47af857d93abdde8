"""What a Python source says: its syntax tree without comments, docstrings, layout and own imports.

Two sources of one digest compute the same of equal imports. What a source imports of its own
package stands apart: `code_version` follows it, and looks at a module's content, not at its place.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

NO_MEANING = frozenset({"ctx", "kind", "type_comment", "type_ignores"})


BY_TEXT = "@"


@dataclass(frozen=True, slots=True)
class Import:
    """A name that a source takes from its own package: `from HOME import NAME as BOUND`.

    `name` is empty for `import HOME`; `level` counts the dots of a relative import. `bound` is `@`
    for a text that may name a module, which the source may import by it.
    """

    level: int
    home: str
    name: str
    bound: str


@dataclass(frozen=True, slots=True)
class Syntax:
    """The digest of a source, what it imports of its package, and of which libraries."""

    digest: str
    imports: tuple[Import, ...]
    libraries: tuple[str, ...]


def syntax_of(content: bytes, package: str) -> Syntax:
    """What a Python source holds without comments, docstrings, layout and own imports.

    Parameters
    ----------
    content
        The source.
    package
        Name of the package that it is of.

    Returns
    -------
    Syntax
        Digest, imports of the package, and libraries. SyntaxError and ValueError of the parser
        pass.

    """
    tree = ast.parse(content)
    imports: list[Import] = []
    tops: set[str] = set()
    for node in _walk(tree):
        for imported in _imports(node):
            top = imported.home.split(".")[0]
            if imported.level or top == package:
                imports.append(imported)
            else:
                tops.add(top)
        if (text := _place(node, package)) is not None:
            imports.append(Import(0, text, "", BY_TEXT))
    parts: list[str] = []
    _append_text(tree, package, parts)
    return Syntax(
        hashlib.sha256("\0".join(parts).encode("utf-8", "surrogatepass")).hexdigest(),
        tuple(dict.fromkeys(imports)),
        tuple(sorted(tops - sys.stdlib_module_names)),
    )


def _walk(node: ast.AST) -> Iterator[ast.AST]:
    """Every node but those that no run comes to."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not _for_checkers(child):
            yield from _walk(child)


def _for_checkers(node: Any) -> bool:
    """Whether it is `if TYPE_CHECKING:`."""
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
        and not node.orelse
    )


def _imports(node: ast.AST) -> Iterator[Import]:
    if isinstance(node, ast.ImportFrom):
        for one in node.names:
            yield Import(node.level, node.module or "", one.name, one.asname or one.name)
    elif isinstance(node, ast.Import):
        for one in node.names:
            yield Import(0, one.name, "", one.asname or one.name.split(".")[0])


def _place(node: Any, package: str) -> str | None:
    """The text that may be the name of a module of the package."""
    if not isinstance(node, ast.Constant) or not isinstance(node.value, str):
        return None
    top, *rest = node.value.split(".")
    return node.value if top == package and rest and all(map(str.isidentifier, rest)) else None


def _append_text(value: Any, package: str, parts: list[str]) -> None:
    """The tree as text: the same for every release of Python that has the syntax.

    Fields that are empty are left out, for a release may know more of them than another.
    """
    if _place(value, package) is not None:
        parts.append(BY_TEXT)
    elif isinstance(value, ast.AST):
        parts.append(f"{type(value).__name__}(")
        for name in value._fields:
            part = getattr(value, name, None)
            if isinstance(part, list):
                part = [one for one in part if not _idle(one, value, package)]
            if name in NO_MEANING or part is None or part == []:
                continue
            parts.append(name)
            _append_text(part, package, parts)
        parts.append(")")
    elif isinstance(value, list):
        parts.append("[")
        for part in value:
            _append_text(part, package, parts)
        parts.append("]")
    else:
        parts.append(repr(value))


def _idle(node: Any, home: ast.AST, package: str) -> bool:
    """Whether a statement is a text and no more, for checkers, or imports of the package alone.

    Python 3.12 puts empty texts into f-strings where others put none.
    """
    if isinstance(home, ast.JoinedStr):
        return isinstance(node, ast.Constant) and node.value == ""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    if isinstance(node, (ast.Import, ast.ImportFrom)):
        return all(one.level or one.home.split(".")[0] == package for one in _imports(node))
    return _for_checkers(node)
