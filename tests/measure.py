"""How large the package is, and how well it is documented: `python -m tests.measure [--packages]`.

Code lines are lines with code on them: no blank line, no comment, no docstring. A function is long
with more than 40 of them, without those of functions inside it. An arrow is an import of a module
of the package by another, late imports counted. A function is public where no part of its name,
its class or its path starts with an underscore.
"""

from __future__ import annotations

import argparse
import ast
import io
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "pipeline"
LONG = 40
MANY = 6
QUIET = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
    tokenize.ENCODING,
}
Function = ast.FunctionDef | ast.AsyncFunctionDef
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass
class Size:
    """Counts over some files."""

    files: int = 0
    arrows: int = 0
    code_lines: int = 0
    docstring_lines: int = 0
    functions: int = 0
    public_functions: int = 0
    with_parameters: int = 0
    long_functions: list[str] = field(default_factory=list)
    many_parameters: list[str] = field(default_factory=list)
    longest_file: tuple[int, str] = (0, "")

    def add(self, other: Size) -> None:
        """Adds the counts of other files."""
        for one in fields(self):
            mine, theirs = getattr(self, one.name), getattr(other, one.name)
            setattr(self, one.name, max(mine, theirs) if isinstance(mine, tuple) else mine + theirs)

    def table(self) -> str:
        """The counts as a Markdown table."""
        rows = {
            "files": self.files,
            "arrows": self.arrows,
            "code lines": self.code_lines,
            "docstring lines": self.docstring_lines,
            "docstring lines a code line": f"{self.docstring_lines / self.code_lines:.3f}",
            "public functions": self.public_functions,
            "of these with Parameters": self.with_parameters,
            f"functions over {LONG} code lines": len(self.long_functions),
            f"functions over {MANY} parameters": len(self.many_parameters),
            "longest file, code lines": f"{self.longest_file[0]} ({self.longest_file[1]})",
        }
        lines = [f"| {key} | {value} |" for key, value in rows.items()]
        return "\n".join(["| measure | value |", "| --- | --- |", *lines])


def docstring_lines(tree: ast.Module) -> set[int]:
    """Numbers of the lines that docstrings stand on; bare texts below a name count too."""
    found: set[int] = set()
    for node in ast.walk(tree):
        body = node.body if isinstance(node, DOCUMENTED) else []
        for step in body:
            text = step.value if isinstance(step, ast.Expr) else None
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                found |= set(range(step.lineno, (step.end_lineno or step.lineno) + 1))
    return found


def code_lines(text: str, prose: set[int]) -> set[int]:
    """Numbers of the lines with code on them."""
    found: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in QUIET:
            found |= set(range(token.start[0], token.end[0] + 1))
    return found - prose


def functions(tree: ast.AST, inside: str = "") -> Iterator[tuple[str, Function]]:
    """Every function with the names of what it stands in."""
    for node in ast.iter_child_nodes(tree):
        name = inside
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            name = f"{inside}.{node.name}".lstrip(".")
        if isinstance(node, Function):
            yield name, node
        yield from functions(node, name)


def parameters(node: Function) -> list[str]:
    """Names of the parameters, without `self` and `cls`."""
    every = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    every += [one for one in (node.args.vararg, node.args.kwarg) if one is not None]
    return [one.arg for one in every if one.arg not in ("self", "cls")]


def imported(tree: ast.Module, modules: set[str]) -> set[str]:
    """Modules of the package that a file imports."""
    wanted: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            wanted |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
        elif isinstance(node, ast.Import):
            wanted |= {one.name for one in node.names}
    return wanted & modules


def module_of(path: Path) -> str:
    """The dotted name of a file of the package."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def size(path: Path, modules: set[str]) -> Size:
    """The counts of one file."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    prose = docstring_lines(tree)
    code = code_lines(text, prose)
    name = path.relative_to(PACKAGE).as_posix()
    found = Size(1, len(imported(tree, modules) - {module_of(path)}), len(code), len(prose))
    found.longest_file = (len(code), name)
    for qualified, node in functions(tree):
        found.functions += 1
        inner = [
            (one.lineno, one.end_lineno or 0)
            for one in ast.walk(node)
            if isinstance(one, Function) and one is not node
        ]
        lines = {n for n in code if node.lineno <= n <= (node.end_lineno or 0)}
        lines -= {n for first, last in inner for n in range(first, last + 1)}
        if len(lines) > LONG:
            found.long_functions.append(f"{name}: {qualified} {len(lines)}")
        taken = parameters(node)
        if len(taken) > MANY:
            found.many_parameters.append(f"{name}: {qualified} {len(taken)}")
        if not any(part.startswith("_") for part in [*qualified.split("."), *name.split("/")]):
            found.public_functions += 1
            found.with_parameters += "Parameters\n" in (ast.get_docstring(node) or "")
    return found


def measured() -> dict[str, Size]:
    """The counts of each top-level package."""
    paths = sorted(PACKAGE.rglob("*.py"))
    modules = {module_of(path) for path in paths}
    found: dict[str, Size] = {}
    for path in paths:
        package = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        found.setdefault(package, Size()).add(size(path, modules))
    return found


def main() -> None:
    """Prints the table of the whole package, and of its parts where asked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--packages", action="store_true", help="one row a package too")
    parser.add_argument("--names", action="store_true", help="names of what is too large too")
    wanted = parser.parse_args()
    packages = measured()
    total = Size()
    for one in packages.values():
        total.add(one)
    lines = [total.table()]
    if wanted.packages:
        lines += ["", "| package | code lines | docstrings | ratio | public | with Parameters |"]
        lines += ["| --- | --- | --- | --- | --- | --- |"]
        lines += [
            f"| {name} | {one.code_lines} | {one.docstring_lines} | "
            f"{one.docstring_lines / max(one.code_lines, 1):.2f} | {one.public_functions} | "
            f"{one.with_parameters} |"
            for name, one in packages.items()
        ]
    if wanted.names:
        lines += ["", *total.long_functions, "", *total.many_parameters]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
