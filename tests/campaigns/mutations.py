"""Small changes of a source file, each by the place of one node of its syntax tree.

Operators (`+` for `-`, `<` for `<=`, `and` for `or`, a sign, a `not`), constants (n + 1, twice x, True for False),
conditions (turned round, or one part of them left out), lines left out (calls, assignments into arrays, `continue`,
`raise`) and terms left out (`a` for `a + b`). Left alone are annotations, decorators, docstrings, text and what goes
into messages: a test that held those to the letter would only be in the way.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

ARITHMETIC = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Pow: ("**", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
COMPARISONS = {
    ast.Lt: ("<", ["<=", ">="]),
    ast.LtE: ("<=", ["<", ">"]),
    ast.Gt: (">", [">=", "<="]),
    ast.GtE: (">=", [">", "<"]),
    ast.Eq: ("==", ["!="]),
    ast.NotEq: ("!=", ["=="]),
    ast.Is: ("is", ["is not"]),
    ast.IsNot: ("is not", ["is"]),
    ast.In: ("in", ["not in"]),
    ast.NotIn: ("not in", ["in"]),
}


@dataclass(frozen=True)
class Mutation:
    """One change of a file: the bytes `first` to `last` of its text become `text`; `line` counts from 1."""

    line: int
    first: int
    last: int
    text: str

    def applied(self, source: str) -> str:
        """The changed source."""
        data = source.encode()
        return (data[: self.first] + self.text.encode() + data[self.last :]).decode()


def mutations(source: str) -> list[Mutation]:
    """All changes of a source, in the order of its lines."""
    places = _Places(source)
    found = {change for node in _looked_at(ast.parse(source)) for change in _of_node(node, places)}
    return sorted(found, key=lambda change: (change.first, change.last, change.text))


def is_another_program(source: str, change: Mutation) -> bool:
    """Whether the changed source can be parsed and says something else."""
    try:
        return ast.dump(ast.parse(change.applied(source))) != ast.dump(ast.parse(source))
    except SyntaxError:
        return False


class _Places:
    """Where nodes lie in the bytes of a source."""

    def __init__(self, source: str) -> None:
        self.data = source.encode()
        self.starts = [0]
        for line in self.data.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def of(self, node: ast.AST) -> tuple[int, int]:
        """First byte and the one after the last."""
        return (
            self.starts[node.lineno - 1] + node.col_offset,  # type: ignore[attr-defined]
            self.starts[node.end_lineno - 1] + node.end_col_offset,
        )  # type: ignore[attr-defined]

    def text(self, node: ast.AST) -> str:
        """The source of a node."""
        first, last = self.of(node)
        return self.data[first:last].decode()

    def whole(self, node: ast.AST, text: str) -> Mutation:
        """A node replaced."""
        return Mutation(node.lineno, *self.of(node), text)  # type: ignore[attr-defined]

    def between(self, left: ast.AST, right: int, old: str, new: str) -> Iterator[Mutation]:
        """The operator after a node and before a byte replaced."""
        start = self.of(left)[1]
        gap = re.sub(rb"#[^\n]*", lambda m: b" " * len(m.group()), self.data[start:right])
        found = re.search(re.escape(old.encode()).replace(rb"\ ", rb"\s+"), gap)
        if found:
            line = self.data[: start + found.start()].count(b"\n") + 1
            yield Mutation(line, start + found.start(), start + found.end(), new)


def _looked_at(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a tree without annotations, decorators, text, messages and what only types need."""
    if isinstance(node, ast.JoinedStr) or _is_of_no_consequence(node):
        return
    yield node
    if isinstance(node, ast.Raise):
        return
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _looked_at(child)


def _is_of_no_consequence(node: ast.AST) -> bool:
    """What only types need; the axis of a reduction, whose -1 often is 1."""
    return (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)) or (
        isinstance(node, ast.keyword) and node.arg == "axis"
    )


def _of_node(node: ast.AST, at: _Places) -> Iterator[Mutation]:
    """The changes of one node alone."""
    match node:
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC and not _is_text(left, right):
            yield from at.between(left, at.of(right)[0], *ARITHMETIC[type(op)])
            if isinstance(op, ast.Add | ast.Sub | ast.Mult | ast.Div):
                yield at.whole(node, f"({at.text(left)})")
        case ast.AugAssign(target=target, op=op, value=value) if type(op) in ARITHMETIC and not _is_text(value):
            old, new = ARITHMETIC[type(op)]
            yield from at.between(target, at.of(value)[0], f"{old}=", f"{new}=")
            yield at.whole(node, "pass")
        case ast.UnaryOp(op=ast.USub() | ast.Not() | ast.Invert(), operand=operand):
            yield at.whole(node, f"({at.text(operand)})")
        case ast.Compare(left=left, ops=ops, comparators=right):
            for before, comparison, after in zip([left, *right], ops, right):
                old, news = COMPARISONS[type(comparison)]
                for new in news:
                    yield from at.between(before, at.of(after)[0], old, new)
        case ast.BoolOp(op=op, values=values):
            pair = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
            for before, after in pairwise(values):
                yield from at.between(before, at.of(after)[0], *pair)
            for k in range(len(values)):
                kept = [f"({at.text(value)})" for i, value in enumerate(values) if i != k]
                yield at.whole(node, kept[0] if len(kept) == 1 else f"({f' {pair[0]} '.join(kept)})")
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            if not isinstance(test, ast.Compare | ast.UnaryOp):  # their own changes turn them round
                yield at.whole(test, f"(not ({at.text(test)}))")
        case ast.comprehension(ifs=ifs):
            yield from (at.whole(test, "True") for test in ifs)
        case ast.Constant(value=value) if isinstance(value, int | float):
            yield from _of_constant(node, value, at)
        case ast.Continue() | ast.Break() | ast.Raise():
            yield at.whole(node, "pass")
        case ast.Expr(value=ast.Call()):
            yield at.whole(node, "pass")
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield at.whole(node, "pass")


def _of_constant(node: ast.Constant, value: float, at: _Places) -> Iterator[Mutation]:
    if isinstance(value, bool):
        yield at.whole(node, str(not value))
    elif isinstance(value, int):
        yield at.whole(node, str(value + 1))
    else:
        yield at.whole(node, repr(2.0 * value) if value else "1.0")


def _is_text(*nodes: ast.AST) -> bool:
    return any(
        isinstance(n, ast.JoinedStr) or (isinstance(n, ast.Constant) and isinstance(n.value, str)) for n in nodes
    )
