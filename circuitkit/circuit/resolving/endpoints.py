"""What synapses and readouts can be attached to: inputs, neurons, populations and their members."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from circuitkit.base.source import Place
from circuitkit.base.units import DIMENSIONLESS, Unit
from circuitkit.circuit.graph import InputNode, Neuron, Population, Role
from circuitkit.circuit.models import NeuronModel
from circuitkit.circuit.resolving.items import Item
from circuitkit.circuit.resolving.scope import Located, Scope


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One end of a synapse or projection.

    Attributes:
        name: Its name in the whole circuit.
        unit: The unit of what it sends out: that of an input; outputs of neurons have none.
        role: Of a neuron; None for an input.
        model: Of a neuron; None for an input.
        activation: Unit of a neuron's activation; None for an input.
        size: Number of members.
        is_population: Whether it is a whole population.
    """

    name: str
    unit: Unit
    role: Role | None = None
    model: NeuronModel | None = None
    activation: Unit = DIMENSIONLESS
    size: int = 1
    is_population: bool = False


@dataclass
class Nodes:
    """The nodes of a circuit that could be resolved, by their names in the whole circuit."""

    inputs: dict[str, InputNode] = field(default_factory=dict)
    neurons: dict[str, Neuron] = field(default_factory=dict)
    populations: dict[str, Population] = field(default_factory=dict)
    _endpoints: dict[str, Endpoint] = field(default_factory=dict)

    def endpoint(self, name: str) -> Endpoint | None:
        """Return an input, neuron or population by its name in the whole circuit; None if it is unsound."""
        if name not in self._endpoints:
            if name in self.neurons:
                neuron = self.neurons[name]
                end = Endpoint(name, DIMENSIONLESS, neuron.role, neuron.model, neuron.activation_unit)
            elif name in self.inputs:
                end = Endpoint(name, self.inputs[name].unit)
            elif name in self.populations:
                each = self.populations[name]
                unit = each.activation_unit
                end = Endpoint(
                    name, DIMENSIONLESS, each.role, each.model, unit, each.size, is_population=True
                )
            else:
                return None
            self._endpoints[name] = end
        return self._endpoints[name]

    def located(
        self, scope: Scope, item: Item[Any], place: Place, located: Located, *, at_key: bool = False
    ) -> Endpoint | None:
        """Find what a name stands for; None if it is unsound, or after complaining about a missing member."""
        if located.kind != "member":
            return self.endpoint(located.name)
        population = self.populations.get(located.name.rpartition("[")[0])
        if population is None:
            return None
        if located.member >= population.size:
            allowed = f"{population.name}[0] to {population.name}[{population.size - 1}]"
            found = f"found '{located.name}', but the population has {population.size} members"
            scope.errors.append(item.problem(place, f"{found}; allowed: {allowed}", at_key=at_key))
            return None
        unit = population.activation_unit
        return Endpoint(located.name, DIMENSIONLESS, population.role, population.model, unit)
