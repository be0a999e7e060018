# `make reproduce` and `make test` set up .venv by themselves; `make help` lists everything.

PYTHON ?= $(shell for python in python3.11 python3.12 python3.13 python3.14 python3; do \
  $$python -c 'import ensurepip, venv' 2>/dev/null && break; done; echo $$python)
BIN := .venv/bin
STAMP := .venv/.complete
PIP := $(BIN)/python -m pip --disable-pip-version-check
WORKERS ?= auto
ARGS ?=
STUDIES := $(notdir $(patsubst %/__main__.py,%,$(wildcard studies/*/__main__.py)))

.PHONY: help install reproduce test test-fast golden check format lint types docs wheel results lock clean
help:
	@echo "make reproduce   install; record a leg, identify it, train, evaluate, transfer, report"
	@echo "make test        install and run every test; test-fast leaves out the slow ones"
	@echo "make check       format, lint, types, documentation, packages: all that CI wants besides tests"
	@echo "make docs        build the documentation into site/"
	@echo "make results     run every study again (days) and store its results"
install: $(STAMP)
# torch comes first and alone: it is by far the largest, and its index may differ from the rest's.
$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys, ensurepip, venv; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "Python 3.11 or newer with venv is needed as $(PYTHON) (Debian: apt install python3-venv);" \
	       "name another with 'make PYTHON=PATH'." >&2; exit 1; }
	$(PYTHON) -m venv .venv
	$(PIP) install $$(grep '^torch==' constraints.txt)
	$(PIP) install -c constraints.txt hatchling editables
	$(PIP) install -c constraints.txt --no-build-isolation -e '.[train,cluster,hardware,view,video,ros,docs,dev]'
	$(BIN)/hop doctor
	@touch $@
reproduce: $(STAMP)
	$(BIN)/hop reproduce $(ARGS)
test: test-fast
	$(BIN)/pytest -q -n $(WORKERS) -m slow $(ARGS)
test-fast: $(STAMP)
	$(BIN)/pytest -q -n $(WORKERS) -m 'not slow' $(ARGS)
golden: $(STAMP)
	$(BIN)/pytest -q tests/golden
check: lint types docs wheel
format: $(STAMP)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
lint: $(STAMP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
types: $(STAMP)
	$(BIN)/mypy
docs: $(STAMP)
	$(BIN)/python docs/render.py --check
	$(BIN)/python docs/make_site.py
wheel: $(STAMP)
	$(BIN)/pytest -q tests/test_package.py
	PYTHON=$(PYTHON) .ci/wheel.sh
# Only an idle machine gives fair timings.
results: $(STAMP)
	for study in $(STUDIES); do $(BIN)/python -m studies.$$study --results || exit 1; done
lock: $(STAMP)
	@{ head -n 1 constraints.txt; $(PIP) freeze --all --exclude-editable --exclude pip | sed 's/+[^ ]*$$//' | sort -f; } > constraints.new
	@mv constraints.new constraints.txt
clean:
	rm -rf build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis
