"""The engine: a `CircuitGraph` becomes a `Program` of frozen arrays, which steps a `State`; batch axis first.

Read in the order in which the data flows: `compile` (graph to program, by `lowering`), `program` (the
arrays), `state`, `run` (one step, many steps, a stepper for loops), `kernels` (lends what does the
arithmetic), `backends` (make it).
"""

from circuitkit.engine.compile import compile_circuit
from circuitkit.engine.program import Program
from circuitkit.engine.run import Stepper, run, step
from circuitkit.engine.state import State, Trace

__all__ = ["Program", "State", "Stepper", "Trace", "compile_circuit", "run", "step"]
