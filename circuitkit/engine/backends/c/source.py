"""A program as C source, with the numbers and indices that go with it."""

from __future__ import annotations

from dataclasses import dataclass

from circuitkit.circuit.expressions.expression import Binary, Call, Expression, Unary
from circuitkit.engine.backends.c.loops import Arrays, print_loops
from circuitkit.engine.backends.c.rows import Constants
from circuitkit.engine.backends.c.unrolled import print_unrolled
from circuitkit.engine.operations import FloatArray, Map, Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program

# Work up to which a program is unrolled: beyond, loops are as fast, and a batch would take long to compile.
_MAX_UNROLLED = 250


@dataclass(frozen=True, eq=False)
class Source:
    """C source for one batch size, or for all above one.

    Attributes:
        text: The source.
        shared: Numbers that the source refers to, shape (n,).
        own: Rows of numbers of every member of the batch, shape (n, B).
        arrays: Long constants and indices.
        work: Roughly how many terms and expressions a step has.
        waits: How often workers wait for each other in a step.
        unrolled: Whether members run one after the other through many steps.
    """

    text: str
    shared: FloatArray
    own: FloatArray
    arrays: Arrays
    work: int
    waits: int
    unrolled: bool


def print_program(program: Program, batch: int) -> Source:
    """Print the source of a program for a batch size.

    Args:
        program: What is to be done.
        batch: Number of copies B.
    """
    alone = batch == 1
    work = sum(_cost(operation) for operation in program.operations)
    single = ["#define CK_SINGLE"] if program.precision == "float32" else []
    head = [*single, '#include "context.h"', '#include "arithmetic.h"', '#include "noise.h"']
    constants, arrays = Constants(), Arrays()
    unrolled = work <= _MAX_UNROLLED
    if unrolled:
        body = [print_unrolled(program, constants, alone=alone), '#include "unrolled.h"']
    else:
        body = [
            '#include "loops.h"',
            '#include "active.h"',
            print_loops(program, arrays, alone=alone),
            '#include "steps.h"',
        ]
    return Source(
        "\n".join([*head, *body, ""]),
        constants.shared_numbers(),
        constants.own_rows(batch),
        arrays,
        work,
        0 if unrolled else len(program.operations),
        unrolled,
    )


def _cost(operation: Operation) -> int:
    match operation:
        case Sum(start=start, stop=stop, sources=sources):
            return len(sources) + stop - start
        case Map(count=count, results=results):
            return count * sum(_size(expression) for _, expression in results)
        case Noise(streams=streams):
            return 10 * len(streams)
        case Recall(slots=slots):
            return len(slots)
        case Remember(sources=sources):
            return len(sources)


def _size(expression: Expression) -> int:
    """Number of operations of an expression."""
    match expression:
        case Unary(operand=operand):
            return _size(operand)
        case Binary(left=left, right=right):
            return 1 + _size(left) + _size(right)
        case Call(arguments=arguments):
            return 4 + sum(_size(argument) for argument in arguments)
    return 1
