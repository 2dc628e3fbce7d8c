# Two commands on a fresh machine: `make demo`, `make test`.  Only python3 (3.11 - 3.13, with venv) and make are assumed.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
TEST_STAMP := $(VENV)/.installed-test
LINT_STAMP := $(VENV)/.installed-lint
DOCS_STAMP := $(VENV)/.installed-docs
ARGS ?=
# `make LOCKED=1 test`: the packages of locks/, checked by hash, as in CI and the image; otherwise any that fit pyproject.toml
LOCKED ?=
LOCK := $(BIN)/python -m pip install --quiet --require-hashes -r locks
# Another GSDML parser, without its dependencies, which are for a server that no test starts; and the package that
# contains PI's schema of GSDML files, without its program, which needs an older pydantic and is not used.
# pyprofibus, a PROFIBUS master, has no need of what else its package asks for.
# cpppo, an EtherNet/IP client, wants a licence's checker that it does not need, and the greenery of its time.
# axe-playwright-python holds the rules of accessibility as one file, which a browser runs.
PEERS := "axe-playwright-python>=0.1.8,<1" "cpppo>=5.2.5,<6" "greenery>=2.1,<3" "industriagents-profinet-mcp" "pyprofibus>=1.13,<2" "uphy-upgen>=1.1,<2"
# An EtherNet/IP scanner whose package has the name of another one's.
APART := "cm-ethernetip<0.2"
UV := $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-annotate --custom-compile-command "make lock"

.PHONY: demo test lint docs install fuzz soak bench release-check lock clean

demo: $(STAMP)
	@$(BIN)/pnfarm demo $(ARGS)

test: $(TEST_STAMP)
	@$(BIN)/python -m tests $(ARGS)

lint: $(LINT_STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/mypy configs/pytest/test_async.py
	$(BIN)/lint-imports

# as a site in build/site; a link or an anchor that leads nowhere is an error
docs: $(DOCS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --clean

fuzz: $(TEST_STAMP)
	$(BIN)/python -m tests.fuzz $(ARGS)

soak: $(TEST_STAMP)
	$(BIN)/python -m tests.soak $(ARGS)

bench: $(STAMP)
	$(BIN)/pnfarm bench $(ARGS)

# docs/bench.md of today; a missed goal stands in it, and a row that others' load disturbed does not pass
release-check: $(STAMP)
	$(BIN)/pnfarm bench --markdown docs/bench.md || { code=$$?; [ $$code = 1 ] || [ $$code = 3 ]; }
	$(BIN)/python docs/release_check.py

install: $(STAMP)

ifdef LOCKED
$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(STAMP): pyproject.toml locks/ci.txt | $(VENV)/bin/python
	@echo "Installing pnfarm into ./$(VENV), as locks/ has it ..."
	$(LOCK)/ci.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(TEST_STAMP): $(STAMP) locks/peers.txt locks/apart.txt
	$(LOCK)/peers.txt --no-deps --no-warn-conflicts
	$(LOCK)/apart.txt --no-deps --upgrade --target $(VENV)/apart
	@touch $@

$(LINT_STAMP) $(DOCS_STAMP): $(STAMP)
	@touch $@
else
$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(STAMP): pyproject.toml | $(VENV)/bin/python
	@echo "Installing pnfarm into ./$(VENV) ..."
	$(BIN)/python -m pip install --quiet -e .
	@touch $@

$(TEST_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --group test
	$(BIN)/python -m pip install --quiet --no-deps --no-warn-conflicts $(PEERS)
	$(BIN)/python -m pip install --quiet --no-deps --upgrade --target $(VENV)/apart $(APART)
	@touch $@

$(LINT_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --group lint --group test
	@touch $@

$(DOCS_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --group docs
	@touch $@
endif

# Versions and hashes of everything that the image and CI install, for every supported Python, from a plain index.
lock: | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --group lock
	$(UV) pyproject.toml --group build --group docs --group lint --group test -o locks/ci.txt
	$(UV) pyproject.toml --extra postgres -c locks/ci.txt -o locks/runtime.txt
	$(UV) --group build -c locks/ci.txt -o locks/build.txt
	printf '%s\n' $(PEERS) | $(UV) --no-deps - -o locks/peers.txt
	printf '%s\n' $(APART) | $(UV) --no-deps - -o locks/apart.txt

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache
