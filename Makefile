# One checkout, one command: `make reproduce`. It needs make and Python 3.11 or newer with pip, nothing else.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# The first interpreter that is new enough; choose another with `make PYTHON=/path/to/python test`.
CANDIDATES := python3.11 python3.12 python3.13 python3
PYTHON ?= $(shell for python in $(CANDIDATES); do \
	if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then echo $$python; break; fi; done)
VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/.installed
# The tests run in this many processes; each keeps to one thread.
JOBS ?= 2
STUDY := results/output_observer
ERROR := results/error_observer
PLANT := results/plant
CERTIFICATES := results/certify
SITE := build/site
PIP_TOOLS := 7.6.2

# Small matrices are slower with many threads, and sums in another order would change the last digits.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help reproduce reproduce-all test test-all lint bench docs lock clean

help: ## this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-14s %s\n", $$1, $$2}'

reproduce: $(READY) ## the studies of the plant and of the paper, with their figures, in results/ (resumes if interrupted)
	$(PY) -m studies run plant --preset paper --out $(PLANT)
	$(PY) -m paper_figures --from $(PLANT) --out $(PLANT)/figures
	$(PY) -m studies run output_observer --preset paper --out $(STUDY)
	$(PY) -m paper_figures --from $(STUDY) --out $(STUDY)/figures
	$(PY) -m studies run error_observer --preset paper --out $(ERROR)
	$(PY) -m paper_figures --from $(ERROR) --out $(ERROR)/figures
	$(PY) -m studies run feedforward --preset paper --out results/feedforward
	$(PY) -m paper_figures --from results/feedforward --out results/feedforward/figures
	$(PY) -m studies.claims --from results --out results/claims
	$(PY) -m studies.certify --from $(STUDY) --from $(ERROR) --preset quick --out $(CERTIFICATES)
	$(PY) -m paper_figures.certify_cells --from $(CERTIFICATES) --out $(CERTIFICATES)/figures

reproduce-all: reproduce bench ## the above, more modes, bandwidths and seeds, fully actuated plants, robustness, and the benchmarks
	$(PY) -m studies run error_observer --preset full --out $(ERROR)
	$(PY) -m paper_figures --from $(ERROR) --out $(ERROR)/figures
	$(PY) -m studies run full_actuation --preset paper --out results/full_actuation
	$(PY) -m paper_figures --from results/full_actuation --out results/full_actuation/figures
	$(PY) -m studies run motion --preset paper --out results/motion
	$(PY) -m paper_figures --from results/motion --out results/motion/figures
	$(PY) -m studies run robustness --preset paper --out results/robustness
	$(PY) -m paper_figures --from results/robustness --out results/robustness/figures
	$(PY) -m studies.claims --from results --out results/claims
	$(PY) -m studies.certify --from $(STUDY) --from $(ERROR) --preset full --out $(CERTIFICATES)
	$(PY) -m paper_figures.certify_cells --from $(CERTIFICATES) --out $(CERTIFICATES)/figures

test: $(READY) ## the tests of a few minutes
	$(PY) -m pytest -n $(JOBS) --dist loadfile -m "not slow"

test-all: $(READY) ## every test, also the long ones
	$(PY) -m pytest -n $(JOBS) --dist loadfile -m "slow or not slow"

lint: $(READY) ## style, format and types
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

bench: $(READY) ## timings as ratios within one run, in results/benchmarks
	$(PY) -m benchmarks --out results/benchmarks

docs: $(READY) ## refresh the quoted results in README.md and docs, check the links, build the site in build/site
	$(PY) docs/build.py
	rm -rf $(SITE)
	$(PY) -m sphinx --builder html --quiet --fail-on-warning --keep-going --fresh-env docs $(SITE)

lock: ## resolve requirements.lock anew from pyproject.toml (UPGRADE=1 takes newer versions)
	$(call need_python)
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "make lock needs Python 3.11, the oldest supported")'
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet pip-tools==$(PIP_TOOLS)
	CUSTOM_COMPILE_COMMAND="make lock" build/lock/bin/pip-compile --quiet --no-config \
		--extra dev --extra docs --strip-extras --allow-unsafe --generate-hashes \
		--no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
		$(if $(UPGRADE),--upgrade) --output-file requirements.lock pyproject.toml

clean: ## remove the environment, caches and built files; results/ stays
	rm -rf $(VENV) build dist docs/api .pytest_cache .mypy_cache .ruff_cache .hypothesis ./*.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

define need_python
@test -n "$(PYTHON)" || { echo "No Python 3.11 or newer among: $(CANDIDATES)." \
	"Install one, or name it: make PYTHON=/path/to/python3.11 ..." >&2; exit 1; }
endef

# setuptools is in the lock, so that the package is built without fetching anything else.
$(READY): requirements.lock pyproject.toml
	$(call need_python)
	$(PYTHON) -m venv $(VENV)
	$(PY) -m pip install --quiet --require-hashes -r requirements.lock
	$(PY) -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@
