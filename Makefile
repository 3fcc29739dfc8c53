# Every target sets up .venv first; that is quick when nothing changed.
PYTHON ?= python3
BIN := .venv/bin
# One thread a process: the small matrices of the learner lose time with more.
export OPENBLAS_NUM_THREADS := 1

.PHONY: demo test lint bench bench-rig clean

demo: .venv
	$(BIN)/python -m scripts.demo

test: .venv lint
	$(BIN)/python -m pytest -n 2

lint: .venv
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

BENCHMARKS := clustering clustering_speed regression regression_intervals realtime theory convergence contact_states engines mujoco_rig

bench: .venv
	$(BIN)/pip install --quiet --editable ".[peers]" 2> .venv/install.log || (cat .venv/install.log; exit 1)
	for name in $(BENCHMARKS); do $(BIN)/python -m benchmarks.$$name --json out/benchmarks/$$name.json || exit 1; done

# Hundreds of insertions: about an hour. It can be interrupted and given again.
bench-rig: .venv
	$(BIN)/python -m benchmarks.rig.peers --jobs 2 --json out/benchmarks/rig_peers.json --figure out/benchmarks/rig_peers.svg
	$(BIN)/python -m benchmarks.rig.ablations --jobs 2 --json out/benchmarks/rig_ablations.json --figures out/benchmarks

.venv: .venv/ready
.venv/ready: pyproject.toml
	$(PYTHON) -m venv .venv
	@$(BIN)/pip install --quiet --upgrade pip 2> .venv/install.log || (cat .venv/install.log; exit 1)
	@# What the build back end remarks on is of no use to a newcomer, unless it fails.
	@$(BIN)/pip install --quiet --editable ".[dev]" 2> .venv/install.log || (cat .venv/install.log; exit 1)
	touch $@
.PHONY: .venv

clean:
	rm -rf out .venv
