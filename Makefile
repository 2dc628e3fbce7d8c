# Two commands on a fresh machine: `make demo`, `make test`.  Only python3 (3.11 - 3.13, with venv) and make are assumed.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
TEST_STAMP := $(VENV)/.installed-test
LINT_STAMP := $(VENV)/.installed-lint
ARGS ?=

.PHONY: demo test lint install fuzz bench clean

demo: $(STAMP)
	@$(BIN)/pnfarm demo $(ARGS)

test: $(TEST_STAMP)
	@$(BIN)/python -m tests $(ARGS)

lint: $(LINT_STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

fuzz: $(TEST_STAMP)
	$(BIN)/python -m tests.fuzz $(ARGS)

bench: $(STAMP)
	$(BIN)/pnfarm bench $(ARGS)

install: $(STAMP)

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(STAMP): pyproject.toml | $(VENV)/bin/python
	@echo "Installing pnfarm into ./$(VENV) ..."
	$(BIN)/python -m pip install --quiet -e .
	@touch $@

$(TEST_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --group test
	# a foreign GSDML parser; what its package wants besides is for a server that no test starts
	$(BIN)/python -m pip install --quiet --no-deps --no-warn-conflicts industriagents-profinet-mcp
	# PI's schema of GSDML files stands in this package; its program wants an older pydantic, and no test runs it
	$(BIN)/python -m pip install --quiet --no-deps --no-warn-conflicts "uphy-upgen>=1.1,<2"
	@touch $@

$(LINT_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --group lint --group test
	@touch $@

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache
