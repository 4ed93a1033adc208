"""A small program as straight C: a variable for every row, a statement for every sum and expression.

One circuit alone is computed with neighbouring neurons side by side in a vector, a batch with neighbouring
members; both do the same operations on every number, so that both give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from circuitkit.engine.backends.c.constants import Constants
from circuitkit.engine.backends.c.expression import print_expression
from circuitkit.engine.backends.c.rows import first_read, lasting_rows, print_memories, written
from circuitkit.engine.operations import Map, Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program
from circuitkit.engine.state import FloatArray

_LANES = 8


def print_unrolled(program: Program, constants: Constants, *, alone: bool) -> str:
    """C source that `unrolled.h` is to follow.

    Args:
        program: What is to be done.
        constants: Takes the numbers.
        alone: For a batch of one.
    """
    printer = _Alone(program, constants) if alone else _Batch(program, constants)
    return printer.source()


class _Printer:
    """Prints operations; what differs between one circuit and a batch is in `_Alone` and `_Batch`.

    Attributes:
        width: Members side by side, the number of lanes of the variables.
    """

    width: int

    def __init__(self, program: Program, constants: Constants) -> None:
        self.program = program
        self.constants = constants
        self.lines: list[str] = []
        self._print: dict[type, Callable[..., None]] = {
            Sum: self._sum,
            Map: self._map,
            Noise: self._noise,
            Recall: self._recall,
            Remember: self._remember,
        }

    def source(self) -> str:
        """All of it."""
        kept = lasting_rows(self.program)
        head = [
            f"#define CK_WIDTH {self.width}",
            f"#define N_INPUTS {len(self.program.input_names)}",
            f"#define N_KEPT {len(kept)}",
            f"#define N_MEMORIES {len(self.program.memories)}",
            f"static const int32_t kept_rows[] = {{{', '.join(map(str, [*kept, 0]))}}};",
            *print_memories(self.program),
        ]
        return "\n".join([*head, *self._step(kept)])

    def _step(self, kept: Sequence[int]) -> Iterable[str]:
        program = self.program
        read, changed = first_read(program.operations), written(program.operations)
        yield "CK_INLINE int step(const ck_context *c, real *restrict table,"
        yield "    const int64_t stride, const int64_t at, int64_t *restrict places, const int64_t time)"
        yield "{"
        yield "const real *restrict shared = c->shared;"
        yield "const real *restrict own = (const real *)c->own + at;"
        for memory in program.memories:
            yield f"real *const ring{memory.memory} = (real *)c->rings[{memory.memory}] + at;"
        yield "(void)shared, (void)own, (void)places, (void)time, (void)stride;"
        for row in sorted(read | changed | set(kept)):
            is_needed = row in read or row not in changed
            yield f"v_{self.width} r{row}" + (f" = {self._loaded(row)};" if is_needed else ";")
        self._do(program.before, "time")
        if program.substep:
            self.lines.append(f"for (int64_t sub = 0; sub < {program.substeps}; sub++) {{")
            self._do(program.substep, f"(time * {program.substeps} + sub)")
            self.lines.append("}")
            self._forget()
        self._do(program.after, "time")
        yield from self.lines
        yield from self._end(kept, changed)
        yield "}"

    def _do(self, operations: Iterable[Operation], time: str) -> None:
        self._time = time
        for operation in operations:
            self._print[type(operation)](operation)

    def _forget(self) -> None:
        """What was noted about variables does not hold behind a loop."""

    def _loaded(self, row: int) -> str:
        return f"load_{self.width}(table + {row} * stride)"

    def _end(self, kept: Sequence[int], changed: set[int]) -> Iterable[str]:
        raise NotImplementedError

    def _map(self, operation: Map) -> None:
        raise NotImplementedError

    def _weight(self, weights: FloatArray, k: int) -> str:
        """C source for a constant with an index."""
        w = self.width
        if weights.ndim > 1 and w > 1:
            return f"load_{w}(own + {self.constants.own(weights) + k} * stride)"
        place = self.constants.share(weights)
        return f"all_{w}(shared[{place + (k if weights.ndim else 0)}])"

    def _sum(self, operation: Sum) -> None:
        for i, row in enumerate(range(operation.start, operation.stop)):
            terms = [f"r{row}"] if operation.add else []
            for k in range(int(operation.indptr[i]), int(operation.indptr[i + 1])):
                source = operation.base + int(operation.sources[k])
                terms.append(f"{self._weight(operation.weights, k)} * r{source}")
            self._assign(row, " + ".join(terms) or f"all_{self.width}(0)")

    def _assign(self, row: int, value: str) -> None:
        self.lines.append(f"r{row} = {value};")

    def _noise(self, operation: Noise) -> None:
        for i, row in enumerate(range(operation.start, operation.stop)):
            drawn = f"normal_{self.width}(c->seeds + at, {int(operation.streams[i])}, {self._time})"
            self._assign(row, f"r{row} + {self._weight(operation.scale, i)} * {drawn}")

    def _recall(self, operation: Recall) -> None:
        memory = self.program.memories[operation.memory]
        name, n = operation.memory, len(memory.sources)
        for i, row in enumerate(range(operation.start, operation.stop)):
            place = f"ck_ago(places[{name}], {int(operation.steps[i])}, {memory.depth})"
            slot = f"ring{name} + ({place} * {n} + {int(operation.slots[i])}) * stride"
            self._assign(row, f"load_{self.width}({slot})")

    def _remember(self, operation: Remember) -> None:
        name, n = operation.memory, len(operation.sources)
        for i, row in enumerate(operation.sources.tolist()):
            slot = f"ring{name} + (places[{name}] * {n} + {i}) * stride"
            self.lines.append(f"store_{self.width}({slot}, r{row});")
        self.lines.append(f"places[{name}] = ck_ago(places[{name}], -1, {operation.depth});")


class _Batch(_Printer):
    """Members side by side: every variable is a vector of a row of several members."""

    width = _LANES

    def _map(self, operation: Map) -> None:
        for i in range(operation.count):
            names = {name: f"r{row + i}" for name, row in operation.rows.items()}
            names |= {name: f"r{int(rows[i])}" for name, rows in operation.picks.items()}
            names |= {name: self._weight(values, i) for name, values in operation.constants.items()}
            values = [print_expression(expression, names, self.width) for _, expression in operation.results]
            assigned = [
                f"v_{self.width} y{k} = {value}; " for k, value in enumerate(values)
            ]  # all before the first one is written
            written = [f"r{row + i} = y{k};" for k, (row, _) in enumerate(operation.results)]
            self.lines.append("{ " + "".join(assigned) + " ".join(written) + " }")

    def _end(self, kept: Sequence[int], changed: set[int]) -> Iterable[str]:
        for row in kept:
            if row in changed:
                yield f"store_{self.width}(table + {row} * stride, r{row});"
        added = " + ".join(f"r{row}" for row in kept)
        yield f"return ck_is_finite(total_{self.width}({added or 'all_8(0)'}));"


class _Alone(_Printer):
    """One circuit: every variable is a number; the neurons of a `Map` are put side by side for it."""

    width = 1

    def __init__(self, program: Program, constants: Constants) -> None:
        super().__init__(program, constants)
        self._vectors: dict[
            int, tuple[str, int, int]
        ] = {}  # by row: the vector it stands in, its width, the lane
        self._n_vectors = 0

    def _assign(self, row: int, value: str) -> None:
        self._vectors.pop(row, None)
        super()._assign(row, value)

    def _forget(self) -> None:
        self._vectors.clear()

    def _map(self, operation: Map) -> None:
        first = 0
        while first < operation.count:
            count = min(operation.count - first, _LANES)
            self._map_part(operation, range(first, first + count), _width(count))
            first += count

    def _map_part(self, operation: Map, part: range, width: int) -> None:
        names = {name: self._packed([row + i for i in part], width) for name, row in operation.rows.items()}
        names |= {
            name: self._packed([int(rows[i]) for i in part], width) for name, rows in operation.picks.items()
        }
        names |= {
            name: self._constant(values, part.start, width) for name, values in operation.constants.items()
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
                self._vectors[start + i] = vector, width, lane

    def _packed(self, rows: Sequence[int], width: int) -> str:
        if width == 1:
            return f"r{rows[0]}"
        filled = [*rows, *[rows[-1]] * (width - len(rows))]
        return f"(v_{width}){{{', '.join(f'r{row}' for row in filled)}}}"

    def _constant(self, values: FloatArray, first: int, width: int) -> str:
        place = self.constants.share(values)
        return f"load_{width}(shared + {place + first})" if values.ndim else f"all_{width}(shared[{place}])"

    def _end(self, kept: Sequence[int], changed: set[int]) -> Iterable[str]:
        """Stores, together what stands in a vector in its order, and adds all up."""
        added: dict[int, list[str]] = {}
        rest = list(kept)
        while rest:
            vector, width, lane = self._vectors.get(rest[0], ("", 1, 0))
            whole = [(vector, width, k) for k in range(width)]
            if width > 1 and lane == 0 and [self._vectors.get(rest[0] + k) for k in range(width)] == whole:
                rows = rest[:width]
            else:
                rows, width = rest[:1], 1
            value = f"r{rows[0]}" if width == 1 else vector
            added.setdefault(width, []).append(value)
            if rows[0] in changed:
                yield f"store_{width}(table + {rows[0]}, {value});"
            del rest[: len(rows)]
        totals = [f"total_{width}({' + '.join(values)})" for width, values in added.items()]
        yield f"return ck_is_finite({' + '.join(totals) or '0'});"


def _width(count: int) -> int:
    """The smallest number of lanes for so many numbers."""
    return 1 << (count - 1).bit_length()
