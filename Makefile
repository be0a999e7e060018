# `make reproduce` and `make test` set up .venv by themselves; `make help` lists everything.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.complete
PIP := $(BIN)/python -m pip --disable-pip-version-check
WORKERS ?= auto
ARGS ?=
STUDIES := $(patsubst studies/%/__init__.py,%,$(wildcard studies/*/__init__.py))

.PHONY: help install reproduce test test-fast check format lint types docs wheel results lock clean

help:
	@echo "make reproduce   install; record a leg, identify it, train, evaluate, transfer, report"
	@echo "make test        install and run every test"
	@echo "make test-fast   only the tests that take less than a few seconds"
	@echo "make check       format, lint, types, documentation, packages: all that CI wants besides tests"
	@echo "make docs        build the documentation into site/"
	@echo "make install     only set up $(VENV)"

install: $(STAMP)

# torch comes first and alone: it is by far the largest, and its index may differ from the rest's.
$(STAMP): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { \
	  echo "$(PYTHON) is missing; install it (Debian: apt install python3.11 python3.11-venv) or" \
	       "name another with 'make PYTHON=python3'." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "$(PYTHON) is too old; Python 3.11 or newer is needed." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' || { \
	  echo "$(PYTHON) cannot make virtual environments; install its venv module" \
	       "(Debian: apt install python3.11-venv)." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PIP) install $$(grep '^torch==' constraints.txt)
	$(PIP) install -c constraints.txt hatchling editables
	$(PIP) install -c constraints.txt --no-build-isolation -e '.[train,tune,cluster,hardware,bench,view,docs,dev]'
	$(PIP) install -c constraints.txt --only-binary pybullet pybullet || \
	  echo "There is no PyBullet for this Python; what needs it is left out, its tests are skipped."
	@touch $@

reproduce: $(STAMP)
	$(BIN)/hop reproduce $(ARGS)

test: $(STAMP)
	$(BIN)/pytest -q -n $(WORKERS) -m 'not slow' $(ARGS)
	$(BIN)/pytest -q -n $(WORKERS) -m slow $(ARGS)

test-fast: $(STAMP)
	$(BIN)/pytest -q -n $(WORKERS) -m 'not slow' $(ARGS)

# Every stored result and figure; takes days, and only an idle machine gives fair timings.
results: $(STAMP)
	for study in $(STUDIES); do $(BIN)/python -m studies.$$study --results || exit 1; done

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
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# The wheel must work without the training extra, so it gets an environment of its own. It is built
# from the source archive, and that must install by itself, too.
wheel: $(STAMP)
	$(BIN)/pytest -q tests/test_package.py
	rm -rf build/wheel
	$(BIN)/python -m build --no-isolation --outdir build/wheel
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip --disable-pip-version-check install -q -c constraints.txt build/wheel/*.whl
	cd build/wheel && venv/bin/python -c 'import hopping_leg, sys; assert "torch" not in sys.modules'
	cd build/wheel && venv/bin/python -c 'import gymnasium; gymnasium.make("HoppingLeg-v0")'
	cd build/wheel && venv/bin/hop robots list && venv/bin/hop export urdf --out leg.urdf
	cd build/wheel && venv/bin/hop evaluate energy-shaping --commands 0.3 --seeds 1 --floor soft --out report
	build/wheel/venv/bin/python -m pip --disable-pip-version-check install -q -c constraints.txt "$$(echo build/wheel/*.whl)[view]"
	cd build/wheel && venv/bin/hop view --no-browser --port 0 --seconds 1
	build/wheel/venv/bin/python -m pip --disable-pip-version-check install -q --force-reinstall --no-deps build/wheel/*.tar.gz
	cd build/wheel && venv/bin/hop robots check legv2 && venv/bin/hop doctor

lock: $(STAMP)
	@{ head -n 1 constraints.txt; $(PIP) freeze --all --exclude-editable --exclude pip | sed 's/+[^ ]*$$//' | sort -f; } > constraints.new
	@mv constraints.new constraints.txt

clean:
	rm -rf build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis
