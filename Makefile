# Needs: python3 >= 3.11, make, and a package registry that pip can reach. Everything else is installed into .venv.
# Another interpreter: make setup PYTHON=python3.13

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
PEERS := .venv-peers
UV_VERSION := 0.13.9
COMPILE := out/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --fork-strategy fewest \
	--upgrade --no-annotate --custom-compile-command "make lock" --no-emit-index-url --no-emit-find-links

.DEFAULT_GOAL := help
.PHONY: help setup demo check test test-peers fuzz torture mutate bench docs lock clean

help:  ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1	\2/p' $(MAKEFILE_LIST) | expand -t 18

setup: $(READY)  ## a virtual environment in .venv with the locked packages and this checkout
	@echo "ready: $(BIN)/circuitkit --help"

# The stamp is written last: an interrupted set-up is begun anew, a finished one is not redone.
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed, $(PYTHON) is $$($(PYTHON) -V 2>&1); try: make $(or $(MAKECMDGOALS),setup) PYTHON=python3.13" >&2; exit 1; }
	@echo "setting up $(VENV) (once, about a minute)"
	@$(PYTHON) -m venv --clear $(VENV) || \
		{ echo "$(PYTHON) cannot make virtual environments; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

demo: $(READY)  ## draws the BiNN, pushes the walking NAO without and with it, drives a vehicle; films in out/demo
	$(BIN)/circuitkit validate binn_lateral
	$(BIN)/circuitkit draw binn_lateral -o out/demo/binn_lateral.png
	$(BIN)/circuitkit draw binn_lateral --what activations -o out/demo/binn_lateral_activations.png
	$(BIN)/circuitkit compare nao_push --controllers open_loop,circuit --video -o out/demo/nao_push
	$(BIN)/circuitkit simulate vehicle_avoids --video -o out/demo/vehicle_avoids
	@echo "the circuit:  out/demo/binn_lateral.png and binn_lateral_activations.png"
	@echo "the NAO:      out/demo/nao_push/video.mp4 and compare.png; a folder with plots and recordings for each controller"
	@echo "the vehicle:  out/demo/vehicle_avoids/video.mp4, path.png, channels.png, neurons.png"

check: $(READY)  ## style, types and the layers of packages
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

test: $(READY)  ## all tests
	$(BIN)/python -m pytest -n logical --maxprocesses 8 --dist loadfile

# The plugin of Nengo is made for an older pytest.
test-peers: $(PEERS)/.ready  ## our trajectories against those of Nengo and Brian2, which it installs into .venv-peers
	$(PEERS)/bin/python -m pytest tests/peers --peers -p no:nengo

$(PEERS)/.ready: requirements-peers.lock pyproject.toml
	$(PYTHON) -m venv --clear $(PEERS)
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-peers.lock
	$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

fuzz: $(READY)  ## spoilt files of every kind, for ten minutes or SECONDS=N, also those of CASES=DIR; what is found in out/fuzz/report.json
	PYTHONPATH=tests $(BIN)/python -m $(if $(GUIDED),fuzz.guided $(GUIDED),fuzz $(if $(CASES),--cases $(CASES)) --seconds) $(or $(SECONDS),600)

torture: $(READY)  ## kills at every write, full disks, closed pipes, clocks, planted files, dead workers
	$(BIN)/python -m pytest tests/torture --torture

mutate: $(READY)  ## changes the code itself, here and there, and counts which changes no test notices
	PYTHONPATH=tests $(BIN)/python -m mutate

bench: $(READY)  ## the benchmarks, as ratios in one run
	$(BIN)/circuitkit bench

docs: $(READY)  ## writes the pages and pictures under docs that are made from the code
	$(BIN)/python docs/generate.py

lock:  ## pins anew every dependency of pyproject.toml, for all platforms
	$(PYTHON) -m venv out/lock
	out/lock/bin/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)
	$(COMPILE) $(addprefix --extra ,cluster data dev mpc study test tune video) pyproject.toml --output-file requirements.lock
	$(COMPILE) $(addprefix --extra ,peers test) pyproject.toml --output-file requirements-peers.lock

clean:  ## removes the virtual environment, caches and results
	rm -rf $(VENV) $(PEERS) out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
