"""The network in Graphviz's language, for those who want to lay it out with other tools."""

from __future__ import annotations

from circuitkit.circuit.graph import CircuitGraph
from circuitkit.draw.labels import label_texts
from circuitkit.draw.layers import make_layers
from circuitkit.draw.style import FONT, GREY, KIND_COLOUR, NORMAL, ROLE_FILL, SMALL

_SHAPE = {"input": "cds", "excitatory": "ellipse", "inhibitory": "octagon", "output": "box"}
_HEAD = {"excitatory": "normal", "inhibitory": "tee", "sensorial": "vee", "readout": "normal"}


def dot_text(graph: CircuitGraph) -> str:
    """The circuit as a `digraph` from left to right."""
    links = make_layers(graph).links
    labels = label_texts(graph, links)
    roles = {node.name: "input" for node in graph.inputs}
    roles |= {neuron.name: neuron.role for neuron in graph.neurons}
    roles |= {output.name: "output" for output in graph.outputs}
    units = {node.name: node.unit for node in graph.inputs}
    units |= {output.name: output.unit for output in graph.outputs}
    lines = [
        f"digraph {_quoted(graph.name)} {{",
        f"  graph [rankdir=LR, fontname={_quoted(FONT)}, nodesep=0.3, ranksep=0.7];",
        f"  node [style=filled, fontname={_quoted(FONT)}, fontsize={NORMAL:g}, color={_quoted(GREY)}];",
        f"  edge [fontname={_quoted(FONT)}, fontsize={SMALL:g}];",
    ]
    for name, role in roles.items():
        text = f"{name}\n[{units[name]}]" if name in units else name
        attributes = {"label": text, "shape": _SHAPE[role], "fillcolor": ROLE_FILL[role]}
        lines.append(f"  {_quoted(name)} [{_listed(attributes)}];")
    for link in links:
        attributes = {"color": KIND_COLOUR[link.kind], "arrowhead": _HEAD[link.kind]}
        if link in labels:
            attributes["label"] = labels[link]
        if link.backward:
            attributes["constraint"] = "false"
        lines.append(f"  {_quoted(link.source)} -> {_quoted(link.target)} [{_listed(attributes)}];")
    for rank, nodes in (("source", graph.inputs), ("sink", graph.outputs)):
        lines.append(f"  {{rank={rank}; {' '.join(f'{_quoted(node.name)};' for node in nodes)}}}")
    return "\n".join([*lines, "}", ""])


def _listed(attributes: dict[str, str]) -> str:
    return ", ".join(f"{key}={_quoted(value)}" for key, value in attributes.items())


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
