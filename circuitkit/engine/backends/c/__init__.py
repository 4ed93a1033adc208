"""Generated C: a program's operations as C source, and its compilation.

Read in this order: `pieces` (an expression as C, what is read, written and kept, the numbers that the source
refers to), `unrolled` (a small program, statement by statement), `spikes` (which sums have few sources that
are not zero), `fusion` and `maps` (which maps share a loop, and how it looks), `loops` (a large program, loop
by loop), `build` (compiler and cache); `compiled_backend` beside this folder decides which of the two it is,
has the memory and makes the calls. In C: `arithmetic.h` with `simd.h` (functions of expressions), `noise.h`,
`context.h`, `unrolled.h`, `loops.h` with `active.h` and `steps.h` (what surrounds the generated part),
`runtime.c` with `workers.h` (for Python).
"""

SIMD_WIDTH = 8  # numbers that are computed side by side; `loops.h` has it as well
