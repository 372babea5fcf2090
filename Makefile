# Every target installs what it needs: Python 3.11 or later and make are required.
# With uv on the path it takes half a minute; without, `python3 -m venv` and pip take a few. Bytecode is compiled once here:
# else each start of a program compiles its imports again wherever writing bytecode is switched off, which takes longer than most commands.

VENV   ?= .venv
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && { echo $$p; break; }; done)
UV     := $(shell command -v uv 2>/dev/null)
BIN    := $(VENV)/bin
CHECKED := gimbalcal $(wildcard derivations)

# One BLAS thread: two on a busy machine are slower by far, and results do not depend on the machine's size.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
export MPLBACKEND := Agg
# Files of the tests are UTF-8 in every locale.
export PYTHONUTF8 := 1

.DEFAULT_GOAL := help
.PHONY: help demo test lint suite docs mutate bench dist lock clean

help:  ## list the targets
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## */make \1|/' | column -t -s '|' 2>/dev/null \
	|| grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST)

demo: $(VENV)/.run-ready  ## calibrate the recordings that ship with the project; the report is out/demo/report.html
	$(BIN)/gimbalcal demo --out out/demo

test: lint suite  ## everything that a change has to pass; make -j2 test checks types while the tests run

suite: $(VENV)/.dev-ready  ## the tests alone
	$(BIN)/python -m pytest -q -n 2 --dist worksteal --doctest-modules tests gimbalcal

lint: $(VENV)/.dev-ready  ## style, types, the direction of imports, spelling, and words of the field (docs/words.txt)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	$(BIN)/mypy $(CHECKED)
	$(BIN)/lint-imports
	$(BIN)/codespell tests
	$(BIN)/codespell -D - -D docs/words.txt $(CHECKED) docs notebooks data $(wildcard *.md)

mutate: $(VENV)/.dev-ready  ## whether the tests fail where effects and equations are falsified
	$(BIN)/python -m tests.mutate

bench: $(VENV)/.dev-ready  ## measure the figures of the documentation (about two hours; the diagnosis takes one of them)
	for name in bench_device bench_static bench_multiposition bench_systematic bench_navigate bench_navigate_strapdown \
		bench_navigation bench_diagnose bench_unknown_noise bench_laws bench_speed bench_gate bench_strapdown bench_next bench_fleet \
		bench_mistakes bench_clean bench_consistency; do \
		echo "== $$name"; $(BIN)/python -m tests.benchmarks.$$name > docs/measured/$$name.part || exit 1; \
		mv docs/measured/$$name.part docs/measured/$$name.txt; cat docs/measured/$$name.txt; done
	$(BIN)/python docs/build_measured.py

docs: $(VENV)/.docs-ready  ## these pages as a web site without a network: docs/_build/html/index.html
	$(BIN)/python docs/build_effects.py
	$(BIN)/python docs/build_measured.py
	$(BIN)/python docs/build_errata.py
	$(BIN)/python -m sphinx -b html -n -W --keep-going -q docs docs/_build/html
	$(BIN)/python docs/check_links.py docs/_build/html

$(VENV)/.run-ready: requirements/run.txt pyproject.toml
	@$(call install,requirements/run.txt)
	@touch $@

$(VENV)/.dev-ready: requirements/dev.txt pyproject.toml
	@$(call install,requirements/dev.txt)
	@touch $@ $(VENV)/.run-ready

$(VENV)/.docs-ready: requirements/docs.txt pyproject.toml
	@$(call install,requirements/docs.txt)
	@touch $@ $(VENV)/.run-ready

# $(call install,FILE): the locked, hashed packages of FILE, then this project itself, editable.
define install
if [ -z "$(PYTHON)" ]; then echo "gimbalcal needs Python 3.11 or later on the path as python3" >&2; exit 1; fi; \
if [ -n "$(UV)" ]; then \
	set -e; \
	[ -x $(BIN)/python ] || "$(UV)" venv --quiet --python "$(PYTHON)" $(VENV); \
	"$(UV)" pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r $(1); \
	"$(UV)" pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation -e .; \
else \
	set -e; \
	[ -x $(BIN)/python ] || "$(PYTHON)" -m venv $(VENV); \
	[ -x $(BIN)/pip ] || $(BIN)/python -m ensurepip >/dev/null; \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $(1); \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .; \
fi
endef

LOCK := uv pip compile --universal --python-version 3.11 --generate-hashes --no-header --no-annotate --quiet \
	--no-emit-index-url --no-emit-find-links

dist: $(VENV)/.dev-ready  ## build wheel and sdist, and try them in bare environments of every Python here
	$(BIN)/python -m tests.release --oldest

lock:  ## refresh requirements/*.txt from pyproject.toml (needs uv)
	$(LOCK) pyproject.toml requirements/build.in --extra dev -o requirements/dev.txt
	$(LOCK) pyproject.toml requirements/build.in -c requirements/dev.txt -o requirements/run.txt
	$(LOCK) pyproject.toml requirements/build.in -c requirements/dev.txt --extra docs -o requirements/docs.txt
	@! grep -nE '^-|://' requirements/*.txt || { echo "a lock file names an address" >&2; exit 1; }

clean:  ## remove what the other targets made, but not the environment
	rm -rf out .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
