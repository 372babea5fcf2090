"""A function with one statement changed: one term by rewriting its syntax, or a mistake that somebody wrote down."""

import ast
import copy
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from types import CodeType, FunctionType
from typing import Any

SILENT = {"axis", "keepdims", "initial", "copy", "default", "prepend", "dtype"}  # keywords that no equation holds
SHAPING = {"zeros", "ones", "empty", "reshape", "range", "arange", "split", "broadcast_to", "swapaxes", "moveaxis"}
SWAPPED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
OTHER = {"sin": "cos", "cos": "sin", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
Change = Callable[[], Callable[[], None]]  # does it, and returns how to undo it


@dataclass(frozen=True)
class Mutant:
    """A function of a module with one statement changed; `code` goes into the place of the function's own."""

    module: str
    function: str
    before: str
    after: str
    code: CodeType

    def __str__(self) -> str:
        return f"{self.module}.{self.function}: {self.before}  ->  {self.after}"

    @property
    def key(self) -> tuple[str, str]:
        """What identifies the mutant while lines move: its function and its changed statement."""
        return f"{self.module.removeprefix('gimbalcal.')}.{self.function}", self.after

    def install(self) -> Callable[[], None]:
        """Every reference to the function now runs the changed statement, in this process; returns what ends that."""
        function = original(self.module, self.function)
        old = function.__code__
        function.__code__ = self.code

        def restore() -> None:
            function.__code__ = old

        return restore


def original(module: str, function: str) -> FunctionType:
    """The function behind properties, class methods and caches."""
    found: Any = import_module(module)
    for name in function.split("."):
        found = inspect.getattr_static(found, name)
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    return inspect.unwrap(found)


def mistaken(module: str, function: str, before: str, after: str) -> Mutant:
    """The mutant in whose text `after` stands for `before`; raises ValueError unless it does once before that."""
    try:
        lines, first = inspect.getsourcelines(original(module, function))
    except (ImportError, AttributeError):
        raise ValueError(f"{module}.{function} is not there any more") from None
    text = "".join(lines)
    if text.count(before) != 1:
        raise ValueError(f"{module}.{function} holds {before!r} {text.count(before)} times, and not once")
    source = inspect.getsource(import_module(module)).splitlines(keepends=True)
    at = text.index(before)
    changed = text[:at] + after + text[at + len(before) :]
    source[first - 1 : first - 1 + len(lines)] = [changed]
    code = _code_of(compile("".join(source), module, "exec"), function.split("."))
    return Mutant(module, function, before, after, code)


def mutants(module: str, per_statement: int = 1) -> Iterator[Mutant]:
    """Mutants of every function and method of a module, so many for each statement that computes."""
    source = inspect.getsource(import_module(module))
    tree = ast.parse(source)
    for name, function in _functions(tree):
        for statement in _statements(function):
            for change in list(_changes(statement))[: None if isinstance(statement, ast.Dict) else per_statement]:
                yield _mutant(module, tree, name, statement, change)


def _mutant(module: str, tree: ast.Module, name: str, statement: ast.AST, change: Change) -> Mutant:
    before = _head(statement)
    undo = change()
    try:
        after = _head(statement)
        changed = ast.fix_missing_locations(copy.deepcopy(tree))
    finally:
        undo()
    return Mutant(module, name, before, after, _code_of(compile(changed, module, "exec"), name.split(".")))


def _head(statement: ast.AST) -> str:
    """The statement in one line; of a block only its head."""
    return " ".join(ast.unparse(statement).split("\n")[0].split())


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        if isinstance(node, ast.ClassDef):
            yield from ((f"{node.name}.{f.name}", f) for f in node.body if isinstance(f, ast.FunctionDef))


def _statements(function: ast.FunctionDef) -> Iterator[ast.AST]:
    """Assignments and results, those of nested functions too; each value of a table is an equation of its own."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assign | ast.AugAssign | ast.Return | ast.Expr | ast.Dict):
            yield node


def _changes(statement: ast.AST) -> Iterator[Change]:
    """Ways to change one term; a table gives one for each number in it."""
    if isinstance(statement, ast.Dict):
        for i, value in enumerate(statement.values):
            if not isinstance(value, ast.Attribute) and not any(map(_is_text, ast.walk(value))):
                yield _set(statement.values, i, ast.UnaryOp(ast.USub(), value))
        return
    for node in _terms(statement):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            yield _set(vars(node), "op", ast.Mult())
        elif isinstance(node, ast.BinOp) and type(node.op) in SWAPPED and not _is_text_or_nothing(node):
            yield _set(vars(node), "op", SWAPPED[type(node.op)]())
        elif (
            isinstance(node, ast.UnaryOp)
            and isinstance(node.op, ast.USub)
            and not isinstance(node.operand, ast.Constant)
        ):
            yield _set(vars(node), "op", ast.UAdd())
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE):
            upper = isinstance(node.ops[0], ast.Lt | ast.LtE)
            yield _set(vars(node), "ops", [ast.Gt() if upper else ast.Lt(), *node.ops[1:]])
        elif isinstance(node, ast.Constant) and type(node.value) in {int, float} and node.value:
            yield _set(vars(node), "value", 2 * node.value)
        elif isinstance(node, ast.Attribute) and node.attr in OTHER:
            yield _set(vars(node), "attr", OTHER[node.attr])
        elif isinstance(node, ast.Name) and node.id in OTHER and isinstance(node.ctx, ast.Load):
            yield _set(vars(node), "id", OTHER[node.id])


def _set(holder: Any, key: Any, value: object) -> Change:
    def change() -> Callable[[], None]:
        old = holder[key]
        holder[key] = value

        def undo() -> None:
            holder[key] = old

        return undo

    return change


def _terms(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes of the statement itself, without text, tables, shapes and keywords that say how."""
    for field, value in ast.iter_fields(node):
        if field in {"targets", "target", "annotation"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr | ast.Slice | ast.Dict):
                continue
            if (isinstance(child, ast.keyword) and child.arg in SILENT) or _is_shape(child):
                continue
            yield child
            yield from _terms(child)


def _is_shape(node: ast.AST) -> bool:
    """A call that makes or orders an array: its numbers are sizes."""
    called = node.func if isinstance(node, ast.Call) else None
    name = called.attr if isinstance(called, ast.Attribute) else called.id if isinstance(called, ast.Name) else ""
    return name in SHAPING


def _is_text_or_nothing(node: ast.BinOp) -> bool:
    """Joined words; or 0 * x, which gives a constant the shape of x, and the sum with it."""
    return any(map(_is_text, ast.walk(node))) or _is_nothing(node) or _is_nothing(node.right)


def _is_nothing(node: ast.AST) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.left, ast.Constant) and node.left.value == 0


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr | ast.Dict) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def _code_of(code: CodeType, path: list[str]) -> CodeType:
    for name in path:
        code = next(c for c in code.co_consts if isinstance(c, CodeType) and c.co_name == name)
    return code
