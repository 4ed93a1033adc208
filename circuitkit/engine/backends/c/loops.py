"""A large program as C: a loop over rows for every operation; constants and indices are passed as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
import numpy.typing as npt

from circuitkit.engine.backends.c.fusion import Loop, fused
from circuitkit.engine.backends.c.maps import LoopPrinter
from circuitkit.engine.backends.c.pieces import Arrays, print_memories, ranges, written_ranges
from circuitkit.engine.backends.c.spikes import columns, n_sources, sums_of_spikes
from circuitkit.engine.operations import Noise, Operation, Recall, Remember, Sum
from circuitkit.engine.program import Program, lasting_rows

_LONG = 200_000  # terms whose weights and indices do not fit into a processor's own cache
_MOST_WORKERS = 64  # as in `workers.h`
_PARTS = "worker, workers"
_SUM_ARGUMENTS = "rows, from, n, indptr, sources, weights"
_SUM_PARAMETERS = (
    "real *rows, const real *from, int64_t n, const int64_t *indptr, const int32_t *sources, "
    "const real *weights, int64_t stride, int64_t worker, int64_t workers"
)
_ACTIVE_ARGUMENTS = "n_sources, active, counts, begins, targets, by_column"
_ACTIVE_PARAMETERS = (
    "int64_t n_sources, const int32_t *active, const int64_t *counts, const int64_t *begins, "
    "const int32_t *targets, const real *by_column"
)


def print_loops(program: Program, arrays: Arrays, *, alone: bool) -> str:
    """C source that stands between `loops.h` and `steps.h`.

    Args:
        program: What is to be done.
        arrays: Takes the constants and indices.
        alone: For a batch of one.
    """
    return _Printer(program, arrays, alone=alone).source()


class _Printer:
    def __init__(self, program: Program, arrays: Arrays, *, alone: bool) -> None:
        self._program = program
        self._arrays = arrays
        self._alone = alone
        self._by_columns = sums_of_spikes(program) if alone else set()
        self._lists: dict[tuple[int, int], tuple[int, int]] = {}  # numbers of arrays, by base and n_sources
        self._found: set[tuple[int, int]] = set()  # bases and n_sources of which the active ones are known
        self._functions: dict[str, str] = {}  # names by what stands behind them: like operations share one
        self._print: dict[type, Callable[..., str]] = {
            Sum: self._sum,
            Loop: self._loop,
            Noise: self._noise,
            Recall: self._recall,
            Remember: self._remember,
        }

    def source(self) -> str:
        program = self._program
        step = [*self._step()]
        kept = ", ".join(f"{{{start}, {stop}}}" for start, stop in ranges(lasting_rows(program)))
        head = [
            f"#define N_INPUTS {len(program.input_names)}",
            f"#define N_KEPT {kept.count('{')}",
            f"#define N_MEMORIES {len(program.memories)}",
            f"static const int64_t kept[][2] = {{{kept}}};",
            *print_memories(program),
        ]
        return "\n".join([*head, *self._printed_functions(), *step])

    def _printed_functions(self) -> Iterator[str]:
        for text, name in self._functions.items():
            yield f"static __attribute__((noinline)) void {name}{text}"

    def _function(self, text: str) -> str:
        """Return the name of a function with these parameters and this body."""
        return self._functions.setdefault(text, f"operation{len(self._functions)}")

    def _step(self) -> Iterator[str]:
        program = self._program
        yield "static void step(ck_context *c, int64_t *places, const int64_t time,"
        yield "    int64_t worker, int64_t workers)"
        yield "{"
        yield "real *const table = c->table;"
        yield f"const int64_t stride = {'1' if self._alone else 'c->stride'};"
        yield "(void)table, (void)places, (void)time, (void)stride;"
        yield from self._do(program.before, "time")
        if program.substep:
            yield f"for (int64_t sub = 0; sub < {program.substeps}; sub++) {{"
            yield from self._do(program.substep, f"(time * {program.substeps} + sub)")
            yield "}"
        yield from self._do(program.after, "time")
        yield "}"

    def _do(self, operations: Iterable[Operation], time: str) -> Iterator[str]:
        self._time = time
        self._found.clear()
        for operation in fused(operations):
            if isinstance(operation, Sum) and operation in self._by_columns:
                yield from self._find(operation)
            yield self._print[type(operation)](operation)
            yield "wait_for_all(c, workers);"
            if isinstance(operation, Remember):
                name = operation.memory
                yield f"places[{name}] = ck_ago(places[{name}], -1, {operation.depth});"
            self._forget(operation)

    def _forget(self, operation: Operation | Loop) -> None:
        """Forget which sources are active, where they were written."""
        for each in operation.maps if isinstance(operation, Loop) else (operation,):
            for start, stop in written_ranges(each):
                self._found -= {(base, n) for base, n in self._found if start < base + n and base < stop}

    def _array(self, array: npt.NDArray[np.generic]) -> str:
        return f"c->arrays[{self._arrays.number(array)}]"

    def _find(self, operation: Sum) -> Iterator[str]:
        """Finds the sources that are not zero, unless that has been done since they were written."""
        key = base, n = operation.base, n_sources(operation)
        if key not in self._lists:
            active = self._arrays.later(lambda: np.zeros(n, np.int32))
            self._lists[key] = active, self._arrays.later(lambda: np.zeros(_MOST_WORKERS, np.int64))
        if key not in self._found:
            lists = ", ".join(f"(void *)c->arrays[{number}]" for number in self._lists[key])
            yield f"find_active(table + {base}L, {n}, {lists}, {_PARTS});"
            yield "wait_for_all(c, workers);"
        self._found.add(key)

    def _sum(self, operation: Sum) -> str:
        n = operation.stop - operation.start
        rows = f"table + {operation.start}L * stride, table + {operation.base}L * stride, {n}"
        indices = f"{self._array(operation.indptr)}, {self._array(operation.sources)}"
        kind = f"{operation.weights.ndim}, {int(operation.add)}"
        parameters, further, body = _SUM_PARAMETERS, "", ""
        if operation in self._by_columns:
            parameters, further = f"{_ACTIVE_PARAMETERS}, {parameters}", f"{self._columns(operation)}, "
            body = (
                "if (are_few(counts, n_sources, workers)) "
                f"sum_active(rows, from, n, {_ACTIVE_ARGUMENTS}, {kind}, {_PARTS});\nelse "
            )
        if self._alone:
            kind = f"{kind}, {_degree(operation.indptr)}, {int(len(operation.sources) > _LONG)}"
        general = "sum_alone" if self._alone else "sum_batch"
        name = self._function(
            f"({parameters})\n{{\n{body}{general}({_SUM_ARGUMENTS}, {kind}, stride, {_PARTS});\n}}"
        )
        return f"{name}({further}{rows}, {indices}, {self._array(operation.weights)}, stride, {_PARTS});"

    def _columns(self, operation: Sum) -> str:
        """Return the arguments for the sum by columns."""
        numbers = [
            *self._lists[operation.base, n_sources(operation)],
            self._arrays.later(lambda: columns(operation).begins),
            self._arrays.later(lambda: columns(operation).targets),
            self._arrays.later(lambda: columns(operation).weights),
        ]
        return ", ".join([str(n_sources(operation)), *(f"c->arrays[{number}]" for number in numbers)])

    def _noise(self, operation: Noise) -> str:
        scale = f"{self._array(operation.scale)}, {operation.scale.ndim}"
        drawn = f"{self._array(operation.streams)}, c->seeds, {self._time}"
        n = operation.stop - operation.start
        return f"add_noise(table + {operation.start}L * stride, {n}, {scale}, {drawn}, stride, {_PARTS});"

    def _recall(self, operation: Recall) -> str:
        memory = self._program.memories[operation.memory]
        target, ring = f"table + {operation.start}L * stride", f"c->rings[{operation.memory}]"
        n, n_slots = operation.stop - operation.start, len(memory.sources)
        place, depth = f"places[{operation.memory}]", memory.depth
        slots, steps = operation.slots, operation.steps
        if _are_neighbours(slots) and (steps == steps[0]).all():
            first = f"(ck_ago({place}, {steps[0]}, {depth}) * {n_slots} + {slots[0]}) * stride"
            return f"copy({target}, (const real *){ring} + {first}, {n}, stride, {_PARTS});"
        places = f"{n}, {self._array(slots)}, {self._array(steps)}"
        return f"recall({target}, {ring}, {places}, {n_slots}, {place}, {depth}, stride, {_PARTS});"

    def _remember(self, operation: Remember) -> str:
        ring, place = f"c->rings[{operation.memory}]", f"places[{operation.memory}]"
        n, sources = len(operation.sources), operation.sources
        if _are_neighbours(sources):
            target, rows = f"(real *){ring} + {place} * {n} * stride", f"table + {sources[0]}L * stride"
            return f"copy({target}, {rows}, {n}, stride, {_PARTS});"
        return f"remember(table, {ring}, {n}, {self._array(sources)}, {place}, stride, {_PARTS});"

    def _loop(self, loop: Loop) -> str:
        printer = LoopPrinter(loop, self._array)
        body = printer.alone() if self._alone else printer.batch()
        parameters = ", ".join(["const real *table", "int64_t stride", "int64_t n", *printer.arguments])
        name = self._function(
            f"({parameters}, int64_t worker, int64_t workers)\n{{\n"
            "(void)table, (void)stride;\n"
            "int64_t i = part(n, worker, workers);\n"
            "const int64_t end = part(n, worker + 1, workers);\n" + "\n".join(body) + "\n}"
        )
        count = str(loop.maps[0].count)
        return f"{name}({', '.join(['table', 'stride', count, *printer.arguments.values()])}, {_PARTS});"


def _are_neighbours(rows: npt.NDArray[np.int32]) -> bool:
    return len(rows) > 0 and bool((np.diff(rows) == 1).all())


def _degree(indptr: npt.NDArray[np.int64]) -> int:
    """Return the number of terms that all sums have, or -1: a loop of known length is unrolled."""
    lengths = np.diff(indptr)
    return int(lengths[0]) if len(lengths) and (lengths == lengths[0]).all() else -1
