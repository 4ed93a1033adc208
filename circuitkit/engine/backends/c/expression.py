"""From an `Expression` to C that computes it for several numbers side by side."""

from __future__ import annotations

from collections.abc import Mapping

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Name, Number, Unary

_INFIX = frozenset("+-*/")
_COMPARISONS: Mapping[str, str] = {"<": "less", "<=": "less_equal", ">": "greater", ">=": "greater_equal"}
_LARGEST_WHOLE_POWER = 8
_ROOT = 0.5


def print_expression(expression: Expression, names: Mapping[str, str], width: int) -> str:
    """C source of type `v_WIDTH` for an expression.

    Args:
        expression: The tree.
        names: C source, of the same type, for every name.
        width: How many numbers are computed side by side.
    """
    return _Printer(names, width).text(expression)


class _Printer:
    """Walks a tree; `simd.h` has every function of the language under its own name."""

    def __init__(self, names: Mapping[str, str], width: int) -> None:
        self._names = names
        self._width = width

    def text(self, expression: Expression) -> str:
        match expression:
            case Number(value=value):
                return self._call("all", f"(real){value!r}")
            case Name(name=name):
                return self._names[name]
            case Unary(operator=sign, operand=operand):
                return f"({sign}{self.text(operand)})" if sign == "-" else self.text(operand)
            case Binary():
                return self._binary(expression)
            case Call(function=function, arguments=arguments):
                return self._call(function, *map(self.text, arguments))
        message = f"cannot print {type(expression).__name__}"
        raise TypeError(message)

    def _binary(self, expression: Binary) -> str:
        if expression.operator == "**":
            return self._power(expression.left, expression.right)
        left, right = self.text(expression.left), self.text(expression.right)
        if expression.operator in _INFIX:
            return f"({left} {expression.operator} {right})"
        return self._call(_COMPARISONS[expression.operator], left, right)

    def _call(self, function: str, *arguments: str) -> str:
        return f"{function}_{self._width}({', '.join(arguments)})"

    def _power(self, base: Expression, exponent: Expression) -> str:
        """Return products for small whole powers: a call of `pow` costs as much as twenty."""
        match exponent:
            case Number(value=value) if value in range(1, _LARGEST_WHOLE_POWER + 1):
                return self._call(f"power{int(value)}", self.text(base))
            case Number(value=value) if value == _ROOT:
                return self._call("sqrt", self.text(base))
        return self._call("pow", self.text(base), self.text(exponent))
