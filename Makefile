# `make sim`, `make race` and `make test` each do all set-up. `make check` is the one truth before a commit.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

KERNEL := .venv/.kernel
BYTECODE := .venv/.bytecode

# Kept bytecode halves what tests and the processes that they start spend on imports, whatever the shell says of it.
export PYTHONDONTWRITEBYTECODE :=
# Tests with processes and browsers mostly wait: more of them at a time than there are cores, but six starve each other.
PYTEST := $(BIN)/pytest -q -rfER -n 4 --dist worksteal
# A full computer stops a test in real time, and the fullest one is this one: what failed is tried again, alone on it.
AGAIN = { [ $$? -eq 1 ] && echo "wallride: what failed runs once more, alone" && \
  $(BIN)/pytest -q -rfER --last-failed --last-failed-no-failures none --maxfail 5

.PHONY: sim race test test-all check kernel fuzz format book clean

sim: $(KERNEL)
	$(BIN)/wallride sim $(ARGS)

# A race along the line of a map of a lap, all three driven or made here once: make race ARGS='--laps 3'
RACE := build/race

race: $(KERNEL) $(RACE)/lap.line.csv
	$(BIN)/wallride sim --race $(RACE)/lap.yaml --laps 10 $(ARGS)

$(RACE)/lap.line.csv: | $(KERNEL)
	@rm -rf $(RACE)
	@echo "wallride: 1 of 3, a lap along the wall, 45 s"
	@$(BIN)/wallride sim loop --headless --duration 45 --set recording.folder=$(RACE)
	@echo "wallride: 2 of 3, its map"
	@$(BIN)/wallride map $(RACE)/*-00001.mcap -o $(RACE)/lap.yaml
	@echo "wallride: 3 of 3, the map's race line"
	@$(BIN)/wallride line $(RACE)/lap.yaml -o $@

# All that stops the car, without what is slow by nature (tests/tiers.py); test-all has that too.
test: $(KERNEL) $(BYTECODE)
	$(PYTEST) --quick $(ARGS) || $(AGAIN) --quick $(ARGS); }

test-all: $(KERNEL) $(BYTECODE)
	$(PYTEST) $(ARGS) || $(AGAIN) $(ARGS); }

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	@# mypy takes one core; on the other one the tests' bytecode is made.
	$(BIN)/pytest -qq --collect-only >/dev/null 2>&1 & $(BIN)/mypy && wait && touch $(BYTECODE)
	$(MAKE) test-all

kernel: $(KERNEL)

# The compiled functions; without a compiler the same functions run in Python, which is said and no failure.
$(KERNEL): $(READY) $(wildcard runtime/kernel/*.[ch] runtime/kernel/*/*.c runtime/kernel/*/*/*.c) sim/world/casting.c runtime/kernel/seal.json
	@$(BIN)/wallride build-kernel --native || $(BIN)/wallride build-kernel || echo "wallride: going on in Python"
	@touch $@

# Damaged inputs for every parser that faces the outside, half a minute of them: make fuzz ARGS='--seconds 600 --seed 2'
fuzz: $(KERNEL)
	$(BIN)/python -m tests.fuzz $(ARGS)

# README, docs and benchmarks as a site, build/book/docs/book.html; a link that leads nowhere fails.
book: $(READY)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[book]'
	$(BIN)/sphinx-build --fail-on-warning --quiet -c docs . build/book

# Of a new clone, once: workers that start together would each compile everything. One half for each core.
$(BYTECODE): $(READY)
	@for half in "runtime drivers" "clients docs sim system wallride"; do \
	  $(BIN)/pytest -qq --collect-only $$(printf 'tests/%s ' $$half) >/dev/null 2>&1 & done; wait; touch $@

format: $(READY)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Debian ships Python without venv's own pip; virtualenv from the package index does the same.
$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "wallride needs Python 3.11 or newer: make PYTHON=python3.11")'
	@echo "wallride: setting up .venv, once; about a minute and a half, most of it for downloads"
	@echo "wallride: 1 of 3, a Python environment of its own"
	@$(PYTHON) -m venv .venv 2>/dev/null || { rm -rf .venv; \
	  $(PYTHON) -m pip install --quiet --target .virtualenv virtualenv && \
	  PYTHONPATH=.virtualenv $(PYTHON) -m virtualenv --quiet .venv; }
	@echo "wallride: 2 of 3, packages, one line each"
	@PIP_CONSTRAINT=$(CURDIR)/constraints.txt PIP_BUILD_CONSTRAINT=$(CURDIR)/constraints.txt \
	  $(BIN)/python -m pip install --disable-pip-version-check --no-color -c constraints.txt -e '.[dev]'
	@# A compiler for the hot functions, where the machine has none (90 MB).
	@[ -n "$$CC" ] || command -v cc >/dev/null || $(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --no-color -c constraints.txt -e '.[compiler]' || echo "wallride: no compiler: the hot functions stay in Python"
	@# Carries axe-core as one file for the browser tests; its own dependency, playwright, is not needed.
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps axe-playwright-python==0.1.8
	@echo "wallride: 3 of 3, ready"
	@touch $@

clean:
	rm -rf build drivers/_accelerated.*.so .venv .virtualenv .mypy_cache .ruff_cache .pytest_cache .hypothesis
