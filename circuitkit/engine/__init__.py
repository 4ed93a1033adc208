"""The engine: a `CircuitGraph` becomes a `Program` of frozen arrays, which steps a `State`; batch axis first.

Read in the order in which the data flows: `compile` (graph to program, by `lowering`), `program` (the
arrays), `state` (what it remembers), `run` (one step, many steps, a stepper for loops), `backends` (make and
lend what does the arithmetic).
"""

from circuitkit.engine.compile import compile_circuit
from circuitkit.engine.program import Program, Trace
from circuitkit.engine.run import Stepper, run, step
from circuitkit.engine.state import State

__all__ = ["Program", "State", "Stepper", "Trace", "compile_circuit", "run", "step"]
