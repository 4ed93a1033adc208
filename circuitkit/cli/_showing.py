"""How `circuitkit show FILE NEURON` prints one neuron."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from circuitkit.circuit.authoring.explanation import Connection, Explanation, explain
from circuitkit.circuit.graph import CircuitGraph, Neuron
from circuitkit.cli.plot import text_plot
from circuitkit.cli.printing import note, print_json, print_table
from circuitkit.draw.responses import Response, member, response, span

if TYPE_CHECKING:
    from collections.abc import Sequence


def show_neuron(graph: CircuitGraph, name: str, picture: Path | None, *, as_json: bool) -> None:
    """Print an explanation of a neuron, and draw its curve if there is a file to draw it to."""
    explanation = explain(graph, name)
    node = explanation.node
    neuron = node if isinstance(node, Neuron) else member(node, explanation.index or 0)
    curve = response(neuron, *span([neuron]))
    if picture is not None:
        from circuitkit.draw import draw_activations  # here, for the start-up: see app.py

        alone = replace(neuron, name=name)
        draw_activations(
            replace(graph, neurons=(alone,), populations=(), synapses=(), projections=(), outputs=()), picture
        )
    if as_json:
        print_json(_document(explanation, neuron, curve))
    else:
        _print(explanation, neuron, curve)
    if picture is not None:
        note(f"wrote {picture}")


def _document(explanation: Explanation, neuron: Neuron, curve: Response) -> dict[str, object]:
    return {
        "name": explanation.name,
        "model": explanation.model.name,
        "role": explanation.node.role,
        "description": explanation.node.description,
        "origin": str(explanation.node.origin),
        "unit": neuron.activation_unit.symbol,
        "equations": explanation.equations(),
        "values": explanation.values(),
        "inputs": [_row(each) for each in explanation.incoming],
        "outputs": [_row(each) for each in explanation.outgoing],
        "curve": {
            "what": curve.what,
            "activation": (curve.activation / neuron.activation_unit.scale).tolist(),
            "output": curve.output.tolist(),
            "unit": curve.unit.symbol,
        },
    }


def _row(connection: Connection) -> dict[str, object]:
    return {**asdict(connection), "origin": str(connection.origin)}


def _print(explanation: Explanation, neuron: Neuron, curve: Response) -> None:
    node, model = explanation.node, explanation.model
    what = "neuron" if node is neuron else "member" if explanation.index is not None else "population"
    print(f"{explanation.name}: {node.role} {what}, {model.name}")
    for line in (
        node.description,
        model.description,
        f"declared at {node.origin}" if node.origin.file else "",
    ):
        if line:
            print(f"  {line}")
    width = max(map(len, (*explanation.equations(), *explanation.values())))
    print("\nequations, A being the sum of what the inputs deliver" + f" [{neuron.activation_unit}]")
    for name, equation in explanation.equations().items():
        print(f"  {name:{width}} = {equation}")
    print("\nvalues")
    described = {each.name: each.description for each in model.parameters}
    described |= {f"initial {each.name}": each.description for each in model.states}
    for name, value in explanation.values().items():
        words = described.get(name, "")
        print(f"  {name:{width}} = {value}{f'    {words}' if words else ''}")
    print()
    _print_connections("inputs", "from", explanation.incoming)
    _print_connections("goes to", "to", explanation.outgoing)
    if explanation.index is None and node is not neuron:
        print(f"the curve of {neuron.name}")
    scale = neuron.activation_unit.scale
    for line in text_plot(
        (curve.activation / scale).tolist(),
        curve.output.tolist(),
        f"activation A [{neuron.activation_unit}]",
        f"{curve.what} [{curve.unit}]",
    ):
        print(line)


def _print_connections(title: str, end: str, connections: Sequence[Connection]) -> None:
    print_table(
        title,
        (end, ">synapses", ">weight", "kind", "model", ">delay", "gate", "where"),
        (
            (
                each.other,
                str(each.count),
                each.weight,
                "gates it" if each.kind == "gate" else each.kind,
                "" if each.model == "static" else each.model,
                f"{each.delay_s * 1e3:g} ms" if each.delay_s else "",
                each.gate,
                str(each.origin) if each.origin.file else "",
            )
            for each in connections
        ),
    )
