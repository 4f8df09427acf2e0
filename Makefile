# Every target sets up what it needs: a virtual environment in .venv with the versions of constraints.txt.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: setup demo test lint bench clean

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet -e ".[rl,report,mujoco,video,dev]" -c constraints.txt
	touch $@

demo: $(READY)  ## the main job on bundled logs; writes out/demo
	$(BIN)/furuta demo --out out/demo

test: $(READY)  ## the whole test suite
	$(BIN)/python -m pytest -n 2 --dist loadfile $(PYTEST_ARGS)

lint: $(READY)  ## formatting, style, types and the import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

bench: $(READY)  ## speed against named references, as ratios
	$(BIN)/python -m experiments.benchmark

clean:
	rm -rf $(VENV) out build *.egg-info
