# Everything runs in .venv, which the targets below make and keep up to date by themselves.
# `make` lists the targets; ARGS goes to pytest: make test ARGS="tests/test_closures.py -k derived".

VENV    := .venv
BIN     := $(VENV)/bin
PIP     := $(BIN)/python -m pip --disable-pip-version-check
# One Python by name, or the first of these that is new enough.
PYTHONS := $(or $(PYTHON),python3 python3.13 python3.12 python3.11)
WORKERS ?= 2

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help venv reproduce test coverage check docs links format bench evidence verdict lock clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/  make \1	\2/p' $(MAKEFILE_LIST) | expand -t 20

venv: $(VENV)/.installed ## set up .venv (the other targets do so too)

$(VENV)/.created:
	@found=; for python in $(PYTHONS); do \
	    if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; \
	    then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then \
	    echo "error: triboflux needs Python 3.11 or newer, which none of these is: $(PYTHONS);" \
	        "install one, or name it with make PYTHON=/path/to/python." >&2; \
	    exit 1; \
	fi; \
	$(BIN)/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	    || $$found -m venv --clear $(VENV)
	@touch $@

# pip check fails when pyproject.toml asks for something that the lock does not hold.
$(VENV)/.installed: requirements/dev.txt pyproject.toml $(VENV)/.created
	@echo "Installing the locked environment into $(VENV); the first time takes some minutes."
	@$(PIP) install --quiet --requirement requirements/dev.txt
	@$(PIP) install --quiet --no-deps --editable .
	@$(PIP) check || { echo "error: the lock and pyproject.toml disagree; run make lock." >&2; exit 1; }
	@touch $@

reproduce: $(VENV)/.installed ## compute the paper's figures into reproduction/
	@mkdir -p reproduction
	$(BIN)/triboflux reproduce -o reproduction --overwrite

test: $(VENV)/.installed ## run the tests
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(ARGS)

coverage: $(VENV)/.installed ## run the tests, a third slower, and tell which lines they miss
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --cov --cov-report term $(ARGS)

# The variable keeps pyright from asking for a newer release of itself.
check: $(VENV)/.installed ## lint, formatting and types
	$(BIN)/python -m ruff check
	$(BIN)/python -m ruff format --check
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(BIN)/python -m pyright

docs: $(VENV)/.installed ## build the documentation site into build/docs
	$(BIN)/python -m sphinx --builder html --jobs auto --fail-on-warning --keep-going --quiet \
	    docs build/docs
	@echo "Open build/docs/index.html."

links: $(VENV)/.installed ## ask the network whether links to other sites still lead somewhere
	$(BIN)/python -m sphinx --builder linkcheck --quiet docs build/links

format: $(VENV)/.installed ## mend formatting and what lint can mend
	$(BIN)/python -m ruff check --fix
	$(BIN)/python -m ruff format

bench: $(VENV)/.installed ## time the solver beside SciPy's, plain and compiled
	$(BIN)/python -m benchmarks.first
	$(BIN)/python -m benchmarks.peers --short

evidence: $(VENV)/.installed ## write the tables of docs/closures.md and docs/suspension.md anew
	$(BIN)/python -m benchmarks.closure_evidence --write
	$(BIN)/python -m benchmarks.closure_effects --write
	$(BIN)/python -m benchmarks.presets --write

verdict: $(VENV)/.installed ## judge closures and models by simulated particles anew (docs/verdict.md)
	$(BIN)/python -m benchmarks.kinetic_verdict --write

lock: $(VENV)/.created ## renew requirements/dev.txt after a change of dependencies (ARGS=--upgrade: newest)
	$(PIP) install --quiet uv
	$(BIN)/python -m uv pip compile --quiet --universal --python-version 3.11 \
	    --fork-strategy fewest --extra dev --no-emit-index-url --no-emit-find-links \
	    --no-annotate --custom-compile-command "make lock" $(ARGS) \
	    --output-file requirements/dev.txt pyproject.toml

clean: ## remove caches and everything computed, but not .venv
	rm -rf reproduction dist build .pytest_cache .ruff_cache .hypothesis .coverage .coverage.*
	find . -path ./$(VENV) -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +
