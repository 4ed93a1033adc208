"""The network in Graphviz's language, for those who want to lay it out with other tools."""

from __future__ import annotations

from circuitkit.draw.layers import directed_links
from circuitkit.draw.network import Network, Node
from circuitkit.draw.style import FONT, GREY, KIND_COLOUR, NORMAL, ROLE_FILL, SMALL

_SHAPE = {"input": "cds", "excitatory": "ellipse", "inhibitory": "octagon", "output": "box"}
_HEAD = {
    "excitatory": "normal",
    "inhibitory": "tee",
    "sensorial": "vee",
    "readout": "normal",
    "gate": "odiamond",
}


def dot_text(network: Network) -> str:
    """Return the circuit as a `digraph` from left to right; instances of files are clusters."""
    lines = [
        f"digraph {_quoted(network.name)} {{",
        f"  graph [rankdir=LR, fontname={_quoted(FONT)}, nodesep=0.3, ranksep=0.7];",
        f"  node [style=filled, fontname={_quoted(FONT)}, fontsize={NORMAL:g}, color={_quoted(GREY)}];",
        f"  edge [fontname={_quoted(FONT)}, fontsize={SMALL:g}];",
    ]
    for group in dict.fromkeys(node.group for node in network.nodes):
        inside = [_node_line(node) for node in network.nodes if node.group == group]
        if group:
            head = f"  subgraph {_quoted(f'cluster_{group}')} {{"
            inside = [head, f"    label={_quoted(group)};", *(f"  {line}" for line in inside), "  }"]
        lines += inside
    for link in directed_links(network):
        attributes = {"color": KIND_COLOUR[link.kind], "arrowhead": _HEAD[link.kind]}
        if link.label:
            attributes["label"] = link.label
        if link.kind == "gate":
            attributes["style"] = "dashed"
        if link.backward:
            attributes["constraint"] = "false"
        lines.append(f"  {_quoted(link.source)} -> {_quoted(link.target)} [{_listed(attributes)}];")
    for rank, role in (("source", "input"), ("sink", "output")):
        names = (_quoted(node.name) for node in network.nodes if node.role == role)
        lines.append(f"  {{rank={rank}; {' '.join(f'{name};' for name in names)}}}")
    return "\n".join([*lines, "}", ""])


def _node_line(node: Node) -> str:
    attributes = {
        "label": "\n".join(node.lines[:2]),
        "shape": _SHAPE[node.role],
        "fillcolor": ROLE_FILL[node.role],
    }
    if node.size > 1:
        attributes["peripheries"] = "3"
    return f"  {_quoted(node.name)} [{_listed(attributes)}];"


def _listed(attributes: dict[str, str]) -> str:
    return ", ".join(f"{key}={_quoted(value)}" for key, value in attributes.items())


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
