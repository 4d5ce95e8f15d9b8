"""The values of OpenSCENARIO attributes: `$name`, and `${...}` with numbers, names, operators, functions."""

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

LONGEST = 400
NAME = re.compile(r"\$([A-Za-z_][A-Za-z0-9_.]*)")
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z")

BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: math.fmod,
}
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "round": lambda x: float(math.floor(x + 0.5)),
    "floor": math.floor,
    "ceil": math.ceil,
    "sqrt": math.sqrt,
    "pow": math.pow,
    "abs": abs,
    "sign": lambda x: (x > 0) - (x < 0),
    "min": min,
    "max": max,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
}


class ExpressionError(Exception):
    """A value that cannot be told, and why."""


def evaluated(raw: str, scope: Mapping[str, str]) -> str:
    """Return the text that an attribute stands for; raises ExpressionError."""
    text = raw.strip()
    if not text.startswith("$"):
        return raw
    if text.startswith("${") and text.endswith("}"):
        return _expression(text[2:-1], scope)
    return _known(text[1:], scope)


def _known(name: str, scope: Mapping[str, str]) -> str:
    if name not in scope:
        declared = ", ".join(list(scope)[:12]) or "none"
        raise ExpressionError(f"no such parameter; declared: {declared}")
    return scope[name]


def _expression(text: str, scope: Mapping[str, str]) -> str:
    if len(text) > LONGEST:
        raise ExpressionError(f"an expression of at most {LONGEST} characters was expected")

    def put(match: re.Match[str]) -> str:
        value = _known(match[1], scope)
        return f"({value})" if NUMBER.match(value.strip()) else value

    filled = NAME.sub(put, text)
    try:
        value = _value(ast.parse(filled.strip(), mode="eval").body)
    except _WordError:
        return "".join(part.strip() for part in NAME.sub(lambda m: scope[m[1]], text).split("+"))
    except ExpressionError:
        raise
    except (SyntaxError, ValueError, TypeError, ArithmeticError, RecursionError, MemoryError) as error:
        raise ExpressionError(f"cannot be evaluated: {type(error).__name__}") from None
    return _text(value)


class _WordError(Exception):
    """A word that is no number: the expression joins words with +, as esmini's names do."""


def _value(node: ast.expr) -> Any:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    if isinstance(node, ast.Name):
        if node.id in ("true", "false"):
            return node.id == "true"
        raise _WordError
    if isinstance(node, ast.UnaryOp):
        inner = _value(node.operand)
        if isinstance(node.op, ast.Not):
            return not inner
        return -inner if isinstance(node.op, ast.USub) else +inner
    if isinstance(node, ast.BinOp) and type(node.op) in BINARY:
        return BINARY[type(node.op)](_value(node.left), _value(node.right))
    if isinstance(node, ast.BoolOp):
        values = [_value(one) for one in node.values]
        return all(values) if isinstance(node.op, ast.And) else any(values)
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS:
        return FUNCTIONS[node.func.id](*(_value(one) for one in node.args))
    raise ExpressionError("only numbers, parameters, + - * / %, and, or, not and functions were expected")


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    number = float(value)
    if not math.isfinite(number):
        raise ExpressionError("is no finite number")
    return str(int(number)) if number == int(number) and abs(number) < 1e15 else repr(number)
