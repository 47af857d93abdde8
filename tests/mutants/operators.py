"""Single-point changes of a source text: where they are, and the text with one of them made.

Text, type annotations, decorators, docstrings and what `raise` says are never changed. The classes
of change are those of DeMillo, Lipton & Sayward (1978, doi:10.1109/C-M.1978.218136) and of Offutt
et al. (1996, doi:10.1145/227607.227610): constants, arithmetic, relations, logic, signs.
"""

from __future__ import annotations

import ast
import copy
import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
# Each relation has a change of its boundary or sense, then one of its direction.
RELATION: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
PAIRS = (
    ("min", "max"),
    ("any", "all"),
    ("minimum", "maximum"),
    ("argmin", "argmax"),
    ("nanmin", "nanmax"),
    ("floor", "ceil"),
    ("sin", "cos"),
)
SWAPPED = {one: other for a, b in PAIRS for one, other in ((a, b), (b, a))}
# A float is off by this share: beyond rounding, within what a wrong table gives.
FACTOR = 1.15


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: lines count from 1; `start` and `end` are byte offsets in the source."""

    path: str
    function: str
    line: int
    kind: str
    before: str
    after: str
    start: int
    end: int
    text: str
    key: str

    def apply(self, source: str) -> str:
        """The source with this change made."""
        raw = source.encode()
        return (raw[: self.start] + self.text.encode() + raw[self.end :]).decode()


def find(source: str, path: str) -> list[Mutant]:
    """Every change of a source, in the order of the text.

    `key` is a digest of the function as it is (without docstring, comments and layout), of the
    change, and of a count among equal ones: it stays while the function does, wherever it moves.
    """
    tree = ast.parse(source)
    starts = _line_starts(source)
    found: list[Mutant] = []
    counted: dict[str, int] = {}
    for owner, name, node in _walk(tree):
        for kind, part, after in _changes(node):
            new = _unparsed(after)
            if not isinstance(after, ast.Constant | ast.AugAssign | ast.Continue | ast.Break):
                new = f"({new})"
            before = ast.unparse(part)
            content = "\n".join((_body(owner), before, new, kind))
            count = counted[content] = counted.get(content, -1) + 1
            digest = hashlib.sha256(f"{content}\n{count}".encode()).hexdigest()
            found.append(
                Mutant(
                    path,
                    name,
                    part.lineno,
                    kind,
                    before,
                    _unparsed(after),
                    starts[part.lineno - 1] + part.col_offset,
                    starts[part.end_lineno - 1] + part.end_col_offset,
                    new,
                    digest[:12],
                )
            )
    return found


def draw(mutants: list[Mutant], seed: int, count: int) -> list[Mutant]:
    """`count` mutants with at most one a place; a change of code elsewhere moves few of them."""

    def rank(mutant: Mutant) -> str:
        return hashlib.sha256(f"{seed} {mutant.key}".encode()).hexdigest()

    places: dict[tuple[str, int, int], Mutant] = {}
    for mutant in sorted(mutants, key=rank):
        places.setdefault((mutant.path, mutant.start, mutant.end), mutant)
    drawn = sorted(places.values(), key=rank)[:count]
    return sorted(drawn, key=lambda m: (m.path, m.start))


def _line_starts(source: str) -> list[int]:
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    return starts


def _unparsed(node: ast.AST) -> str:
    return ast.unparse(ast.fix_missing_locations(node))


def _body(owner: ast.AST) -> str:
    """A function without its docstring; for the rest of a module, the statement."""
    if isinstance(owner, ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(owner):
        owner = copy.copy(owner)
        owner.body = owner.body[1:] or [ast.Pass()]
    return ast.unparse(owner)


def _walk(tree: ast.Module) -> Iterator[tuple[ast.AST, str, ast.AST]]:
    """Nodes that may be changed, with the function or statement that owns them and its name."""
    for statement in tree.body:
        yield from _inside(statement, statement, _name(statement))


def _inside(node: ast.AST, owner: ast.AST, name: str) -> Iterator[tuple[ast.AST, str, ast.AST]]:
    yield owner, name, node
    for child in _parts(node):
        if isinstance(node, ast.ClassDef):
            yield from _inside(child, child, f"{node.name}.{_name(child)}")
        else:
            yield from _inside(child, owner, name)


def _name(statement: ast.AST) -> str:
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return statement.name
    target = (
        getattr(statement, "target", None) or (getattr(statement, "targets", None) or [None])[0]
    )
    return target.id if isinstance(target, ast.Name) else "module"


def _parts(node: ast.AST) -> Iterator[ast.AST]:
    """Children without text, annotations, decorators and what is raised."""
    if isinstance(node, ast.JoinedStr | ast.Raise | ast.Import | ast.ImportFrom | ast.Assert):
        return
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return
    if isinstance(node, ast.Call) and ast.unparse(node.func) in {"cast", "TypeVar", "NewType"}:
        return
    left_out = {"annotation", "returns", "decorator_list", "type_comment", "type_params"}
    for field, value in ast.iter_fields(node):
        if field in left_out:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield child


Changes = Iterator[tuple[str, ast.AST, ast.AST]]


def _changes(node: ast.AST) -> Changes:
    """(kind, part of the text that is replaced, what replaces it)."""
    for kinds, changes in OPERATORS:
        if isinstance(node, kinds):
            yield from changes(node)


def _arithmetic(node: ast.BinOp | ast.AugAssign) -> Changes:
    if type(node.op) in ARITHMETIC:
        yield "arithmetic", node, _with(node, op=ARITHMETIC[type(node.op)]())


def _relation(node: ast.Compare) -> Changes:
    for place, op in enumerate(node.ops):
        for other in RELATION[type(op)]:
            ops = [other() if i == place else o for i, o in enumerate(node.ops)]
            yield "relation", node, _with(node, ops=ops)


def _logic(node: ast.BoolOp) -> Changes:
    yield "logic", node, _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())


def _unary(node: ast.UnaryOp) -> Changes:
    if isinstance(node.op, ast.USub):
        yield "sign", node, node.operand
    elif isinstance(node.op, ast.Not | ast.Invert):
        yield "negation", node, node.operand


def _slice(node: ast.Slice) -> Changes:
    for bound in (node.lower, node.upper):
        if bound is not None and not isinstance(bound, ast.Constant):
            yield "slice", bound, ast.BinOp(bound, ast.Add(), ast.Constant(1))


def _jump(node: ast.Continue | ast.Break) -> Changes:
    yield "jump", node, ast.Break() if isinstance(node, ast.Continue) else ast.Continue()


def _condition(node: ast.If | ast.IfExp | ast.While) -> Changes:
    if isinstance(node.test, ast.Name | ast.Call | ast.Attribute | ast.Subscript):
        yield "negation", node.test, ast.UnaryOp(ast.Not(), node.test)


def _constants(node: ast.Constant) -> Changes:
    value = node.value
    if isinstance(value, bool):
        yield "constant", node, ast.Constant(not value)
    elif isinstance(value, int):
        yield "constant", node, ast.Constant(value + 1)
        if value > 0:
            yield "constant", node, ast.Constant(value - 1)
    elif isinstance(value, float):
        yield "constant", node, ast.Constant(float(f"{value * FACTOR:.12g}") if value else 0.1)


def _swapped_call(node: ast.Call) -> Changes:
    name = node.func
    if isinstance(name, ast.Name) and name.id in SWAPPED:
        yield "function", name, ast.Name(SWAPPED[name.id], ast.Load())
    elif isinstance(name, ast.Attribute) and name.attr in SWAPPED:
        yield "function", name, _with(name, attr=SWAPPED[name.attr])


def _with(node: ast.AST, **fields: object) -> ast.AST:
    changed = copy.copy(node)
    for field, value in fields.items():
        setattr(changed, field, value)
    return changed


OPERATORS: tuple[tuple[tuple[type[ast.AST], ...], Callable[..., Changes]], ...] = (
    ((ast.Constant,), _constants),
    ((ast.BinOp, ast.AugAssign), _arithmetic),
    ((ast.Compare,), _relation),
    ((ast.BoolOp,), _logic),
    ((ast.UnaryOp,), _unary),
    ((ast.Call,), _swapped_call),
    ((ast.Slice,), _slice),
    ((ast.Continue, ast.Break), _jump),
    ((ast.If, ast.IfExp, ast.While), _condition),
)
