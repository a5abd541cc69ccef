# stridor: `make demo` and `make test` are all a new user needs; `make` alone lists the rest.
# Needs make and Python 3.11 or newer; everything else goes into .venv, in the versions of requirements/dev.lock.

PYTHON ?= python3.13 python3.12 python3.11 python3 python
JOBS ?= 2
PYTEST_ARGS ?=
LANES ?= 1

LOCK := requirements/dev.lock
BIN := .venv/bin
STAMP := .venv/.stridor-ready
PIP = $(BIN)/python -m pip install -qq --no-input --disable-pip-version-check

.DEFAULT_GOAL := help
.PHONY: help env demo test weekly mutants bench lint types types-strict layers docs viewer lock clean FORCE

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

env: $(STAMP)  ## the environment in .venv, from the lock file

demo: $(STAMP)  ## the two-beam bench, from case file to report, in demo/
	@mkdir -p demo
	@test -e demo/two-beams.toml || (cd demo && ../$(BIN)/stridor new two-beams)
	cd demo && ../$(BIN)/stridor run two-beams.toml
	@test -s demo/two-beams.out/report.html || { echo "make demo: no report was written" >&2; exit 1; }
	@echo; echo "The report: $(CURDIR)/demo/two-beams.out/report.html"

# One BLAS thread each: the workers already use the cores. Each has its half of the tests in order and takes of the
# other's at the end: tests dealt out by turns would make what a module's tests share once for every worker.
test: $(STAMP)  ## all tests but the slow ones
	OPENBLAS_NUM_THREADS=$${OPENBLAS_NUM_THREADS:-1} $(BIN)/python -m pytest -n $(JOBS) --dist worksteal $(PYTEST_ARGS)

weekly: $(STAMP)  ## the strict types, the slow tests, the full benchmarks and the tests of the tests
	@$(MAKE) --no-print-directory types-strict
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS)
	@$(each_benchmark)
	@$(MAKE) --no-print-directory mutants

# The tool lies in a folder of its own: the lock file stays as small as work on stridor needs.
mutants: $(STAMP)  ## do the tests notice small faults? (a sample: MUTANTS="--sample 300 --minutes 120")
	@test -d build/mutants/tools/cosmic_ray || $(BIN)/python -m pip install -qq --no-input --disable-pip-version-check \
	  --target build/mutants/tools cosmic-ray==8.7.0
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/mutants/mutate.py $(MUTANTS)

# What a change can run along with its tests; the others spend their time on machine code and on runs in time, weekly.
QUICK := boundaries damping_map direct_solvers friction_sweep krylov_modes onsets pad_on_disc quadratic_modes time_loop \
  validation verbs viewer

bench: $(STAMP)  ## the quick benchmarks in short mode (LANES=2: two at once, which disturb each other)
	@printf 'benchmarks/%s.py\n' $(QUICK) | xargs -P $(LANES) -n 6 $(BIN)/python benchmarks/_short.py

lint: $(STAMP)  ## ruff
	$(BIN)/python -m ruff check .

types: $(STAMP)  ## ty on src, in seconds; of benchmarks whether they call what there is, as most run weekly only
	$(BIN)/python -m ty check --python $(BIN)/python --error-on-warning --no-progress
	$(BIN)/python -m ty check --python $(BIN)/python --error-on-warning --no-progress --ignore all --error unknown-argument \
	  --error too-many-positional-arguments --error missing-argument --error unresolved-reference benchmarks/*.py

types-strict: $(STAMP)  ## pyright, strict, on src: minutes; before a release or after larger changes
	$(BIN)/python -m basedpyright --pythonpath $(BIN)/python

layers: $(STAMP)  ## which part may import which
	$(BIN)/lint-imports

docs: $(STAMP)  ## the documentation, in docs/_build/html; warnings are errors
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html

viewer:  ## the viewer of solids on pages, built again from viewer/ (needs npm and a network)
	cd viewer && npm ci --no-audit --no-fund && npm run build

lock: $(STAMP)  ## requirements/dev.lock again from pyproject.toml (newest versions: UPGRADE=--upgrade)
	$(BIN)/python -m uv pip compile pyproject.toml --group dev --universal --python-version 3.11 \
	  --fork-strategy fewest --generate-hashes --custom-compile-command "make lock" --no-emit-index-url --no-emit-find-links \
	  --quiet $(UPGRADE) --output-file $(LOCK)
	@! grep -n '://' $(LOCK) || { echo "make lock: $(LOCK) must not name an address" >&2; exit 1; }

clean:  ## removes what the other targets made, except .venv and demo/
	rm -rf build dist docs/_build viewer/node_modules .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks examples docs -type d -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true

# -- how it is done ----------------------------------------------------------------------------------------------------

define each_benchmark
ls benchmarks/[!_]*.py | BENCH="$(BIN)/python" xargs -P $(LANES) -I{} sh -c \
  'said=$$($$BENCH {} 2>&1); code=$$?; printf "== %s\n%s\n" {} "$$said"; exit $$code'
endef

# The first Python that really runs (shims may exist that only complain), is new enough, and can make environments.
define find_python
chosen=; old=; bare=; \
for candidate in $(PYTHON); do \
  version=$$("$$candidate" -c 'import sys; print("%d.%d.%d" % sys.version_info[:3])' 2>/dev/null </dev/null) || continue; \
  "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { old="$$old $$candidate ($$version)"; continue; }; \
  "$$candidate" -c 'import ensurepip, venv' 2>/dev/null || { bare="$$bare $$candidate ($$version)"; continue; }; \
  chosen=$$candidate; break; \
done; \
if test -n "$$chosen"; then :; \
elif test -n "$$bare"; then \
  echo "stridor: no module venv in$$bare. On Debian or Ubuntu: apt install python3-venv" >&2; exit 1; \
else \
  echo "stridor needs Python 3.11 or newer; found:$${old:- none}. Install one, or name it: make demo PYTHON=/path/to/python3" >&2; exit 1; \
fi
endef

# The lock file's own uv takes seconds where pip takes a minute. Neither compiles the thousands of modules that nobody
# imports; those that every start reads are compiled once, by importing them. Where uv cannot fetch (it does not know
# pip's settings), pip does it all: the hashes of the lock file make both install the same.
define with_uv
awk '/^uv==/ {on = 1} on {print} on && !/\\$$/ {exit}' $(LOCK) >.venv/uv.txt && \
$(PIP) --require-hashes --no-deps -r .venv/uv.txt && \
UV_HTTP_RETRIES=1 $(BIN)/python -m uv pip install --quiet --python $(BIN)/python --require-hashes -r $(LOCK)
endef

# The stamp holds the folder's path: an environment that was moved or copied along is set up again.
$(STAMP): $(LOCK) pyproject.toml $(if $(subst x$(CURDIR),,x$(shell cat $(STAMP) 2>/dev/null)),FORCE)
	@if test "$$(cat $@ 2>/dev/null || echo "$(CURDIR)")" = "$(CURDIR)" && \
	  $(BIN)/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then :; else \
	  $(find_python); \
	  echo "making .venv with $$chosen ($$version)"; \
	  "$$chosen" -m venv --clear .venv || { echo "stridor: $$chosen -m venv failed, see above" >&2; exit 1; }; \
	fi
	@echo "installing $(LOCK) into .venv (up to a minute the first time)"
	@{ $(with_uv); } >/dev/null 2>&1 || $(PIP) --no-compile --require-hashes -r $(LOCK) || { \
	  echo "stridor: the locked packages cannot be installed with $$($(BIN)/python -V) on $$(uname -sm), see above." >&2; \
	  echo "The lock covers Python 3.11 to 3.13 on Linux and macOS; without a network, nothing can be fetched." >&2; exit 1; }
	@$(PIP) --no-deps --no-build-isolation -e .
	@env -u PYTHONDONTWRITEBYTECODE $(BIN)/python -c 'import stridor.app.cli, matplotlib.pyplot, xarray, h5netcdf, jinja2'
	@printf '%s\n' "$(CURDIR)" > $@

FORCE:
