"""Models that an author declares: what is read from them, and what is said about mistakes in them."""

from __future__ import annotations

import pytest

from circuitkit.base.errors import InputError
from circuitkit.base.source import Document, parse_yaml
from circuitkit.base.units import Dimension, parse_unit
from circuitkit.circuit import parse_circuit
from circuitkit.circuit.models import read_neuron_model, read_synapse_model, synapse_model
from circuitkit.circuit.models.model import UnitRule
from circuitkit.circuit.models.writing import model_data

NEURON = """\
neuron_models:
  relay:
    description: fires, and tires
    activation: nA
    parameters:
      tau: {unit: ms, default: 20 ms}
      rest: {unit: mV}
      top: {unit: mV, default: -40 mV}
      gain: {unit: V/activation, default: 0}
    increasing: [rest, top]
    states:
      v: {unit: mV, initial: rest}
      w: {unit: 1}
    derivatives:
      v: (rest - v) / tau + w * (top - v) / tau
      w: -w / tau
    spike:
      when: v > top
      reset: {v: rest, w: w + 1}
    method: exponential_euler
    output: spike
"""
SYNAPSE = """\
synapse_models:
  slow:
    weight: activation/source/V
    sign: positive
    parameters:
      tau: {unit: s}
      e: {unit: mV, default: 5 mV}
      half: {unit: source}
    states:
      g: {unit: weight*source, initial: weight * half}
    jumps:
      g: g + weight * pre
    derivatives:
      g: -g / tau
    updates:
      g: clip(g, 0, weight * half)
    reads: {post_v: mV}
    current: g * (e - post_v) * gate
"""


def test_a_neuron_model_is_what_its_file_says():
    model = read_neuron_model(parse_yaml(NEURON, "f.yaml"), ("neuron_models", "relay"))
    assert (model.name, model.description, model.source) == ("relay", "fires, and tires", "")
    assert model.activation == parse_unit("nA")
    assert [each.default for each in model.parameters] == [0.02, None, -0.04, 0.0]
    assert [each.unit and str(each.unit) for each in model.parameters] == ["ms", "mV", "mV", None]
    assert model.increasing == ("rest", "top")
    assert [(each.name, str(each.initial), str(each.unit)) for each in model.states] == [
        ("v", "rest", "mV"),
        ("w", "0", "1"),
    ]
    assert str(model.derivatives["v"]) == "(rest - v) / tau + w * (top - v) / tau"
    assert (str(model.spike.when), str(model.spike.reset["w"])) == ("v > top", "w + 1")
    assert (model.method, model.continuous, str(model.output)) == ("exponential_euler", True, "spike")


def test_a_synapse_model_is_what_its_file_says():
    model = read_synapse_model(parse_yaml(SYNAPSE, "f.yaml"), ("synapse_models", "slow"))
    volt = parse_unit("V").dimension
    assert model.weight == UnitRule("activation/source/V", Dimension().times(volt, -1), 1, -1)
    assert model.weight.dimension(activation=parse_unit("A").dimension) == parse_unit("S").dimension
    assert model.states[0].unit_rule == UnitRule("weight*source", source=1, weight=1)
    assert (model.sign, model.per, model.gated) == ("positive", "synapse", True)
    assert {name: str(each) for name, each in model.jumps.items()} == {"g": "g + weight * pre"}
    assert model.reads == {"post_v": UnitRule("mV", volt)}


def test_equal_declarations_are_equal_models():
    first = read_neuron_model(parse_yaml(NEURON), ("neuron_models", "relay"))
    moved = read_neuron_model(parse_yaml("# a comment\n" + NEURON), ("neuron_models", "relay"))
    other = read_neuron_model(
        parse_yaml(NEURON.replace("-w / tau", "-2 * w / tau")), ("neuron_models", "relay")
    )
    assert first == moved
    assert first != other
    assert hash(first) == hash(moved)


def complaints(text: str, old: str, new: str) -> tuple[list[str], str]:
    """What is said about the text with a change in it, and the text."""
    assert old in text
    changed = text.replace(old, new, 1)
    document = parse_yaml(changed, "f.yaml")
    read, section = (
        (read_neuron_model, "neuron_models") if text is NEURON else (read_synapse_model, "synapse_models")
    )
    (name,) = document.data[section]
    with pytest.raises(InputError) as caught:
        read(document, (section, name))
    return [str(problem) for problem in caught.value.problems], changed


def place(text: str, at: str) -> str:
    """Line and column of the mark in a snippet that occurs once."""
    before, _, behind = at.partition("¦")
    position = text.index(before + behind) + len(before)
    line = text.count("\n", 0, position) + 1
    return f"f.yaml:{line}:{position - text.rfind(chr(10), 0, position)}"


def rows(table: str) -> list[list[str]]:
    """What stands in a base file, what takes its place, the place of the complaint, and the complaint."""
    return [line.replace("\\n", "\n").split(" ‖ ") for line in table.splitlines()]


NEURON_MISTAKES = rows("""\
-w / tau ‖ -w / tua ‖ -w / ¦tua ‖ derivatives.w: unknown name 'tua'; allowed: A, dt, gain, rest, tau, top, v, w; did you mean 'tau'?
-w / tau ‖ -w / tau) ‖ -w / tau¦) ‖ derivatives.w: cannot read the expression '-w / tau)'; allowed: numbers, names, + - * / ^ < <= > >= and or not, and functions
-w / tau ‖ -w / tau / 0 + 1 / 0 / tau ‖ + ¦1 / 0 ‖ derivatives.w: found '1 / 0', which has no value (float division by zero); allowed: a finite number
-w / tau ‖ -w / tau * 9^9^9^9 ‖ * ¦9^9 ‖ derivatives.w: found '9 ** 9 ** 9 ** 9', which has no value (math range error); allowed: a finite number
-w / tau ‖ -w * tau ‖ w: ¦-w * tau ‖ derivatives.w: found '-w * tau', which is s; allowed: 1/s
w * (top - v) ‖ w * (top - tau) ‖ (¦top - tau) ‖ derivatives.v: found 'top - tau', which joins V and s; allowed: the same on all sides
      w: -w ‖       q: -w ‖       ¦q: -w ‖ derivatives.q: unknown state 'q'; allowed: v, w
w: w + 1} ‖ w: w + rest} ‖ w: ¦w + rest ‖ spike.reset.w: found 'w + rest', which joins a plain number and V; allowed: the same on all sides
w: w + 1} ‖ x: w + 1} ‖ ¦x: w + 1 ‖ spike.reset.x: unknown state 'x'; allowed: v, w
when: v > top ‖ when: A > top ‖ when: ¦A > top ‖ spike.when: unknown name 'A'; allowed: gain, rest, tau, top, v, w
output: spike ‖ output: v ‖ output: ¦v ‖ output: found 'v', which is V; allowed: a plain number
output: spike ‖ output: gain * A ‖ output: gain * ¦A ‖ output: unknown name 'A'; allowed: gain, rest, spike, tau, top, v, w
initial: rest ‖ initial: 20 ‖ initial: ¦20 ‖ states.v.initial: found '20', which is a plain number; allowed: V
initial: rest ‖ initial: w ‖ initial: ¦w ‖ states.v.initial: unknown name 'w'; allowed: gain, rest, tau, top
default: 20 ms ‖ default: 20 mV ‖ default: ¦20 mV ‖ parameters.tau.default: found 20 mV; allowed: a quantity in ms, or 0
default: 20 ms ‖ default: 20 ‖ default: ¦20 ‖ parameters.tau.default: found 20; allowed: a quantity in ms, or 0
default: 20 ms ‖ default: 20 msec ‖ default: ¦20 msec ‖ parameters.tau.default: unknown unit 'msec'
unit: V/activation ‖ unit: V/activaton ‖ unit: ¦V/activaton ‖ parameters.gain.unit: unknown unit 'activaton'; allowed: a unit, or activation; did you mean 'activation'?
unit: V/activation ‖ unit: V/source ‖ unit: ¦V/source ‖ parameters.gain.unit: unknown unit 'source'
unit: V/activation ‖ unit: V/activation/x/y ‖ unit: ¦V ‖ parameters.gain.unit: unknown unit 'x'
activation: nA ‖ activation: activation/s ‖ activation: ¦activation/s ‖ activation: found 'activation/s'; allowed: a unit such as nA
[rest, top] ‖ [rest, tpo] ‖ [rest, ¦tpo] ‖ increasing[1]: unknown parameter 'tpo'; allowed: tau, rest, top, gain; did you mean 'top'?
[rest, top] ‖ [rest, tau] ‖ [rest, ¦tau] ‖ increasing[1]: found rest in V and tau in s; allowed: parameters of the same dimension
      gain: ‖       exp: ‖       ¦exp: ‖ parameters.exp: found a parameter 'exp', which means something else in models; allowed: other names
      gain: ‖       role: ‖       ¦role: ‖ parameters.role: found a parameter 'role', which means something else in models; allowed: other names
      gain: ‖       lambda: ‖       ¦lambda: ‖ parameters.lambda: found a parameter 'lambda', which means something else in models; allowed: other names
      gain: ‖       a-b: ‖       ¦a-b: ‖ parameters.a-b: found 'a-b'; allowed: a name of letters, digits and _, not starting with a digit
      w: {unit: 1} ‖       top: {unit: 1} ‖       ¦top: {unit: 1} ‖ states.top: found a state 'top', which is a parameter already; allowed: other names
method: exponential_euler ‖ method: exact ‖ v: ¦(rest - v) / tau ‖ derivatives.v: found exact, but its slope by v is -(1 / tau) - w / tau, which varies; allowed: exact for linear derivatives, else exponential_euler or rk4
method: exponential_euler ‖ method: rk5 ‖ method: ¦rk5 ‖ method: found 'rk5'; allowed: euler, exponential_euler, exact, rk4; did you mean 'rk4'?
    derivatives: ‖     derivative: ‖     ¦derivative: ‖ derivative: unknown key 'derivative'; allowed: activation, derivatives, description, increasing, method, model, output, parameters, source, spike, states, updates; did you mean 'derivatives'?
    derivatives: ‖     updates: ‖     ¦spike: ‖ spike: found a spike without derivatives; allowed: in continuous models
    spike: ‖     updates: {w: 0}\\n    spike: ‖ updates: ¦{w: 0} ‖ updates: found derivatives and updates; allowed: one of them: derivatives for a continuous model, updates for one that changes once a control step
    output: spike\\n ‖  ‖   ¦relay: ‖ missing key 'output'; required: output
""")  # noqa: E501 - a message is one line
SYNAPSE_MISTAKES = rows("""\
weight * pre ‖ wieght * pre ‖ g + ¦wieght ‖ jumps.g: unknown name 'wieght'; allowed: e, g, gate, half, post, post_v, pre, tau, weight; did you mean 'weight'?
(e - post_v) ‖ (e - pre) ‖ (¦e - pre) ‖ current: found 'e - pre', which joins V and source; allowed: the same on all sides
g * (e - post_v) ‖ g ‖ current: ¦g ‖ current: found 'g * gate', which is activation/V; allowed: activation
(e - post_v) ‖ (e - post_u) ‖ (e - ¦post_u) ‖ current: unknown name 'post_u'; allowed: e, g, gate, half, post, post_v, pre, tau, weight; did you mean 'post_v'?
clip(g, 0, weight * half) ‖ clip(g, 0, weight) ‖ g: ¦clip ‖ updates.g: found 'clip(g, 0, weight)', which joins activation/V and activation/source/V; allowed: the same on all sides
{post_v: mV} ‖ {target_v: mV} ‖ {¦target_v ‖ reads.target_v: found 'target_v'; allowed: pre_NAME, post_NAME of a state
sign: positive ‖ sign: plus ‖ sign: ¦plus ‖ sign: found 'plus'; allowed: role, positive, any
weight: activation/source/V ‖ weight: activation/mV ‖ weight: ¦activation/mV ‖ weight: found 'activation/mV'; allowed: units without a prefix beside activation, such as s or V
weight: activation/source/V ‖ weight: weight ‖ weight: ¦weight ‖ weight: unknown unit 'weight'
      half: { ‖       to: { ‖       ¦to: { ‖ parameters.to: found a parameter 'to', which means something else in models; allowed: other names
    parameters: ‖     per: target\\n    parameters: ‖ g + ¦weight * pre ‖ jumps.g: unknown name 'weight'; allowed: e, g, gate, half, input, post, post_v, tau
""")  # noqa: E501 - a message is one line


@pytest.mark.parametrize(("old", "new", "at", "message"), NEURON_MISTAKES, ids=lambda text: text[:25])
def test_what_is_wrong_with_a_neuron_model_is_named_with_its_place(old, new, at, message):
    found, text = complaints(NEURON, old, new)
    where = "neuron_models.relay: " if message.startswith("missing") else "neuron_models.relay."
    assert [each for each in found if each.startswith(f"{place(text, at)}: {where}{message}")], found


@pytest.mark.parametrize(("old", "new", "at", "message"), SYNAPSE_MISTAKES, ids=lambda text: text[:25])
def test_what_is_wrong_with_a_synapse_model_is_named_with_its_place(old, new, at, message):
    found, text = complaints(SYNAPSE, old, new)
    assert [each for each in found if each.startswith(f"{place(text, at)}: synapse_models.slow.{message}")], (
        found
    )


def test_every_mistake_is_named_at_once_and_in_order():
    text = NEURON.replace("default: 20 ms", "default: 20 mV").replace("-w / tau", "-w / tua")
    with pytest.raises(InputError) as caught:
        read_neuron_model(parse_yaml(text, "f.yaml"), ("neuron_models", "relay"))
    assert [problem.line for problem in caught.value.problems] == [6, 16]


def test_an_unknown_unit_is_named_once():
    """Equations with the parameter are not complained about on top."""
    found, _ = complaints(NEURON, "tau: {unit: ms, default: 20 ms}", "tau: {unit: mss}")
    assert len(found) == 1


def test_a_model_that_cannot_change_is_refused():
    text = "m: {output: v, states: {v: {unit: 1}}}"
    with pytest.raises(
        InputError, match="found states without derivatives or updates; allowed: states that change"
    ):
        read_neuron_model(parse_yaml(text), ("m",))


def test_the_shortest_model():
    model = read_neuron_model(parse_yaml("half: {output: 0.5}"), ("half",))
    assert (model.name, model.output.evaluate({}), model.continuous) == ("half", 0.5, False)


def test_equations_may_have_quantities():
    text = """m:
  activation: nA
  states: {v: {unit: mV, initial: -65 mV}}
  derivatives: {v: (-65 mV - v + 10 Mohm * A) / 20 ms * exp(-(v + 40 mV) / 5 mV)}
  output: sigmoid((v + 50 mV) * 0.2 /mV)
"""
    model = read_neuron_model(parse_yaml(text), ("m",))
    assert model.states[0].initial.evaluate({}) == -0.065
    assert model.derivatives["v"].evaluate({"v": -0.04, "A": 2.5e-9}) == 0
    assert model.output.evaluate({"v": -0.05}) == 0.5
    assert read_neuron_model(Document("", {"m": model_data(model)}, {}), ("m",)) == model
    with pytest.raises(InputError) as caught:
        read_neuron_model(parse_yaml(text.replace("50 mV", "50 ms"), "f.yaml"), ("m",))
    assert str(caught.value) == (
        "f.yaml:5:20: m.output: found 'v + 50 ms', which joins V and s; allowed: the same on all sides"
    )


def test_equations_in_quotes_have_their_columns():
    text = 'm:\n  output: "1 + tanH(0)"\n'
    with pytest.raises(InputError) as caught:
        read_neuron_model(parse_yaml(text, "f.yaml"), ("m",))
    assert caught.value.problems[0].column == text.splitlines()[1].index("tanH") + 1


@pytest.mark.parametrize(
    ("current", "plain"),
    [("weight * pre", False), ("weight * pre * (pre > 0)", False), ("weight * pre * (1 - pre)", True)],
)
def test_a_model_is_for_plain_sources_if_it_fits_no_others(current, plain):
    model = read_synapse_model(parse_yaml(f"m: {{current: {current}}}"), ("m",))
    assert model.plain_source == plain


@pytest.mark.parametrize("name", ["depressing_facilitating", "hebbian", "exponential"])
def test_shipped_synapses_take_sources_of_any_unit(name):
    assert not synapse_model(name).plain_source


@pytest.mark.parametrize(
    ("unit", "value", "output", "shown"),
    [
        ("activation/s", "3 mm/s", "tanh(A / (pace * tau))", "m"),
        ("s/activation", "2 s/mV", "tanh(A * pace / tau)", "V"),
    ],
)
def test_a_parameter_of_several_units_implies_that_of_the_activation(unit, value, output, shown):
    """Of mm/s, which is activation/s, the activation is a length."""
    graph = parse_circuit(
        f"""\
circuit: c
control_step: 10 ms
timing: ordered
neuron_models:
  fading:
    parameters: {{pace: {{unit: {unit}}}, tau: {{unit: s, default: 1 s}}}}
    output: {output}
neurons:
  n: {{model: fading, role: excitatory, pace: {value}}}
outputs: {{y: {{unit: "1", readout: {{n: 1}}}}}}
"""
    )
    assert graph.neurons[0].activation_unit.symbol == shown
