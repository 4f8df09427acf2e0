# Every target sets up what it needs: a virtual environment in .venv with the versions of constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
EXTRAS := rl,report,matlab,labview,ros,mujoco,video,studio,lab,plan,docs,dev
# torch without CUDA is 0.8 GB instead of several; where this index cannot be reached, pip's own one serves
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
# tests start Python some hundred times, and a start that compiles every module anew takes seconds
export PYTHONDONTWRITEBYTECODE :=
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

.PHONY: setup demo test fast slow thorough lint docs bench matrix core constraints clean

setup: $(READY)  ## the virtual environment, and everything compiled
	$(BIN)/furuta warm-up

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --retries 0 --timeout 20 --no-deps --index-url $(TORCH_INDEX) torch -c constraints.txt \
		2> /dev/null || { echo "torch comes from pip's own index"; $(BIN)/pip install --quiet torch -c constraints.txt; }
	$(BIN)/pip install --quiet uv -c constraints.txt  # a third of pip's time; it does not know pip's settings, such as a mirror
	$(BIN)/uv pip install --quiet --python $(BIN)/python -e ".[$(EXTRAS)]" -c constraints.txt \
		|| $(BIN)/pip install --quiet -e ".[$(EXTRAS)]" -c constraints.txt
	touch $@

demo: $(READY)  ## the main job on bundled logs; writes out/demo
	$(BIN)/furuta demo --out out/demo

test: $(READY)  ## every change is tested with these: the slow tests and the fast ones, in one run
	$(PYTEST) -m "not thorough" $(PYTEST_ARGS)

fast: $(READY)  ## every test that fits nothing, trains nothing and records nothing long
	$(PYTEST) -m "not slow and not thorough" $(PYTEST_ARGS)

slow: $(READY)  ## the tests of tests/slow.txt
	$(PYTEST) -m "slow and not thorough" $(PYTEST_ARGS)

thorough: $(READY)  ## the longest tests, those of tests/thorough.txt and whole studies: an hour and more
	$(PYTEST) -m thorough $(PYTEST_ARGS)

lint: $(READY)  ## formatting, style, types, the import contracts, and how the docs read
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyrefly check --min-severity error
	$(BIN)/lint-imports
	$(BIN)/python docs/readability.py

docs: $(READY)  ## the site, to out/site: generated pages, the tutorials run, a strict build that checks every link
	$(BIN)/python docs/generate.py
	$(BIN)/python -m pytest -q tests/test_docs.py -k tutorial_runs
	$(BIN)/mkdocs build --strict  # not --quiet, which keeps warnings from being counted

bench: $(READY)  ## speed against named references, as ratios
	$(BIN)/python -m experiments.studies.speed

matrix:  ## the quick tests, and whether all extras can be had, under every Python that this machine has
	EXTRAS=$(EXTRAS) .ci/matrix

core:  ## source distribution and wheel, and the wheel alone at work outside of this tree: some minutes
	PYTHON=$(PYTHON) .ci/core

constraints:  ## the newest versions that pyproject.toml allows, to constraints.txt; then run make test
	rm -rf build/constraints
	$(PYTHON) -m venv build/constraints
	build/constraints/bin/pip install --quiet --retries 0 --timeout 20 --no-deps --index-url $(TORCH_INDEX) torch \
		2> /dev/null || echo "torch comes from pip's own index"
	build/constraints/bin/pip install --quiet ".[$(EXTRAS)]" pygame-ce  # which other Pythons take in place of pygame
	build/constraints/bin/pip freeze --exclude furuta-gym > build/frozen.txt
	sed 's/+[^ ]*$$//' build/frozen.txt > build/constraints.txt
	mv build/constraints.txt constraints.txt

clean:
	rm -rf $(VENV) out build *.egg-info
