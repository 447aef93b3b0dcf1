# Everything runs in a virtual environment of its own, .venv; python3 (>= 3.11), make and the package registries suffice.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# the commands that tests start are compiled once
export PYTHONDONTWRITEBYTECODE :=
# mkdocs-material's advertisement for its successor
export NO_MKDOCS_2_WARNING := 1

.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-firmware mutations results outcomes budgets coverage check docs format study clean constraints version tag dist

help:  ## show what can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | awk -F'\t' '{printf "  make %-13s %s\n", $$1, $$2}'

$(VENV)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "python3 >= 3.11 is needed, $$($(PYTHON) --version) was found: make PYTHON=python3.12"; exit 2; }
	@$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/demo: $(VENV)/python pyproject.toml lab/pyproject.toml
	@echo "installing kmpc_lite with its pictures ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bridge]' -e './lab[plot]'
	@touch $@

$(VENV)/dev: $(VENV)/python pyproject.toml lab/pyproject.toml
	@echo "installing kmpc_lite with all that its tests need ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[bridge,logs,ros2-test,docs,dev]' -e './lab[plot,twin,peers,cluster,clients]'
	@touch $@ $(VENV)/demo $(VENV)/docs

$(VENV)/docs: $(VENV)/python pyproject.toml lab/pyproject.toml
	@echo "installing kmpc_lite with what builds its documentation ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[docs,bridge]' -e ./lab
	@touch $@

demo: $(VENV)/demo  ## learn from a drive of the emulated rover, drive it past four obstacles, end in a report: out/report.html; LOG=run.csv: from your robot's log, on a map for its speed
	@$(BIN)/kmpc demo $(if $(LOG),--log $(LOG)) --output out

check: $(VENV)/dev  ## style, types, import rules, budgets and the documentation's build
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python .ci/budgets.py
	$(BIN)/mkdocs build --strict --quiet

docs: $(VENV)/docs  ## the documentation as a site, a warning being an error: out/site/index.html
	@$(BIN)/mkdocs build --strict --quiet
	@echo "wrote out/site/index.html"

test: check  ## check, then doctests, README, documentation, examples and all tests but the long ones
	$(BIN)/python -m pytest -n auto --timeout 240 -m "not long" $(ARGS)

coverage: $(VENV)/dev  ## the same tests, and which lines none of them runs
	$(BIN)/python -m pytest -n auto -m "not long" --cov --cov-report=term-missing:skip-covered $(ARGS)

test-long: $(VENV)/dev  ## the tests that take minutes
	$(BIN)/python -m pytest -m long $(ARGS)

results: $(VENV)/dev  ## run the commands above the tables of docs/results again (an hour); ARGS="table1 jumps": those that hold a word
	@$(BIN)/python .ci/results.py $(ARGS)

mutations: $(VENV)/dev  ## mutate 30 lines (gate, safe motion, margins, CRC, scaling, units, fit): each must turn a test red
	@$(BIN)/python .ci/mutations.py

test-firmware: $(VENV)/demo  ## exported controllers on this machine, aarch64 and Cortex-M in QEMU: vectors, memory, instructions a step
	@$(BIN)/python .ci/firmware.py

outcomes: $(VENV)/dev  ## every outcome drive with ten seeds: contacts, arrivals, times (half an hour)
	PYTHONPATH=.:lab:tests $(BIN)/python -m outcomes check --seeds 10 $(ARGS)

budgets: $(VENV)/dev  ## lines, files, numbers, states, words and functions reached by a step, beside what they may be
	@$(BIN)/python .ci/budgets.py

version:  ## the version, the same everywhere; V=0.4.0.dev0 sets it
	@$(PYTHON) .ci/release.py version $(V)

tag:  ## tag the commit as a release, if version, changelog and work tree say that it is one
	@$(PYTHON) .ci/release.py tag

dist: $(VENV)/python  ## sdists and wheels of both distributions, checked: dist/; URL=https://HOST/OWNER/REPOSITORY
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check build twine
	@$(BIN)/python .ci/release.py dist $(URL)

constraints: $(VENV)/dev  ## note the versions of all packages that the tests have passed with: constraints.txt
	@{ echo "# Versions of all packages with which the tests of this version pass (x86-64 Linux, Python 3.11)."; \
	  echo "# Made by: make constraints"; $(BIN)/python -m pip freeze --exclude-editable; } > constraints.new
	@mv constraints.new constraints.txt

format: $(VENV)/dev  ## put the code into the project's layout
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

study: $(VENV)/dev  ## the paper's table 1 beside ours
	@$(BIN)/kmpc study table1

clean:  ## remove what was installed and made here
	rm -rf $(VENV) out build dist *.egg-info lab/build lab/*.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache .coverage
	find kmpc_lite firmware_bridge lab tests examples -name __pycache__ -prune -exec rm -rf {} +
