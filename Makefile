# Two commands on a fresh machine: `make demo`, `make test`.  Only python3 (3.11 - 3.13, with venv) and make are assumed.
# Both install the packages that were tested: those of locks/, each checked by its hash.

PYTHON ?= python3
ARGS ?=
# `make NEWEST=1 test`: the newest packages that fit pyproject.toml, in an environment of their own
NEWEST ?=
VENV := .venv$(if $(NEWEST),-newest)
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
RELEASE_STAMP := $(VENV)/.installed-release
TOOLS_STAMP := $(VENV)/.installed-tools
TEST_STAMP := $(VENV)/.installed-test
PIP := $(BIN)/python -m pip install --quiet
LOCK := $(PIP) --require-hashes -r locks
# What of the suite needs neither real time nor the kernel's network, and shows what packages changed.
FAST := $(addprefix tests/,api cli/test_cli_decode.py cli/test_cli_files.py cli/test_cli_main.py farm/test_config_file.py signals testing test_metrics_farm.py vocabulary wire)
# byte code is kept: hundreds of processes import the package
unexport PYTHONDONTWRITEBYTECODE
# Another GSDML parser, without its dependencies, which are for a server that no test starts; and the package that
# contains PI's schema of GSDML files, without its program, which needs an older pydantic and is not used.
# pyprofibus, a PROFIBUS master, has no need of what else its package asks for.
# opcua, a client of OPC UA, is the older code of asyncua's makers.
# cpppo, an EtherNet/IP client, wants a licence's checker that it does not need, and the greenery of its time.
# axe-playwright-python holds the rules of accessibility as one file, which a browser runs.
PEERS := "axe-playwright-python>=0.1.8,<1" "cpppo>=5.2.5,<6" "greenery>=2.1,<3" "industriagents-profinet-mcp" "opcua>=0.98.13,<0.99" "pyprofibus>=1.13,<2" "uphy-upgen>=1.1,<2"
# An EtherNet/IP scanner whose package has the name of another one's.
APART := "cm-ethernetip<0.2"
UV := $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-annotate --custom-compile-command "make lock"

.PHONY: demo test newest lint docs install fuzz soak strangers bench release-check wheel reproducible image sbom audit lock clean

demo: $(STAMP)
	@$(BIN)/pnfarm demo $(ARGS)

test: $(TEST_STAMP)
	@$(BIN)/python -m tests $(ARGS)

# what packages that came after locks/ would break
newest:
	@$(MAKE) --no-print-directory NEWEST=1 test ARGS="-m 'not slow and not exclusive' $(FAST)"

lint: $(TOOLS_STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/mypy configs/pytest/test_async.py
	$(BIN)/mypy hatch_build.py
	$(BIN)/mypy release
	$(BIN)/lint-imports

# as a site in build/site; a link or an anchor that leads nowhere is an error
docs: $(TOOLS_STAMP)
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --clean

fuzz: $(TEST_STAMP)
	$(BIN)/python -m tests.fuzz $(ARGS)

soak: $(TEST_STAMP)
	$(BIN)/python -m tests.soak $(ARGS)

strangers: $(TEST_STAMP)
	$(BIN)/python -m tests.strangers $(ARGS)

bench: $(STAMP)
	$(BIN)/pnfarm bench $(ARGS)

# docs/bench.md of today; a missed goal stands in it, and a row that others' load disturbed does not pass
release-check: $(STAMP)
	$(BIN)/pnfarm bench --markdown docs/bench.md || { code=$$?; [ $$code = 1 ] || [ $$code = 3 ]; }
	$(BIN)/python docs/release_check.py

# the last commit's wheel and sdist, in dist/, the same octets wherever they are built; a second build compares
wheel: $(STAMP)
	$(BIN)/python release/archives.py $(ARGS)

reproducible: $(STAMP)
	$(BIN)/python release/archives.py --twice $(ARGS)

# the last commit's image by the Docker engine of this machine, in dist/, the same octets wherever it is built;
# ARGS=--twice builds a second time and compares
image: $(STAMP)
	$(BIN)/python release/image.py $(ARGS)

# what an installation is made of, and its terms, in dist/
sbom: $(RELEASE_STAMP)
	$(BIN)/python release/sbom.py $(ARGS)

# known vulnerabilities of what is locked; ARGS="--offline FOLDER" asks nobody
audit: $(RELEASE_STAMP)
	$(BIN)/python release/audit.py $(ARGS)

install: $(STAMP)

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

ifdef NEWEST
# the stamps say when: a day's newest packages are not those of the next
.PHONY: $(STAMP)

$(STAMP): | $(BIN)/python
	@echo "Installing pnfarm into ./$(VENV), with the newest packages that fit ..."
	$(PIP) --upgrade pip
	$(PIP) --upgrade --upgrade-strategy eager -e .
	@touch $@

$(RELEASE_STAMP): $(STAMP)
	$(PIP) --upgrade --upgrade-strategy eager --group release
	@touch $@

$(TOOLS_STAMP): $(RELEASE_STAMP)
	$(PIP) --upgrade --upgrade-strategy eager --group docs --group lint --group test
	@touch $@

$(TEST_STAMP): $(TOOLS_STAMP)
	$(PIP) --upgrade --no-deps --no-warn-conflicts $(PEERS)
	$(PIP) --upgrade --no-deps --target $(VENV)/apart $(APART)
	@touch $@
else
$(STAMP): pyproject.toml locks/build.txt locks/runtime.txt | $(BIN)/python
	@echo "Installing pnfarm into ./$(VENV) ..."
	$(LOCK)/build.txt -r locks/runtime.txt
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

$(RELEASE_STAMP): $(STAMP) locks/release.txt
	$(LOCK)/release.txt
	@touch $@

$(TOOLS_STAMP): $(RELEASE_STAMP) locks/ci.txt
	$(LOCK)/ci.txt
	@touch $@

$(TEST_STAMP): $(TOOLS_STAMP) locks/apart.txt locks/peers.txt
	$(LOCK)/peers.txt --no-deps --no-warn-conflicts
	$(LOCK)/apart.txt --no-deps --upgrade --target $(VENV)/apart
	@touch $@
endif

# Versions and hashes of everything that the image and CI install, for every supported Python, from a plain index.
lock: | $(BIN)/python
	$(PIP) --upgrade pip
	$(PIP) --group lock
	$(UV) pyproject.toml --group build --group docs --group lint --group test -o locks/ci.txt
	$(UV) pyproject.toml --extra opcua --extra postgres --extra tls -c locks/ci.txt -o locks/runtime.txt
	$(UV) --group build -c locks/ci.txt -o locks/build.txt
	$(UV) --group release -c locks/ci.txt -o locks/release.txt
	printf '%s\n' $(PEERS) | $(UV) --no-deps - -o locks/peers.txt
	printf '%s\n' $(APART) | $(UV) --no-deps - -o locks/apart.txt

clean:
	rm -rf .venv .venv-newest build dist .pytest_cache .mypy_cache .ruff_cache
