"""What a circuit does, one neuron and one synapse after the other, in floats; written without the engine.

It reads the graph and follows `docs/engine.md`. Nothing here comes from `circuitkit.engine`; of the circuit
side it uses the values of expressions and, for exponential Euler, their derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from circuitkit.circuit.expressions.parsing import parse_expression
from circuitkit.circuit.expressions.symbolic import derivative
from circuitkit.circuit.graph import CircuitGraph

WORD = 2**64 - 1
PLAIN = parse_expression("weight * pre", ("weight", "pre"))


def normal(seed: int, stream: int, time: int) -> float:
    """The number that docs/engine.md defines."""

    def mix(z: int) -> int:
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & WORD
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB & WORD
        return z ^ (z >> 31)

    golden = 0x9E3779B97F4A7C15
    key = mix(mix((seed + golden) & WORD) ^ (stream * 0xD1342543DE82EF95 & WORD))
    b = mix((key + (time + 1) * golden) & WORD)
    c = mix(b ^ 0xD6E8FEB86659FD93)
    u, v = ((b >> 11) + 1) / 2**53, (c >> 11) / 2**53
    return math.sqrt(-2 * math.log(u)) * math.cos(2 * math.pi * v)


@dataclass
class Cell:
    """One neuron; `past` and `fine_past` are its outputs after every control step and every substep."""

    name: str
    node: str
    column: int
    model: object
    parameters: dict[str, float]
    states: dict[str, float]
    sigma: float
    activation: float = 0.0
    output: float = 0.0
    momentary: float = 0.0
    past: list[float] = field(default_factory=list)
    fine_past: list[float] = field(default_factory=list)
    old_states: dict[str, float] = field(default_factory=dict)

    def value(self, expression, **known: float) -> float:
        return float(expression.evaluate({**self.parameters, **self.states, **known}))


@dataclass
class Link:
    """Synapses that share states: one, or with `per: target` all those of a projection to one neuron."""

    model: object
    target: Cell
    sources: list[tuple[str, float]]
    parameters: dict[str, float]
    states: dict[str, float]
    delay_s: float
    gate: str
    rank: float
    total: float = 0.0  # delivered by the spikes of a control step

    def sees_spikes(self, cells: dict[str, Cell]) -> bool:
        """Whether it takes spikes one by one although its target is discrete."""
        source = cells.get(self.sources[0][0]) if self.sources else None
        spiking = source and source.model.continuous and "spike" in source.model.output.names()
        return bool(spiking and self.model.jumps and not self.target.model.continuous)

    @property
    def adds_up(self) -> bool:
        return not self.model.current.names().isdisjoint(("pre", "input"))


class Reference:
    """One copy of a circuit."""

    def __init__(self, graph: CircuitGraph, seed: int = 0) -> None:
        self.graph, self.seed, self.time = graph, seed, 0
        self.dt = graph.step_s / graph.substeps
        self.cells: dict[str, Cell] = {}
        for node in (*graph.neurons, *graph.populations):
            size = getattr(node, "size", None)
            for i in range(size or 1):
                name = node.name if size is None else f"{node.name}[{i}]"
                self.cells[name] = Cell(
                    name,
                    node.name,
                    len(self.cells),
                    node.model,
                    {key: _at(value, i) for key, value in node.parameters.items()},
                    {key: _at(value, i) for key, value in node.initial.items()},
                    _at(node.noise, i),
                )
        for cell in self.cells.values():
            if cell.model.states:
                cell.momentary = cell.value(cell.model.output, spike=0.0)
                counts = cell.model.continuous and "spike" in cell.model.output.names()
                cell.output = 0.0 if counts else cell.momentary
            cell.past, cell.fine_past = [cell.output], [cell.momentary]
        self.input_past: dict[str, list[float]] = {node.name: [0.0] for node in graph.inputs}
        self.links = sorted(self._make_links(), key=lambda link: link.rank)
        self.readout = {output.name: 0.0 for output in graph.outputs}
        self.nodes = [node.name for node in (*graph.neurons, *graph.populations)]
        self.reach = self._reachable()

    # --- who is connected with whom -----------------------------------------------------------------------

    def _make_links(self) -> Iterable[Link]:
        n = len(self.cells)
        ranks = {node.name: n + i for i, node in enumerate(self.graph.inputs)}
        ranks |= {name: cell.column for name, cell in self.cells.items()}
        last = n + len(self.graph.inputs)
        for i, s in enumerate(self.graph.synapses):
            plain = s.model.current == PLAIN and not s.model.states
            rank = ranks[s.source] if plain else last + i
            yield Link(
                s.model,
                self.cells[s.target],
                [(s.source, s.weight)],
                dict(s.parameters),
                dict(s.initial),
                s.delay_s,
                s.gate,
                rank,
            )
        last += len(self.graph.synapses)
        for p in self.graph.projections:
            last += 1
            targets, sources = self._members(p.target), self._members(p.source)
            for j, target in enumerate(targets):
                synapses = range(p.indptr[j], p.indptr[j + 1])
                shared = p.model.per == "target"
                for group in [list(synapses)] if shared else [[k] for k in synapses]:
                    place = j if shared else group[0]
                    yield Link(
                        p.model,
                        self.cells[target],
                        [(sources[p.sources[k]], _at(p.weights, k)) for k in group],
                        {key: _at(value, place) for key, value in p.parameters.items()},
                        {key: _at(value, place) for key, value in p.initial.items()},
                        p.delay_s,
                        p.gate,
                        last,
                    )

    def _members(self, name: str) -> list[str]:
        if name in self.input_past:
            return [name]
        return [cell.name for cell in self.cells.values() if cell.node == name]

    def _reachable(self) -> dict[str, set[str]]:
        """For every discrete node those that it leads to, by synapses and gates without delay."""
        edges: dict[str, set[str]] = {}
        for link in self.links:
            delayed = round(link.delay_s / self.graph.step_s) > 0
            seen = ([] if delayed else [name for name, _ in link.sources]) + (
                [link.gate] if link.gate else []
            )
            for name in seen:
                if (
                    name in self.cells
                    and not self.cells[name].model.continuous
                    and not link.target.model.continuous
                ):
                    edges.setdefault(self.cells[name].node, set()).add(link.target.node)
        reach = {}
        for node in self.nodes:
            found, todo = set(), [node]
            while todo:
                for other in edges.get(todo.pop(), ()):
                    if other not in found:
                        found.add(other)
                        todo.append(other)
            reach[node] = found
        return reach

    def _is_new(self, source: Cell, target: Cell) -> bool:
        """Under `ordered`, whether a discrete target sees this step's output of a discrete source."""
        in_a_cycle = source.node in self.reach[target.node]
        return not in_a_cycle or self.nodes.index(source.node) < self.nodes.index(target.node)

    # --- what a synapse sees ------------------------------------------------------------------------------

    def _seen(self, name: str, target: Cell, delay_s: float) -> float:  # noqa: PLR0911  # one a case
        steps = round(delay_s / self.graph.step_s)
        if name in self.input_past:
            return _back(self.input_past[name], steps)
        source = self.cells[name]
        if source.model.continuous and target.model.continuous:
            return _back(source.fine_past, round(delay_s / self.dt))
        if source.model.continuous:
            return _back(source.past, steps)
        if target.model.continuous:
            return source.output if steps == 0 else _back(source.past, steps - 1)
        if self.graph.timing == "ordered":
            if steps:
                return _back(source.past, steps - 1)
            if self._is_new(source, target):
                return self._evaluated(source).output
        return _back(source.past, steps)

    def _pre_state(self, name: str, target: Cell, state: str) -> float:
        source = self.cells[name]
        if source.model.continuous or target.model.continuous:
            return source.states[state]
        if self.graph.timing == "ordered" and self._is_new(source, target):
            return self._evaluated(source).states[state]
        return source.old_states[state]

    def _known(self, link: Link, *, newest: bool) -> dict[str, float]:
        """Values of all names of a synapse's expressions."""
        known = {**link.parameters, **link.states}

        def seen(name: str, delay_s: float) -> float:
            if not newest:
                return self._seen(name, link.target, delay_s)
            past = self.input_past.get(name) or [*self.cells[name].past, self.cells[name].output]
            return _back(past, round(delay_s / self.graph.step_s))

        known["input"] = sum(weight * seen(name, link.delay_s) for name, weight in link.sources)
        if len(link.sources) == 1:
            known["weight"], known["pre"] = link.sources[0][1], seen(link.sources[0][0], link.delay_s)
        target = link.target
        known["post"] = target.output if newest or not target.model.continuous else target.momentary
        if link.gate:
            known["gate"] = seen(link.gate, 0.0)
        for name in link.model.reads:
            side, _, state = name.partition("_")
            if side == "post":
                known[name] = target.states[state]
            elif newest:
                known[name] = self.cells[link.sources[0][0]].states[state]
            else:
                known[name] = self._pre_state(link.sources[0][0], target, state)
        return known

    # --- a control step -----------------------------------------------------------------------------------

    def tick(self, inputs: Mapping[str, float]) -> tuple[list[float], list[float], list[float]]:
        """Activations, outputs and the outputs of the circuit after one more control step."""
        for name, value in inputs.items():
            self.input_past[name].append(value)
        for cell in self.cells.values():
            cell.old_states = dict(cell.states)
        self._discrete_step([cell for cell in self.cells.values() if not cell.model.continuous])
        continuous = [cell for cell in self.cells.values() if cell.model.continuous]
        for cell in continuous:
            if "spike" in cell.model.output.names():
                cell.output = 0.0
        for i in range(self.graph.substeps):
            self._substep(continuous, self.time * self.graph.substeps + i)
        self._end()
        for cell in self.cells.values():
            cell.past.append(cell.output)
        self.time += 1
        cells = self.cells.values()
        return [c.activation for c in cells], [c.output for c in cells], list(self.readout.values())

    def _discrete_step(self, cells: list[Cell]) -> None:
        self._done: set[str] = set()
        if self.graph.timing == "ordered":
            for cell in cells:
                self._evaluated(cell)
            return
        new = {cell.name: self._arrived(cell, self.time) for cell in cells}
        for cell in cells:
            if self.graph.timing == "synchronous":
                cell.activation = new[cell.name]
            self._respond(cell)
            cell.activation = new[cell.name]

    def _evaluated(self, cell: Cell) -> Cell:
        """A discrete neuron under `ordered`, after its step; it asks those before it to do theirs."""
        if cell.node not in self._done:
            self._done.add(cell.node)
            members = [each for each in self.cells.values() if each.node == cell.node]
            arrived = [self._arrived(member, self.time) for member in members]
            for member, activation in zip(members, arrived, strict=True):
                member.activation = activation
                self._respond(member)
        return cell

    def _arrived(self, cell: Cell, time: int) -> float:
        """The new activation; jumps happen on the way."""
        total = 0.0
        for link in self.links:
            if link.target is cell and link.sees_spikes(self.cells) and link.adds_up:
                total += link.total
                link.total = 0.0
            elif link.target is cell and link.sees_spikes(self.cells):
                total += float(
                    link.model.current.evaluate({**self._known(link, newest=False), **link.states})
                )
            elif link.target is cell:
                known = self._known(link, newest=False)
                link.states.update(
                    {name: float(new.evaluate(known)) for name, new in link.model.jumps.items()}
                )
                total += float(link.model.current.evaluate({**known, **link.states}))
        if cell.sigma:
            scale = cell.sigma / math.sqrt(self.dt) if cell.model.continuous else cell.sigma
            total += scale * normal(self.seed, cell.column, time)
        return total

    def _respond(self, cell: Cell) -> None:
        """A discrete neuron: new states from old ones, spike and reset, output."""
        cell.states.update(
            {name: cell.value(new, A=cell.activation) for name, new in cell.model.updates.items()}
        )
        cell.output = self._spiked(cell)

    def _spiked(self, cell: Cell) -> float:
        spike, activation = 0.0, cell.activation
        if cell.model.spike is not None and cell.value(cell.model.spike.when, A=activation) > 0:
            spike = 1.0
            cell.states.update(
                {k: cell.value(new, A=activation) for k, new in cell.model.spike.reset.items()}
            )
        return cell.value(cell.model.output, A=activation, spike=spike)

    def _substep(self, cells: list[Cell], time: int) -> None:
        before = {cell.name: dict(cell.states) for cell in cells}
        known = [
            self._known(link, newest=False) if link.target.model.continuous else {} for link in self.links
        ]
        for cell in cells:
            cell.activation = self._arrived(cell, time)
        links = [(link, k) for link, k in zip(self.links, known, strict=True) if link.target.model.continuous]
        for link, k in links:
            if link.model.derivatives:
                link.states = self._advanced(link.model, {**k, **link.states}, link.states, self.dt)
        self._advance_counting()
        moved = self._runge_kutta([cell for cell in cells if cell.model.method == "rk4"])
        for cell in cells:
            if cell.model.method != "rk4":
                values = {**cell.parameters, **cell.states, "A": cell.activation}
                moved[cell.name] = self._advanced(cell.model, values, cell.states, self.dt)
        assert all(cell.states == before[cell.name] for cell in cells)
        for cell in cells:
            cell.states = moved[cell.name]
        for cell in cells:
            cell.momentary = self._spiked(cell)
            counts = "spike" in cell.model.output.names()
            cell.output = cell.output + cell.momentary if counts else cell.momentary
            cell.fine_past.append(cell.momentary)
        self._take_spikes()

    def _advance_counting(self) -> None:
        for link in self.links:
            if link.sees_spikes(self.cells) and link.model.derivatives:
                k = {**self._spike_known(link, 1), **link.states}
                link.states = self._advanced(link.model, k, link.states, self.dt)

    def _take_spikes(self) -> None:
        for link in self.links:
            if not link.sees_spikes(self.cells):
                continue
            known = self._spike_known(link, 0)
            link.states.update({name: float(new.evaluate(known)) for name, new in link.model.jumps.items()})
            if link.adds_up:
                link.total += float(link.model.current.evaluate({**known, **link.states}))

    def _spike_known(self, link: Link, before: int) -> dict[str, float]:
        """Values of all names, those of the source in a substep: `before` its end, a delay is one shorter."""
        known = self._known(link, newest=False)
        age = round(link.delay_s / self.graph.step_s) * self.graph.substeps
        age = age - before if age else 0
        pre = [(weight, _back(self.cells[name].fine_past, age)) for name, weight in link.sources]
        known["input"] = sum(weight * value for weight, value in pre)
        if len(pre) == 1:
            known["weight"], known["pre"] = pre[0]
        return known

    def _end(self) -> None:
        updates = []
        for link in self.links:
            counts = link.sees_spikes(self.cells)
            if link.model.derivatives and not link.target.model.continuous and not counts:
                known = self._known(link, newest=True)
                link.states = self._advanced(link.model, known, link.states, self.graph.step_s)
        for link in self.links:
            known = self._known(link, newest=True) if link.model.updates else {}
            updates.append({name: float(new.evaluate(known)) for name, new in link.model.updates.items()})
        for link, new in zip(self.links, updates, strict=True):
            link.states.update(new)
        for output in self.graph.outputs:
            total = 0.0
            for name, weight in output.readout:
                members = [name] if name in self.cells else self._members(name)
                total += sum(_at(weight, i) * self.cells[each].output for i, each in enumerate(members))
            if output.leak is not None:
                total += (1 - output.leak) * self.readout[output.name]
            self.readout[output.name] = min(max(total, output.low), output.high)

    # --- the methods --------------------------------------------------------------------------------------

    def _advanced(self, model, values: Mapping[str, float], states: Mapping[str, float], dt: float) -> dict:
        names = list(model.derivatives)

        def slopes(x: Iterable[float]) -> np.ndarray:
            known = {**values, **dict(zip(names, x, strict=True))}
            return np.array([float(model.derivatives[name].evaluate(known)) for name in names])

        x = np.array([states[name] for name in names])
        if model.method == "exact":
            constant = slopes(np.zeros(len(x)))
            jacobian = np.array([slopes(unit) - constant for unit in np.eye(len(x))]).T
            extended = np.block([[jacobian, constant[:, np.newaxis]], [np.zeros((1, len(x) + 1))]])
            x = (expm(extended * dt) @ np.append(x, 1.0))[:-1]
        elif model.method == "rk4":
            k1 = slopes(x)
            k2 = slopes(x + dt / 2 * k1)
            k3 = slopes(x + dt / 2 * k2)
            k4 = slopes(x + dt * k3)
            x = x + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        elif model.method == "exponential_euler":
            z = [dt * derivative(model.derivatives[n], n).evaluate(values) for n in names]
            x = x + dt * np.array([math.expm1(v) / v if v else 1.0 for v in z]) * slopes(x)
        else:
            x = x + dt * slopes(x)
        return {**states, **dict(zip(names, x.tolist(), strict=True))}

    def _runge_kutta(self, cells: list[Cell]) -> dict[str, dict[str, float]]:
        """All rk4 neurons together; what plain synapses among them bring follows the states tried."""
        names = {cell.name for cell in cells if "spike" not in cell.model.output.names()}
        among = [
            link
            for link in self.links
            if link.target.model.continuous
            and link.model.current == PLAIN
            and not link.model.states
            and round(link.delay_s / self.dt) == 0
            and all(name in names for name, _ in link.sources)
        ]
        first = {cell.name: dict(cell.states) for cell in cells}

        def slopes(states: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
            output = {n: self.cells[n].value(self.cells[n].model.output, **states[n]) for n in names}
            if states is first:
                output = {n: self.cells[n].momentary for n in names}
            activation = {cell.name: cell.activation for cell in cells}
            for link in among:
                for source, weight in link.sources:
                    if link.target.name in activation:
                        change = output[source] - self.cells[source].momentary
                        activation[link.target.name] += weight * change
            return {
                cell.name: {
                    key: cell.value(slope, **states[cell.name], A=activation[cell.name])
                    for key, slope in cell.model.derivatives.items()
                }
                for cell in cells
            }

        def moved(k: dict[str, dict[str, float]], h: float) -> dict[str, dict[str, float]]:
            return {n: {**s, **{key: s[key] + h * k[n][key] for key in k[n]}} for n, s in first.items()}

        k1 = slopes(first)
        k2 = slopes(moved(k1, self.dt / 2))
        k3 = slopes(moved(k2, self.dt / 2))
        k4 = slopes(moved(k3, self.dt))
        mean = {
            n: {key: (k1[n][key] + 2 * (k2[n][key] + k3[n][key]) + k4[n][key]) / 6 for key in k1[n]}
            for n in first
        }
        return moved(mean, self.dt)


def _at(values, i: int) -> float:
    array = np.asarray(values, dtype=float)
    return float(array if array.ndim == 0 else array[i])


def _back(values: list[float], steps: int) -> float:
    """The value so many steps before the last; before the first it was as at the start."""
    return values[max(len(values) - 1 - steps, 0)]
