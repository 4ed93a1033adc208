"""Hypothesis strategies: random circuits in the terms of the file, and as graphs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hypothesis import strategies as st

from circuitkit.base.reading import not_a_text
from circuitkit.base.source import dump_yaml
from circuitkit.circuit import CircuitGraph, parse_circuit
from circuitkit.circuit.expressions.expression import (
    BINARY_OPERATORS,
    FUNCTION_ARITY,
    Binary,
    Call,
    Expression,
    Name,
    Number,
    Unary,
)
from circuitkit.circuit.models import NEURON_MODEL_NAMES, neuron_model

UNITS = ("1", "mm", "m", "deg", "N", "%")
ACTIVATION_UNITS = ("1", "1", "mm", "deg")
TIMINGS = ("as_printed", "synchronous", "ordered")

magnitudes = st.floats(1e-3, 1e3)
signed = st.builds(lambda size, sign: size * sign, magnitudes, st.sampled_from([1, -1]))
# What is no printable text is refused where it is read.
descriptions = st.text(st.characters(exclude_categories=("Cs", "Cn")), max_size=20).filter(
    lambda text: not not_a_text(text)
)


def with_unit(number: float, unit: str) -> float | str:
    """A value of the file: a bare number if dimensionless."""
    return number if unit == "1" else f"{number!r} {unit}"


def quotient(above: str, below: str) -> str:
    """The unit of a weight from a source in one unit to an activation in another."""
    if above == below or below in {"1", "%"}:
        return "1" if above == below else above
    return f"{above}/{below}"


def reciprocal(unit: str) -> str:
    """The unit of a slope."""
    return "1" if unit == "1" else f"/{unit}"


MEMORYLESS = [name for name in NEURON_MODEL_NAMES if not neuron_model(name).states]


@st.composite
def inputs(draw: st.DrawFn) -> dict[str, Any]:
    """A sensorial input."""
    unit = draw(st.sampled_from(UNITS))
    low = draw(signed)
    pair = [with_unit(low, unit), with_unit(low + draw(magnitudes), unit)]
    return {"unit": unit, "range": pair, "description": draw(descriptions)}


@st.composite
def neurons(draw: st.DrawFn, unit: str) -> dict[str, Any]:
    """A neuron of any model whose activation has this unit; parameters with a default may be left out."""
    model = neuron_model(draw(st.sampled_from(MEMORYLESS)))
    units = {"activation": unit, "1/activation": reciprocal(unit), "1": "1"}
    entry: dict[str, Any] = {"model": model.name, "role": draw(st.sampled_from(["excitatory", "inhibitory"]))}
    numbers = {each.name: draw(signed) for each in model.parameters}
    ascending = sorted(numbers[name] for name in model.increasing)
    gap = dict(zip(model.increasing, range(len(ascending)), strict=True))
    numbers |= {name: ascending[position] + position for name, position in gap.items()}
    for each in model.parameters:
        decides_unit = unit != "1" and model.parameters[0].name == each.name
        if each.default is None or decides_unit or draw(st.booleans()):
            entry[each.name] = with_unit(numbers[each.name], units[each.unit_rule.text])
    return entry


@st.composite
def outputs(draw: st.DrawFn, names: list[str]) -> dict[str, Any]:
    """An output that reads some of the neurons."""
    unit = draw(st.sampled_from(UNITS))
    read = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    entry: dict[str, Any] = {"unit": unit, "readout": {name: with_unit(draw(signed), unit) for name in read}}
    if draw(st.booleans()):
        entry["integrate"] = {"leak": f"{draw(st.integers(0, 100))} %"}
    if draw(st.booleans()):
        limit = draw(magnitudes)
        entry["limits"] = [with_unit(-limit, unit), with_unit(limit, unit)]
    return entry


@st.composite
def circuit_data(draw: st.DrawFn) -> dict[str, Any]:
    """A valid circuit file as data: random units, models, roles, parameters, synapses and outputs."""
    signals = {f"u{i}": draw(inputs()) for i in range(draw(st.integers(0, 3)))}
    units = {f"n{i}": draw(st.sampled_from(ACTIVATION_UNITS)) for i in range(draw(st.integers(1, 6)))}
    cells = {name: draw(neurons(unit)) for name, unit in units.items()}
    pairs = st.tuples(st.sampled_from([*signals, *cells]), st.sampled_from([*cells]))
    parameters: dict[str, Any] = {}
    synapses = []
    for source, target in draw(st.lists(pairs, unique=True, max_size=12)):
        unit = quotient(units[target], signals[source]["unit"] if source in signals else "1")
        sign = draw(st.sampled_from([1, -1])) if source in signals else 1
        if source in cells and cells[source]["role"] == "inhibitory":
            sign = -1
        weight: float | str = with_unit(sign * draw(magnitudes), unit)
        if draw(st.booleans()):
            name = f"w{len(parameters)}"
            parameters[name] = {"value": weight, "description": draw(descriptions)}
            weight = name
        synapses.append({"from": source, "to": draw(st.sampled_from([target, [target]])), "weight": weight})
    return {
        "circuit": "random",
        "description": draw(descriptions),
        "control_step": f"{draw(st.integers(1, 50))} ms",
        "timing": draw(st.sampled_from(TIMINGS)),
        "parameters": parameters,
        "inputs": signals,
        "neurons": cells,
        "synapses": synapses,
        "outputs": {f"y{i}": draw(outputs([*cells])) for i in range(draw(st.integers(1, 2)))},
    }


def values(size: int) -> st.SearchStrategy[Any]:
    """Values for every member, of any form, not negative."""
    return st.one_of(
        magnitudes,
        st.lists(magnitudes, min_size=size, max_size=size),
        st.fixed_dictionaries({"range": st.tuples(magnitudes, magnitudes).map(list)}),
        st.fixed_dictionaries({"uniform": st.tuples(magnitudes, magnitudes).map(sorted)}),
        st.fixed_dictionaries({"normal": st.tuples(magnitudes, magnitudes).map(list)}),
        st.sampled_from(["i + 1", "exp(-i / n)", "where(i < 2, 1, 0.5)"]),
    )


@st.composite
def populations(draw: st.DrawFn) -> dict[str, Any]:
    """A population of a model with or without states."""
    size = draw(st.integers(1, 6))
    entry: dict[str, Any] = {"size": size, "role": draw(st.sampled_from(["excitatory", "inhibitory"]))}
    if draw(st.booleans()):
        initial = draw(st.dictionaries(st.just("v"), values(size), max_size=1))
        return entry | {"model": "leaky_linear", "tau": f"{draw(st.integers(1, 50))} ms", "initial": initial}
    return entry | {"model": "sigmoid", "slope": draw(values(size)), "shift": draw(values(size))}


def connections(n_source: int, n_target: int) -> st.SearchStrategy[Any]:
    """What stands under `connect`."""
    rows = st.lists(st.integers(0, n_source - 1), unique=True, max_size=n_source).map(sorted)
    return st.one_of(
        st.just("all_to_all"),
        *([st.just("one_to_one")] if n_source == n_target else []),
        st.fixed_dictionaries({"probability": st.floats(0, 1)}),
        st.fixed_dictionaries({"in_degree": st.integers(1, n_source)}),
        st.fixed_dictionaries({"sources": st.lists(rows, min_size=n_target, max_size=n_target)}),
    )


@st.composite
def many_of_a_kind(draw: st.DrawFn) -> dict[str, Any]:
    """A valid circuit file with populations, projections, synapse models, delays and noise, as data."""
    data = draw(circuit_data())
    groups = {f"g{i}": draw(populations()) for i in range(draw(st.integers(1, 3)))}
    sizes = {name: group["size"] for name, group in groups.items()}
    projections = []
    for source, target in draw(
        st.lists(st.tuples(st.sampled_from([*sizes]), st.sampled_from([*sizes])), max_size=4, unique=True)
    ):
        sign = "-" if groups[source]["role"] == "inhibitory" else ""
        weight = draw(st.sampled_from(["1.5", "0.1 * (i + 1)", "exp(j - i)", "n_source / n_target"]))
        entry = {"from": source, "to": target, "connect": draw(connections(sizes[source], sizes[target]))}
        entry |= {"weight": f"{sign}({weight})"}
        if draw(st.booleans()):
            entry |= {"model": "first_order", "tau": draw(st.sampled_from(["5 ms", "(j + 1) * ms"]))}
        if draw(st.booleans()):
            entry["delay"] = f"{draw(st.integers(0, 4)) * 50} ms"
        projections.append(entry)
    for neuron in data["neurons"].values():
        if draw(st.booleans()):
            neuron["description"] = draw(descriptions)
    read = {name: draw(values(size)) for name, size in sizes.items()}
    data["outputs"]["all"] = {"unit": "1", "readout": {**read, "g0[0]": 0.5}}
    extra = {"substeps": draw(st.integers(1, 20)), "seed": draw(st.integers(0, 99))}
    return data | extra | {"populations": groups, "projections": projections}


def circuit_texts() -> st.SearchStrategy[str]:
    """The text of a valid circuit file."""
    return circuit_data().map(dump_yaml)


def circuit_graphs() -> st.SearchStrategy[CircuitGraph]:
    """A resolved circuit."""
    return circuit_texts().map(parse_circuit)


def expression_trees(
    numbers: st.SearchStrategy[float], names: Iterable[str], max_leaves: int
) -> st.SearchStrategy[Expression]:
    """Trees of all operators and functions over these numbers and names."""
    return st.recursive(
        numbers.map(Number) | st.sampled_from(sorted(names)).map(Name),
        lambda inner: (
            st.builds(Unary, st.sampled_from("+-"), inner)
            | st.builds(Binary, st.sampled_from(BINARY_OPERATORS), inner, inner)
            | st.sampled_from(sorted(FUNCTION_ARITY)).flatmap(
                lambda name: st.tuples(*[inner] * FUNCTION_ARITY[name]).map(
                    lambda arguments: Call(name, arguments)
                )
            )
        ),
        max_leaves=max_leaves,
    )
