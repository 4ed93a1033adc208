"""Pictures: the network (`graph`), the neurons' curves (`activations`), what happened over time (`traces`).

Read in the order in which the data flows: `network` (what is shown, in which words), `layers` (who stands in
which column, in which order), `placing` (how far apart), `routing` (the lines between), `layout` (all of it
together, and the words on the lines), `marks` (how each is painted), `graph` (the picture and its legend),
`formats` (what is no picture), `style` (colours, axes, files). Nothing here keeps a state: every picture is a
figure of its own.
"""

from circuitkit.draw.activations import draw_activations
from circuitkit.draw.graph import draw_circuit
from circuitkit.draw.traces import draw_traces

__all__ = ["draw_activations", "draw_circuit", "draw_traces"]
