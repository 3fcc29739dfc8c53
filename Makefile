# Every target sets up .venv first; that is quick when nothing changed.
PYTHON ?= python3
BIN := .venv/bin
# One thread a process: the small matrices of the learner lose time with more.
export OPENBLAS_NUM_THREADS := 1

.PHONY: demo test lint bench clean

demo: .venv
	$(BIN)/python -m scripts.demo

test: .venv lint
	$(BIN)/python -m pytest -n 2

lint: .venv
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

.venv: .venv/ready
.venv/ready: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable ".[dev]"
	touch $@
.PHONY: .venv

clean:
	rm -rf out .venv
