# Every target sets up what it needs: a virtual environment in .venv with the versions of constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

.PHONY: setup demo test fast slow lint docs bench matrix clean

setup: $(READY)  ## the virtual environment, and everything compiled
	$(BIN)/furuta warm-up

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet -e ".[rl,report,matlab,labview,ros,mujoco,video,studio,docs,dev]" -c constraints.txt
	touch $@

demo: $(READY)  ## the main job on bundled logs; writes out/demo
	$(BIN)/furuta demo --out out/demo

# pytest ends with 5 where PYTEST_ARGS select nothing of one part
test:  ## the whole test suite: the fast part first, then the slow one, whatever the first says
	@failed=0; $(MAKE) fast || failed=1; $(MAKE) slow || failed=1; exit $$failed

fast: $(READY)  ## every test that fits nothing, trains nothing and records nothing long
	$(PYTEST) -m "not slow" $(PYTEST_ARGS) || test $$? -eq 5

slow: $(READY)  ## the tests of tests/slow.txt
	$(PYTEST) -m slow $(PYTEST_ARGS) || test $$? -eq 5

lint: $(READY)  ## formatting, style, types, the import contracts, and how the docs read
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports
	$(BIN)/python docs/readability.py

docs: $(READY)  ## the site, to out/site: generated pages, then a strict build that checks every link
	$(BIN)/python docs/generate.py
	$(BIN)/mkdocs build --strict --quiet

bench: $(READY)  ## speed against named references, as ratios
	$(BIN)/python -m experiments.studies.speed

matrix:  ## the quick tests under every Python that this machine has
	.ci/matrix

clean:
	rm -rf $(VENV) out build *.egg-info
