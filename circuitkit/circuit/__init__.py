"""The circuit language: YAML text to `CircuitSpec` to `CircuitGraph`, and the neuron models.

Read in the order in which the data flows: `load` (file to spec), `spec` (the file's own terms), `resolve`
(spec to graph, with every check on the way), `graph` (what everything else reads), `models` and `expression`
(what a neuron does).
"""
