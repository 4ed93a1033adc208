"""The engine: a `CircuitGraph` becomes a `Program` of frozen arrays, which steps a `State`; batch axis first.

Read in the order in which the data flows: `compile` (graph to program, with `schedule` for the timings,
`forms` and `layout` for what is computed side by side), `program` (the arrays), `state`, `run` (one step,
many steps, a stepper for loops), `backends` (what does the arithmetic).
"""

from circuitkit.engine.compile import compile_circuit
from circuitkit.engine.program import Program
from circuitkit.engine.run import Stepper, run, step
from circuitkit.engine.state import State, Trace

__all__ = ["Program", "State", "Stepper", "Trace", "compile_circuit", "run", "step"]
