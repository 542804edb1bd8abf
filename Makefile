# Everything a newcomer types. Each target installs what it needs into .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PLANNING := $(VENV)/.planning
READY := $(VENV)/.ready
TORCH := torch==2.13.0
CPU_INDEX := https://download.pytorch.org/whl/cpu
PIP := $(BIN)/pip --disable-pip-version-check --quiet
BYTECODE := $(BIN)/python -m compileall -qq -j 0 -x '/tests/' $(VENV)/lib

.PHONY: run smoke prepared test test-slow test-cluster wheel site check speed format clean

run: $(READY)  ## the main job: every stage on the three classes, under 10 minutes on 2 cores
	$(BIN)/motion-memory run --preset laptop

smoke: $(READY)  ## the same, tiny: about a minute
	$(BIN)/motion-memory run --preset smoke

prepared: $(PLANNING)  ## what the tests share: compiled kernels
	$(BIN)/python -m tests.prepared

test: $(READY) prepared  ## the test suite, in parallel: a process for each of two cores
	$(BIN)/pytest -n 2 --dist worksteal -q

test-slow: $(READY) prepared  ## the tests that take minutes
	$(BIN)/pytest -m slow -q --timeout 3600

test-cluster: $(READY) prepared  ## more than one machine, all of them here: needs the PostgreSQL server
	$(BIN)/pytest -m cluster -q tests/cluster

wheel: $(READY) prepared  ## build sdist and wheel, install it alone in a new environment, and plan with it
	$(BIN)/python -m tests.wheel

site: $(READY)  ## the documentation as pages in build/site; a broken link is an error
	$(BIN)/mkdocs build -f mkdocs.yaml

check: $(READY)  ## lint, types, import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

speed: $(READY)  ## all that is measured of speed, some 17 minutes: kernels, planners, OMPL, assists, warm starts
	$(BIN)/python -m tests.speed

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) build *.egg-info

# pip's own newest version first: it takes 30 s of processor time for all of this, that of Python 3.11 70 s.
# pip takes one core, so bytecode is compiled apart from it, on all; tests of packages are never imported, and some
# files are of other Pythons. Kernels can be compiled meanwhile: make -j 2 $(READY) prepared
$(PLANNING): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Motion Memory needs Python 3.11 or newer, this is " + sys.version.split()[0])'
	$(PYTHON) -m venv $(VENV)
	$(PIP) install --no-compile -c constraints.txt --upgrade pip
	@echo "Installing into $(VENV), a minute or two ..."
	$(PIP) install --no-compile -c constraints.txt --editable '.[optimise]' --config-settings editable_mode=compat
	touch $(PLANNING)

# torch first and pinned: a newer one, drawn in by another package, brings gigabytes of CUDA. Without a GPU it comes
# from PyTorch's index for processors, if that answers: PyPI's own has CUDA for most Pythons.
$(READY): $(PLANNING)
	index=; command -v nvidia-smi >/dev/null || index=$$($(PYTHON) -c 'from urllib.request import urlopen; urlopen("$(CPU_INDEX)/torch/", timeout=5); print("--extra-index-url $(CPU_INDEX)")' 2>/dev/null); \
	$(PIP) install --no-compile -c constraints.txt $(TORCH) $$index
	$(BYTECODE) & $(PIP) install --no-compile -c constraints.txt --editable '.[dev]' --config-settings editable_mode=compat && wait
	$(BYTECODE) || true
	touch $(READY)
