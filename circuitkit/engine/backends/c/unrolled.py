"""A small program as straight C: a variable for every row, a statement for every sum and expression.

One circuit alone is computed with neighbouring neurons side by side in a vector, a batch with neighbouring
members; both do the same operations on every number, so that both give the same bits.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from circuitkit.engine.backends.c import SIMD_WIDTH
from circuitkit.engine.backends.c.pieces import (
    Constants,
    first_read,
    print_expression,
    print_memories,
    written,
)
from circuitkit.engine.operations import FloatArray, Map, Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program, lasting_rows

# Vectors of members whose statements alternate: while one waits for a result, the processor does another.
_ABREAST = 3


def print_unrolled(program: Program, constants: Constants, *, alone: bool) -> str:
    """C source that `unrolled.h` is to follow.

    Args:
        program: What is to be done.
        constants: Takes the numbers.
        alone: For a batch of one.
    """
    printer = _Alone(program, constants) if alone else _Batch(program, constants)
    return printer.source()


class _Printer(ABC):
    """Prints operations; what differs between one circuit and a batch is in `_Alone` and `_Batch`.

    A line with an @ stands for as many lines as there are vectors abreast, with their numbers in its place.

    Attributes:
        width: Numbers of a variable.
        abreast: Vectors of members abreast.
        suffix: What follows the names of variables, and `offset` a pointer to the first member.
    """

    width: int
    abreast: int
    suffix: str
    offset: str

    def __init__(self, program: Program, constants: Constants) -> None:
        self.program = program
        self.constants = constants
        self.lines: list[str] = []
        self.is_loop = False
        self._print: dict[type, Callable[..., None]] = {
            Sum: self._sum,
            Map: self._map,
            Noise: self._noise,
            Recall: self._recall,
            Remember: self._remember,
        }

    def source(self) -> str:
        """Return all of it."""
        kept = np.flatnonzero(lasting_rows(self.program)).tolist()
        head = [
            f"#define CK_WIDTH {self.width * self.abreast}",
            f"#define CK_NARROW {self.width}",
            f"#define N_INPUTS {len(self.program.input_names)}",
            f"#define N_KEPT {len(kept)}",
            f"#define N_MEMORIES {len(self.program.memories)}",
            f"static const int32_t kept_rows[] = {{{', '.join(map(str, [*kept, 0]))}}};",
            *print_memories(self.program),
            *self._copies(kept),
        ]
        self._step(kept)
        return "\n".join([*head, *self._variants()])

    def _copies(self, kept: Sequence[int]) -> Iterable[str]:
        """Return further functions that the surroundings need."""
        del kept
        return ()

    def _variants(self) -> Iterable[str]:
        """Yield the function that does a step, in all widths."""
        yield from self.lines

    def _step(self, kept: Sequence[int]) -> None:
        program = self.program
        read, changed = first_read(program.operations), written(program.operations)
        self.lines += [
            "CK_INLINE int step(const ck_context *c, real *restrict table, const int64_t stride,",
            "    const real *restrict given, const int64_t given_stride, const int64_t at,",
            "    int64_t *restrict places, const int64_t time)",
            "{",
            "const real *restrict shared = c->shared;",
            "const real *restrict own = (const real *)c->own + at;",
            "const uint64_t *seeds = c->seeds + at;",
            "(void)shared, (void)own, (void)seeds, (void)places, (void)time, (void)stride, (void)given;",
        ]
        for memory in program.memories:
            self.lines.append(f"real *const ring{memory.memory} = (real *)c->rings[{memory.memory}] + at;")
        for row in sorted(read | changed | set(kept)):
            self.lines.append(f"v_{self.width} {self._row(row)}{self._first(row, read, changed)};")
        self._do(program.before, "time")
        if program.substep:
            self.lines.append(f"for (int64_t sub = 0; sub < {program.substeps}; sub++) {{")
            self.is_loop = True
            self._do(program.substep, f"(time * {program.substeps} + sub)")
            self.is_loop = False
            self.lines.append("}")
        self._do(program.after, "time")
        self._end(kept, changed)
        self.lines.append("}")

    def _first(self, row: int, read: set[int], changed: set[int]) -> str:
        """Return initialisation of a row's variable."""
        if 1 <= row <= len(self.program.input_names):
            return f" = load_{self.width}(given + {row - 1} * given_stride{self.offset})"
        if row in read or row not in changed:
            return f" = load_{self.width}({self._place('table', row)})"
        return ""

    def _do(self, operations: Iterable[Operation], time: str) -> None:
        self._time = time
        for operation in operations:
            self._print[type(operation)](operation)

    def _row(self, row: int) -> str:
        return f"r{row}{self.suffix}"

    def _place(self, pointer: str, row: int | str) -> str:
        return f"{pointer} + {row} * stride{self.offset}"

    def _assign(self, row: int, value: str) -> None:
        self.lines.append(f"{self._row(row)} = {value};")

    @abstractmethod
    def _end(self, kept: Sequence[int], changed: set[int]) -> None:
        """Stores the rows that last, and returns whether their sum is finite."""

    @abstractmethod
    def _map(self, operation: Map) -> None:
        """Evaluates expressions side by side."""

    def _constant(self, values: FloatArray, k: int) -> str:
        """Number k of the constants, in all lanes or the one of each member."""
        if values.ndim > 1 and self.width > 1:
            return f"load_{self.width}({self._place('own', self.constants.own(values) + k)})"
        return f"all_{self.width}(shared[{self.constants.share(values) + (k if values.ndim else 0)}])"

    def _sum(self, operation: Sum) -> None:
        """Print a sum; where all weights are 1 or -1 nothing is multiplied, other weights are data."""
        weights = operation.weights
        signs = weights if weights.ndim == 1 and (np.abs(weights) == 1.0).all() else None
        for i, row in enumerate(range(operation.start, operation.stop)):
            text = self._row(row) if operation.add else ""
            for k in range(int(operation.indptr[i]), int(operation.indptr[i + 1])):
                source = self._row(operation.base + int(operation.sources[k]))
                sign = "+ " if text else ""
                if signs is not None:
                    sign, product = ("- " if signs[k] < 0 else sign), source
                else:
                    product = f"{self._constant(weights, k)} * {source}"
                text = f"{text} {sign}{product}"
            self._assign(row, text or f"all_{self.width}(0)")

    def _noise(self, operation: Noise) -> None:
        for i, row in enumerate(range(operation.start, operation.stop)):
            drawn = f"normal_{self.width}(seeds{self.offset}, {int(operation.streams[i])}, {self._time})"
            self._assign(row, f"{self._row(row)} + {self._constant(operation.scale, i)} * {drawn}")

    def _recall(self, operation: Recall) -> None:
        memory = self.program.memories[operation.memory]
        name, n = operation.memory, len(memory.sources)
        for i, row in enumerate(range(operation.start, operation.stop)):
            place = f"ck_ago(places[{name}], {int(operation.steps[i])}, {memory.depth})"
            slot = self._place(f"ring{name}", f"({place} * {n} + {int(operation.slots[i])})")
            self._assign(row, f"load_{self.width}({slot})")

    def _remember(self, operation: Remember) -> None:
        name, n = operation.memory, len(operation.sources)
        for i, row in enumerate(operation.sources.tolist()):
            slot = self._place(f"ring{name}", f"(places[{name}] * {n} + {i})")
            self.lines.append(f"store_{self.width}({slot}, {self._row(row)});")
        self.lines.append(f"places[{name}] = ck_ago(places[{name}], -1, {operation.depth});")


class _Batch(_Printer):
    """Members side by side: every variable is a vector of a row of several members."""

    width = SIMD_WIDTH
    abreast = _ABREAST
    suffix = "_@"
    offset = f" + {SIMD_WIDTH} * @"

    def __init__(self, program: Program, constants: Constants) -> None:
        super().__init__(program, constants)
        self._last: dict[int, int] = {}  # line in which a row got its last value, if not in a loop

    def _variants(self) -> Iterable[str]:
        """With all vectors abreast, and with one for what remains of a batch."""
        for name, abreast in (("step", self.abreast), ("step_narrow", 1)):
            for line in self.lines:
                numbers = range(abreast if "@" in line else 1)
                yield "\n".join(line.replace("@", str(k)) for k in numbers).replace(" step(", f" {name}(")

    def _assign(self, row: int, value: str) -> None:
        super()._assign(row, value)
        self._note(row)

    def _note(self, row: int) -> None:
        self._last[row] = -1 if self.is_loop else len(self.lines) - 1

    def _map(self, operation: Map) -> None:
        for i in range(operation.count):
            names = {name: self._row(row + i) for name, row in operation.rows.items()}
            names |= {name: self._row(int(rows[i])) for name, rows in operation.picks.items()}
            names |= {name: self._constant(values, i) for name, values in operation.constants.items()}
            line = ""
            for k, (_, expression) in enumerate(operation.results):
                line += f"const v_{self.width} y{k}_@ = {print_expression(expression, names, self.width)}; "
            for k, (row, _) in enumerate(operation.results):  # all are read before the first one is written
                line += f"{self._row(row + i)} = y{k}_@; "
            self.lines.append(f"{{ {line}}}")
            for row, _ in operation.results:
                self._note(row + i)

    def _end(self, kept: Sequence[int], changed: set[int]) -> None:
        """Stores each row as soon as it has its last value: many stores at the end would have to queue."""
        start = next(i for i, line in enumerate(self.lines) if line.startswith(f"v_{self.width} "))
        for row in kept:
            stored = (
                f"store_{self.width}({self._place('table', row)}, {self._row(row)}); "
                if row in changed
                else ""
            )
            added = f"{stored}check_@ = check_@ + {self._row(row)};"
            line = self._last.get(row, -1)
            if line < 0:
                self.lines.append(added)
            else:
                self.lines[line] += " " + added
        self.lines.insert(start, f"v_{self.width} check_@ = all_{self.width}(0);")
        self.lines += [
            "real total = 0;",
            f"total += total_{self.width}(check_@);",
            "return ck_is_finite(total);",
        ]


class _Alone(_Printer):
    """One circuit: every variable is a number; the neurons of a `Map` are put side by side for it."""

    width = 1
    abreast = 1
    suffix = ""
    offset = ""

    def __init__(self, program: Program, constants: Constants) -> None:
        super().__init__(program, constants)
        self._n_vectors = 0

    def _copies(self, kept: Sequence[int]) -> Iterable[str]:
        """Copies between the table and variables in which a run keeps its rows, row by row."""
        program = self.program
        lasting = [row for row in kept if row > len(program.input_names)]
        usual = [
            *program.activation_rows.tolist(),
            *program.output_rows.tolist(),
            *range(*program.readout_rows),
        ]
        yield f"#define N_ROWS {max(kept, default=0) + 1}"
        yield f"#define N_USUAL {len(usual)}"
        yield f"static const int32_t usual_rows[] = {{{', '.join(map(str, [*usual, 0]))}}};"
        yield "CK_INLINE void copy_rows(real *restrict to, const real *restrict from)"
        yield f"{{ {' '.join(f'to[{row}] = from[{row}];' for row in lasting)} }}"
        yield "CK_INLINE void record_usual(double *restrict to, const real *restrict from)"
        yield f"{{ {' '.join(f'to[{i}] = from[{row}];' for i, row in enumerate(usual))} }}"

    def _map(self, operation: Map) -> None:
        first = 0
        while first < operation.count:
            count = min(operation.count - first, SIMD_WIDTH)
            self._map_part(operation, range(first, first + count), _width(count))
            first += count

    def _map_part(self, operation: Map, part: range, width: int) -> None:
        names = {name: self._packed([row + i for i in part], width) for name, row in operation.rows.items()}
        names |= {
            name: self._packed([int(rows[i]) for i in part], width) for name, rows in operation.picks.items()
        }
        names |= {
            name: self._packed_constants(values, part.start, width)
            for name, values in operation.constants.items()
        }
        vectors = []
        for _, expression in operation.results:
            vectors.append(f"y{self._n_vectors}")
            self._n_vectors += 1
            self.lines.append(
                f"const v_{width} {vectors[-1]} = {print_expression(expression, names, width)};"
            )
        for vector, (start, _) in zip(vectors, operation.results, strict=True):
            for lane, i in enumerate(part):
                self._assign(start + i, vector if width == 1 else f"{vector}[{lane}]")

    def _packed(self, rows: Sequence[int], width: int) -> str:
        if width == 1:
            return f"r{rows[0]}"
        filled = [*rows, *[rows[-1]] * (width - len(rows))]
        return f"(v_{width}){{{', '.join(f'r{row}' for row in filled)}}}"

    def _packed_constants(self, values: FloatArray, first: int, width: int) -> str:
        place = self.constants.share(values)
        return f"load_{width}(shared + {place + first})" if values.ndim else f"all_{width}(shared[{place}])"

    def _end(self, kept: Sequence[int], changed: set[int]) -> None:
        self.lines += [f"table[{row}] = {self._row(row)};" for row in kept if row in changed]
        self.lines.append(f"return ck_is_finite({_added([self._row(row) for row in kept])});")


def _added(terms: Sequence[str]) -> str:
    """Return a sum in pairs of pairs, whose terms need not wait for each other."""
    if len(terms) <= 1:
        return terms[0] if terms else "0"
    half = len(terms) // 2
    return f"({_added(terms[:half])} + {_added(terms[half:])})"


def _width(count: int) -> int:
    """Return the smallest number of lanes for so many numbers."""
    return 1 << (count - 1).bit_length()
