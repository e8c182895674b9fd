# One virtual environment a purpose, each made from nothing but Python 3.11+ and make.
.DEFAULT_GOAL := help
.PHONY: help demo test lint check matrix docs bench bench-full torture fuzz cutting files hunt clean

# The first Python 3.11 or newer that really starts; PYTHON=... forces one.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin

help:  ## say what there is
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 12

demo: $(VENV)/demo.ready  ## three simulated drives, homed and moved at once, with live positions
	@$(BIN)/python -m compax_aio.cli.demo

test: $(VENV)/test.ready  ## all tests, and how much of the code they reach
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest
	$(BIN)/coverage report

lint: $(VENV)/check.ready  ## format, lint, types, import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

check: lint docs test  ## lint, docs, and all tests

docs: $(VENV)/check.ready  ## the documents, in docs/_build/html
	$(BIN)/sphinx-build -q -W --keep-going -b html docs docs/_build/html

matrix:  ## all tests on every CPython from 3.11 up that this machine has
	@$(PYTHON) .ci/matrix.py

bench:  ## what each thing costs, beside its target and what others take, in some minutes
	@$(MAKE) --no-print-directory VENV=.venv-bench .venv-bench/bench.ready
	@mkdir -p .bench
	@.venv-bench/bin/python -m benchmarks --json .bench/short.json

bench-full:  ## the same in longer rounds
	@$(MAKE) --no-print-directory VENV=.venv-bench .venv-bench/bench.ready
	@mkdir -p .bench
	@.venv-bench/bin/python -m benchmarks --full --json .bench/full.json

torture:  ## who gets whose answer after a time-out, here and with other libraries
	@$(MAKE) --no-print-directory VENV=.venv-bench .venv-bench/bench.ready
	@.venv-bench/bin/python -m benchmarks.torture

fuzz:  ## every parser with bytes that nobody thought of, FUZZ_S seconds each (60)
	@$(MAKE) --no-print-directory VENV=.venv-fuzz .venv-fuzz/fuzz.ready
	@.venv-fuzz/bin/python -m fuzz all -max_total_time=$(or $(FUZZ_S),60)

cutting: $(VENV)/test.ready  ## how much of the wire a cutting job of megabytes gets, by each handshake
	@$(BIN)/python -m benchmarks.cutting

files: $(VENV)/test.ready  ## programs of two megabytes to and from a simulated control, by each synchronisation
	@$(BIN)/python -m pytest -q --durations=8 tests/haas/test_whole_and_exact.py -k two_megabytes

hunt: $(VENV)/test.ready  ## whole applications in trouble, seed after seed, for HUNT_MINUTES (30); HUNT_DEVICE=smc
	@$(BIN)/python -m compax_aio.simulator.hunt --device $(or $(HUNT_DEVICE),compax) --minutes $(or $(HUNT_MINUTES),30)

clean:  ## forget the virtual environments and everything built
	rm -rf .bench .venv .venv-* build dist docs/_build .coverage .coverage.* .pytest_cache .mypy_cache .ruff_cache .hypothesis .fuzz

$(VENV)/pip.ready:
	@test -n "$(PYTHON)" || { echo "compax_aio needs Python 3.11 or newer; set PYTHON=/path/to/python3.11"; exit 1; }
	@echo "setting up $(VENV) with $$($(PYTHON) --version) (once)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	@touch $@

$(VENV)/demo.ready: $(VENV)/pip.ready pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[cli]'
	@touch $@

$(VENV)/test.ready: $(VENV)/demo.ready pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --group test
	@touch $@

$(VENV)/check.ready: $(VENV)/test.ready pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --group check
	@touch $@

$(VENV)/fuzz.ready: $(VENV)/pip.ready pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e . --group fuzz
	@touch $@

$(VENV)/bench.ready: $(VENV)/pip.ready pyproject.toml
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e . --group benchmarks
	@touch $@
