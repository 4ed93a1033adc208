"""Changes of the code that some test should notice: one operator, constant, condition or call at a time."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}

_FALSE = ("None", "False", "''", "()")  # None in their place is the same to most callers


@dataclass(frozen=True)
class Mutant:
    """One change.

    Attributes:
        path: The file.
        line: Its line.
        function: Qualified name of the function around it that no other function is around.
        what: The change in words.
        number: Of the change among those of the file.
    """

    path: Path
    line: int
    function: str
    what: str
    number: int

    def code(self) -> dict[tuple[str, int], CodeType]:
        """Code of all functions of the changed file, by qualified name and first line."""
        tree = ast.parse(self.path.read_text("utf-8"))
        _, _, change = list(_changes(tree))[self.number]
        change()
        return dict(_functions(compile(ast.fix_missing_locations(tree), str(self.path), "exec")))


def mutants_of(path: Path) -> list[Mutant]:
    """All changes of a file."""
    found = []
    for number, (function, (line, what), _) in enumerate(_changes(ast.parse(path.read_text("utf-8")))):
        found.append(Mutant(path, line, function, what, number))
    return found


def _functions(code: CodeType) -> Iterator[tuple[tuple[str, int], CodeType]]:
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield (each.co_qualname, each.co_firstlineno), each
            yield from _functions(each)


_Change = tuple[str, tuple[int, str], Callable[[], None]]


def _changes(tree: ast.Module) -> Iterator[_Change]:
    """The changes of a module: where, what, and a call that makes it in the tree."""
    waiting: list[tuple[str, ast.stmt]] = [("", each) for each in tree.body]
    while waiting:
        prefix, node = waiting.pop(0)
        if isinstance(node, ast.ClassDef):
            waiting = [(f"{prefix}{node.name}.", each) for each in node.body] + waiting
        elif isinstance(node, ast.FunctionDef):
            for statement in node.body:
                for line_what, change in _in_statement(statement, is_first=statement is node.body[0]):
                    yield f"{prefix}{node.name}", line_what, change


def _in_statement(top: ast.stmt, *, is_first: bool) -> Iterator[tuple[tuple[int, str], Callable[[], None]]]:
    for node in ast.walk(top):
        if is_first and node is top and isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return  # the docstring
        for what, change in _of_node(node):
            yield (getattr(node, "lineno", top.lineno), what), change


def _of_node(node: ast.AST) -> Iterator[tuple[str, Callable[[], None]]]:  # noqa: C901 - a case for each kind
    shown = ast.unparse(node)[:60] if isinstance(node, ast.expr | ast.stmt) else ""
    if isinstance(node, ast.Compare):
        for i, operator in enumerate(node.ops):
            if (other := _COMPARISONS.get(type(operator))) is not None:
                yield f"{shown}: {other.__name__}", _setter(node.ops, i, other())
    elif isinstance(node, ast.BoolOp):
        other_op = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
        yield f"{shown}: {type(other_op).__name__}", _setter(node, "op", other_op)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield f"{shown}: without not", _setter(node, "op", ast.UAdd(), operand=_truth(node.operand))
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        other_operator = _OPERATORS[type(node.op)]
        yield f"{shown}: {other_operator.__name__}", _setter(node, "op", other_operator())
    elif isinstance(node, ast.Constant):
        yield from _of_constant(node, shown)
    elif isinstance(node, ast.Return) and node.value is not None and ast.unparse(node.value) not in _FALSE:
        yield f"{shown}: None", _setter(node, "value", ast.Constant(None))
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield f"{shown}: left out", _setter(node, "value", ast.Constant(None))
    elif isinstance(node, ast.If | ast.IfExp) and not isinstance(node.test, ast.Compare | ast.BoolOp):
        yield (
            f"if {ast.unparse(node.test)[:50]}: not",
            _setter(node, "test", ast.UnaryOp(ast.Not(), copy.deepcopy(node.test))),
        )
    elif isinstance(node, ast.Continue):
        yield "continue: left out", _setter(node, "__class__", ast.Pass)


def _of_constant(node: ast.Constant, shown: str) -> Iterator[tuple[str, Callable[[], None]]]:
    if isinstance(node.value, bool):
        yield f"{shown}: {not node.value}", _setter(node, "value", not node.value)
    elif isinstance(node.value, int | float):
        yield f"{shown}: plus 1", _setter(node, "value", node.value + 1)
    elif isinstance(node.value, str) and node.value.strip():
        yield f"{shown}: other text", _setter(node, "value", f"{node.value}XX")


def _truth(node: ast.expr) -> ast.expr:
    return ast.Call(ast.Name("bool", ast.Load()), [node], [])


def _setter(holder: object, key: str | int, value: object, **more: object) -> Callable[[], None]:
    def change() -> None:
        if isinstance(holder, list):
            holder[int(key)] = value
        else:
            setattr(holder, str(key), value)
        for name, other in more.items():
            setattr(holder, name, other)

    return change
