"""Formats that are no pictures: tooltips in an SVG, a page of its own around it, and Graphviz's language."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping

from circuitkit.draw.layers import directed_links
from circuitkit.draw.marks import line_ids, node_id
from circuitkit.draw.network import Network, Node
from circuitkit.draw.style import FONT, GREY, KIND_COLOUR, NORMAL, ROLE_FILL, SMALL

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; color: #222; background: #fff; margin: 2rem auto;
  max-width: 75rem; padding: 0 1rem; }}
h1 {{ font-size: 1.3rem; margin: 0 0 .2rem; }}
p {{ margin: 0 0 1rem; color: #555; }}
svg {{ width: 100%; height: auto; max-height: 78vh; }}
svg g[data-ends] {{ transition: opacity .12s; }}
svg.asked g[data-ends]:not(.near) {{ opacity: .12; }}
#details {{ min-height: 4.5em; white-space: pre-line; border-top: 1px solid #ddd; padding-top: .6rem; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>{description}</p>
{svg}
<div id="details">Point at a node or a line for its details.</div>
<script>
const svg = document.querySelector("svg"), details = document.getElementById("details");
const marks = [...svg.querySelectorAll("g[data-ends]")];
for (const mark of marks) {{
  const mine = mark.dataset.ends.split(" ");
  mark.addEventListener("pointerenter", () => {{
    svg.classList.add("asked");
    for (const other of marks) {{
      const ends = other.dataset.ends.split(" ");
      const same = other.dataset.ends === mark.dataset.ends;
      const near = same || (mine.length > 1 ? ends.length === 1 && mine.includes(ends[0])
        : ends.length > 1 && ends.includes(mine[0]));
      other.classList.toggle("near", near);
    }}
    details.textContent = mark.querySelector("title").textContent;
  }});
  mark.addEventListener("pointerleave", () => svg.classList.remove("asked"));
}}
</script>
</body>
</html>
"""


def tooltips(network: Network) -> dict[str, tuple[str, str]]:
    """For every node and line its ends (names, joined by a space) and its details, by its identifier."""
    found = {node_id(node.name): (node.name, node.details) for node in network.nodes}
    for link in directed_links(network):
        way = ", goes back in a cycle" if link.backward else ""
        head, _, rest = link.details.partition("\n")
        text = f"{head}{way}\n{rest}" if rest else f"{head}{way}"
        found |= dict.fromkeys(line_ids(link), (f"{link.source} {link.target}", text))
    return found


def add_tooltips(svg: str, texts: Mapping[str, tuple[str, str]]) -> str:
    """Give the groups of an SVG that have one of these identifiers a title and the names of their ends."""

    def titled(match: re.Match[str]) -> str:
        if html.unescape(match[1]) not in texts:
            return match[0]
        ends, text = texts[html.unescape(match[1])]
        return f'<g id="{match[1]}" data-ends="{html.escape(ends)}"><title>{html.escape(text)}</title>'

    return re.sub(r'<g id="([^"]+)">', titled, svg)


def html_page(network: Network, svg: str) -> str:
    """Return a page of its own: the picture, and the details of what the pointer is on. It loads nothing."""
    return _PAGE.format(
        title=html.escape(network.name),
        description=html.escape(network.description),
        svg=svg[svg.index("<svg") :],
    )


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
