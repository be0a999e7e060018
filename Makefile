# `make reproduce` and `make test` set up .venv by themselves; `make help` lists everything.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.complete
PIP := $(BIN)/python -m pip --disable-pip-version-check
WORKERS ?= auto
ARGS ?=
# The energy gain and the price of jerks with which the shipped `precise`, `adaptive` and `recurrent`
# and some results were made, before the recipes' gain ended above the command and jerks cost more.
FORMER := reward.energy=0.4 reward.energy_beyond=0 reward.jerk=0.3
# The commands at which precision is asked for.
HEIGHTS := 0.22,0.23,0.24,0.25,0.26,0.27,0.28,0.29,0.30,0.31,0.32,0.33,0.34,0.35,0.36,0.37,0.38,0.39,0.40

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

# Every number and figure of docs/results.md; takes long, and only an idle machine gives fair timings.
results: $(STAMP)
	$(BIN)/hop evaluate fast precise adaptive paper energy-shaping energy-shaping-literal --seeds 10 --no-video \
	  --json docs/results/evaluation.json --traces runs/results/traces
	$(BIN)/hop report figures runs/results/traces/*.parquet --out docs/results/figures
	$(BIN)/hop evaluate precise adaptive recurrent energy-shaping energy-shaping-flying --seeds 5 --floor soft --no-video --json docs/results/precise.json \
	  --commands $(HEIGHTS)
	$(BIN)/hop robustness energy-shaping energy-shaping-literal fast precise adaptive recurrent paper --seeds 3 \
	  --out runs/results/robustness --json docs/results/robustness.json
	cp runs/results/robustness/robustness.svg docs/results
	$(BIN)/hop skills fast precise adaptive paper energy-shaping --json docs/results/skills.json
	$(BIN)/hop bench probe fast precise adaptive recurrent paper --figure docs/results/probe.svg --json docs/results/probe.json
	$(BIN)/hop bench env --json docs/results/env.json
	$(BIN)/hop bench inference --json docs/results/inference.json
	$(BIN)/hop bench convergence --json docs/results/convergence.json
	$(BIN)/hop bench engines --json docs/results/bullet.json
	$(BIN)/hop bench energy-shaping --json docs/results/energy_shaping.json
	$(BIN)/hop tune energy-shaping --start energy-shaping --flight 0.52 --generations 40 --population 16 --step 0.2 --out runs/flying-0
	$(BIN)/hop tune energy-shaping --start runs/flying-0/gains.toml --seed 1 --flight 0.52 --generations 40 --population 16 \
	  --step 0.1 --out runs/flying --json docs/results/energy_shaping_flying.json
	$(BIN)/hop bench training --json docs/results/training.json
	$(BIN)/hop bench training --recipe precise --parallel-seeds 2 --threads 1 --minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 \
	  --out runs/bench-quarter --json docs/results/training-quarter.json
	$(BIN)/hop evaluate precise \
	  $(foreach s,0 1 2 3 4,quarter-seed$(s)=runs/bench-quarter/precise-seed$(s)/policy.onnx) --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-seeds.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop bench training --recipe precise --set teachers=3 --minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 \
	  --out runs/bench-quarter-one-start --json docs/results/training-quarter-one-start.json
	$(BIN)/hop evaluate precise \
	  $(foreach s,0 1 2 3 4,quarter-seed$(s)=runs/bench-quarter-one-start/precise-seed$(s)/policy.onnx) --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-seeds-one-start.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop bench training --recipe precise --set reward.jerk=0.4 --minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 \
	  --out runs/bench-quarter-0.4 --json docs/results/training-quarter-jerk-0.4.json
	$(BIN)/hop bench training --recipe precise --set reward.jerk=0.4 --minutes 13.5 --steps 20000000 --training-seeds 3 --out runs/bench-quarter-again
	$(BIN)/hop evaluate precise \
	  $(foreach s,0 1 2 3 4,quarter-seed$(s)=runs/bench-quarter-0.4/precise-seed$(s)/policy.onnx) \
	  again-seed3=runs/bench-quarter-again/precise-seed3/policy.onnx --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-seeds-jerk-0.4.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop train --recipe precise --threads 2 --minutes 13.5 --steps 20000000 --set reward.jerk=0.4 n_epochs=4 --out runs/parts/four-passes
	$(BIN)/hop evaluate four-passes=runs/parts/four-passes/policy.onnx --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-passes.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop bench training --recipe precise --set reward.jerk=0.3 --minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 \
	  --out runs/bench-quarter-0.3 --json docs/results/training-quarter-jerk-0.3.json
	$(BIN)/hop evaluate precise \
	  $(foreach s,0 1 2 3 4,quarter-seed$(s)=runs/bench-quarter-0.3/precise-seed$(s)/policy.onnx) --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-seeds-jerk-0.3.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop bench training --recipe precise --set $(FORMER) --minutes 13.5 --steps 20000000 --training-seeds 0 1 2 3 4 \
	  --out runs/bench-quarter-former
	$(BIN)/hop evaluate precise \
	  $(foreach s,0 1 2 3 4,quarter-seed$(s)=runs/bench-quarter-former/precise-seed$(s)/policy.onnx) --seeds 5 --floor soft --no-video \
	  --json docs/results/precise-seeds-former.json --commands $(HEIGHTS),0.41,0.42,0.43,0.44,0.45
	$(BIN)/hop train --recipe adaptive --set $(FORMER) --out runs/adaptive
	$(BIN)/hop robustness 12-million-steps=runs/adaptive/policy.onnx adaptive --seeds 3 \
	  --out runs/results/robustness-adaptive --json docs/results/adaptive-robustness.json
	for seed in 0 1 2 3 4; do $(BIN)/hop train --recipe precise --seed $$seed --steps 9000000 --set $(FORMER) teachers=1 n_epochs=4 task.command_skew=1 teacher_share=0.28 --out runs/teaching/0.28-seed$$seed; done
	for seed in 2 4; do $(BIN)/hop train --recipe precise --seed $$seed --steps 9000000 --set $(FORMER) teachers=1 n_epochs=4 task.command_skew=1 teacher_share=0.38 --out runs/teaching/0.38-seed$$seed; done
	$(BIN)/hop train --recipe precise --steps 9000000 --set $(FORMER) teachers=1 n_epochs=4 task.command_skew=1 teacher_share=0.55 --out runs/teaching/0.55-seed0
	$(BIN)/hop evaluate "runs/teaching/*/policy.onnx" --seeds 5 --floor soft --no-video --json docs/results/teaching.json \
	  --commands $(HEIGHTS)
	$(BIN)/hop robustness 0.28-seed0=runs/teaching/0.28-seed0/policy.onnx 0.38-seed2=runs/teaching/0.38-seed2/policy.onnx \
	  0.55-seed0=runs/teaching/0.55-seed0/policy.onnx --seeds 3 --out runs/results/robustness-teaching --json docs/results/teaching-robustness.json
	$(BIN)/hop train --recipe precise --seed 3 --steps 12000000 --set $(FORMER) teacher_share=0.42 dagger.knots=16 --out runs/precise
	$(BIN)/hop bench limits --controllers precise adaptive recurrent energy-shaping quarter=runs/bench-quarter/precise-seed3/policy.onnx \
	  --teacher runs/bench-quarter/precise-seed3/start-1 --json docs/results/limits.json
	$(BIN)/hop bench reach --json docs/results/reach.json
	$(BIN)/hop train --recipe precise --steps 9000000 --set $(FORMER) teachers=1 n_epochs=4 task.command_skew=1 teacher_share=0.55 --observation three-samples --heights 0.2 0.42 --out runs/fifteen
	$(BIN)/hop train --recipe recurrent --set $(FORMER) --observation three-samples --out runs/fifteen-recurrent
	$(BIN)/hop evaluate fifteen=runs/fifteen/policy.onnx fifteen-recurrent=runs/fifteen-recurrent/policy.onnx \
	  --seeds 5 --floor soft --no-video --json docs/results/fifteen.json
	$(BIN)/hop bench ablation --json docs/results/ablation.json
	$(BIN)/hop bench ablation --recipe precise --steps 9000000 --threads 1 \
	  --variants recipe no-teacher short-past jumpy-teacher no-aim all-heights-alike --json docs/results/ablation-precise.json
	$(BIN)/hop excite multisine --robot legv2 --centre 0.7 -1.4 --amplitude 0.3 0.4 --out runs/results/multisine.parquet
	$(BIN)/hop record runs/results/multisine.parquet --robot twin --believed legv2 --out runs/results
	$(BIN)/hop identify runs/results/twin-multisine.parquet --out runs/results/identified.toml --json docs/results/identify.json
	$(BIN)/hop bench identify --parts synthetic throughput mujoco-sysid --json docs/results/bench_identify.json
	$(BIN)/hop bench identify --parts paper-size --searches two-pass --json docs/results/bench_identify_size.json
	$(BIN)/hop bench identify --parts recordings --json docs/results/bench_identify_recordings.json
	$(BIN)/hop experiment transfer --set $(FORMER) --seeds 0 1 --json docs/results/transfer.json
	$(BIN)/hop experiment transfer --set $(FORMER) --methods identified-surprises cad-surprises --json docs/results/transfer-surprises.json
	$(BIN)/hop experiment transfer --folder runs/transfer-standing --set $(FORMER) n_epochs=8 task.idle=1.5 task.fall_penalty=2 task.command_skew=1.5 \
	  reward.tail=0.25 --json docs/results/transfer-standing.json
	$(BIN)/hop experiment transfer --recipe fast --folder runs/transfer-fast --json docs/results/transfer-fast.json
	$(BIN)/hop experiment prediction --json docs/results/prediction.json
	$(BIN)/hop bench finetune --twins 1 2 --seeds 0 1 --minutes 5 --figure docs/results/finetune.svg --json docs/results/finetune.json
	$(BIN)/hop tune fast --trials 20 --steps 1000000 --workers 2 --json docs/results/tuning-fast.json
	mkdir -p docs/results/tuning-fast && cp runs/tune/fast/*.svg docs/results/tuning-fast
	$(BIN)/hop bench view --json docs/results/view.json
	$(BIN)/hop bench deploy --json docs/results/deploy.json
	$(BIN)/hop bench faults --repeats 15 --live 2 --controllers fast precise energy-shaping --json docs/results/faults.json

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
