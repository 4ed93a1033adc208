"""How `circuitkit show FILE NEURON` prints one neuron: equations, numbers, and its curve in characters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from circuitkit.circuit.authoring.explanation import Connection, Explanation, explain
from circuitkit.circuit.graph import CircuitGraph, Neuron
from circuitkit.cli.printing import note, print_json, print_table
from circuitkit.draw import draw_activations
from circuitkit.draw.responses import Response, member, response, span

_WIDTH, _HEIGHT = 60, 12  # characters
_ROUNDING = 1e-9  # of the width; an end nearer to 0 is 0


def show_neuron(graph: CircuitGraph, name: str, picture: Path | None, *, as_json: bool) -> None:
    """Print an explanation of a neuron, and draw its curve if there is a file to draw it to."""
    explanation = explain(graph, name)
    node = explanation.node
    neuron = node if isinstance(node, Neuron) else member(node, explanation.index or 0)
    curve = response(neuron, *span([neuron]))
    if picture is not None:
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


def text_plot(x: Sequence[float], y: Sequence[float], x_title: str, y_title: str) -> Iterator[str]:
    """The lines of a plot.

    Args:
        x: Ascending.
        y: As many.
        x_title: Stands below.
        y_title: Stands above.
    """
    low, high = min(y), max(y)
    tall = (high - low) or 1.0
    wide = (x[-1] - x[0]) or 1.0
    canvas = [[" "] * _WIDTH for _ in range(_HEIGHT)]
    for column in range(_WIDTH):
        begin, end = (x[0] + wide * (column + side) / _WIDTH for side in (0, 1))
        values = [value for at, value in zip(x, y, strict=True) if begin <= at <= end]
        for value in values or _between(x, y, (begin + end) / 2):
            row = round((high - value) / tall * (_HEIGHT - 1))
            canvas[row][column] = "*"
    yield f"  {y_title}"
    for row, line in enumerate(canvas):
        label = f"{high - tall * row / (_HEIGHT - 1):9.3g}" if row in {0, _HEIGHT - 1} else " " * 9
        yield f"{label} |{''.join(line)}".rstrip()
    yield f"{' ' * 9} +{'-' * _WIDTH}"
    left, right = (f"{end if abs(end) > _ROUNDING * wide else 0.0:.3g}" for end in (x[0], x[-1]))
    yield f"{' ' * 11}{left}{right:>{_WIDTH - len(left)}}"
    yield f"{' ' * 11}{x_title:^{_WIDTH}}".rstrip()


def _between(x: Sequence[float], y: Sequence[float], at: float) -> list[float]:
    """The value at a place between two others, by a straight line."""
    for i in range(1, len(x)):
        if x[i - 1] <= at <= x[i]:
            share = (at - x[i - 1]) / ((x[i] - x[i - 1]) or 1.0)
            return [y[i - 1] + share * (y[i] - y[i - 1])]
    return []
