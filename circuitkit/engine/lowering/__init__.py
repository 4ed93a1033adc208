"""From a `CircuitGraph` to the operations of a `Program`: rows for everything, then what is done with them.

Read in this order: `order` (who is evaluated when), `plan` (which neurons stand side by side in which rows),
`sources` (in which row a target finds a source, and how deep memories are), `arithmetic` (sums and
expressions), `synapses`, `neurons` with `methods` (what is done), `circuit` (all of it, in the order of a
control step), `sweep` (several circuits of one structure), `precision` (numbers rounded to float32).
"""

from circuitkit.engine.lowering.circuit import lower
from circuitkit.engine.lowering.precision import in_single_precision
from circuitkit.engine.lowering.sweep import side_by_side

__all__ = ["in_single_precision", "lower", "side_by_side"]
