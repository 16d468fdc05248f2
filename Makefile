# Every target sets the virtual environment up and calls one verb of `twillight`; for example `make plan RECIPE=full`.
# `make report` runs the whole recipe up to the page.

RECIPE ?= quick
PYTHON ?= python3
BIN := .venv/bin
# Every package is listed with the hashes of its files: a file that has another one is refused, and no other is fetched.
INSTALL := $(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --no-deps
READY := .venv/installed
# A run and its tests start many processes: compiled modules are kept, whatever the environment says.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: pictures viewer-shader gallery board report run list plan generate check train bench status savings readme results test tests test-all test-external test-slow faults fuzz lint budgets rooms pins wheel clean

report run: $(READY)
	@$(BIN)/twillight run $(RECIPE)

list: $(READY)
	@$(BIN)/twillight list

plan generate check train bench status: $(READY)
	@$(BIN)/twillight $@ $(RECIPE)

# What the recipes of three scenes save against the general one, which runs first if it has not; it goes on where it was.
savings: RECIPE = standard
savings: $(READY)
	@$(BIN)/twillight run $(RECIPE)
	@$(BIN)/twillight require sphere --recipe $(RECIPE) --method woven --set hidden=64
	@$(BIN)/twillight require dinner_table --recipe $(RECIPE) --method woven --effort .33
	@$(BIN)/twillight require roll --recipe $(RECIPE) --method neumip --effort 1
	@$(BIN)/twillight run out/recipes/require-sphere.toml
	@$(BIN)/twillight run out/recipes/require-dinner_table.toml
	@$(BIN)/twillight run out/recipes/require-roll.toml
	@$(BIN)/twillight savings $(RECIPE) sphere dinner_table roll

# The table of README.md, from the page that `make report` writes.
readme: $(READY)
	@$(BIN)/twillight results quick --readme README.md

# reports/RESULTS.md from the page of `standard`, TRADE.md and REAL.md from those of `trade` and `real`, which run first.
results: RECIPE = standard
results: $(READY)
	@$(BIN)/twillight results $(RECIPE) --file reports/$(or $(if $(filter trade,$(RECIPE)),TRADE),$(if $(filter real,$(RECIPE)),REAL),RESULTS).md

# Linters and types beside the tests, which have one process a core. Every test process computes on one thread.
test: $(READY)
	@$(MAKE) --no-print-directory --jobs 2 lint tests

QUICK := not slow and not faults and not external

tests: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -m "$(QUICK)" --numprocesses logical --maxprocesses 8 --dist loadscope --no-loadscope-reorder

# Every test but the faults. CONTRIBUTING.md says how long each lane takes and which change needs it.
test-all: test test-external test-slow

# Tests that start a server, a cluster, a browser or a compiler.
test-external: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -m "external and not slow and not faults" --numprocesses 2 --dist loadscope --no-loadscope-reorder

# The tests marked slow: long statistics, every kernel compiled from nothing, every recipe made small. Takes long.
test-slow: $(READY)
	$(BIN)/python -m pytest -m "slow and not faults"

# Kills, full disks, wrong clocks, signals and damaged files; every run ends with the bytes of an undisturbed one.
faults: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -m faults tests/faults

# Every test of random inputs, eight times with others: files, tables and bytes are read, or refused in one sentence.
fuzz: $(READY)
	for round in $$(seq 8); do OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -m "hypothesis and not faults" \
		--hypothesis-profile=default || exit 1; done

# reports/BOARD.md from the entries of this repository.
board: $(READY)
	@$(BIN)/twillight challenge board reports/entries/* --to reports/BOARD.md

# A site of all presets in out/gallery: pictures, live pages, maps, samples, shaders and files. A fabric takes about a minute of one core.
gallery: $(READY)
	@$(BIN)/twillight gallery --out out/gallery

# The shaders of `twillight view`, after a change of their source in Slang; needs slangc.
viewer-shader: $(READY)
	$(BIN)/python -m reports.viewer.generate

# The pictures of the pages in docs, made by the commands on these pages; a test checks that they are current.
pictures: $(READY)
	TWILLIGHT_WRITE_PICTURES=1 $(BIN)/pytest -q tests/test_task_pages.py tests/test_twillight_mitsuba.py tests/jobs/verbs/exchange/test_engines.py
	$(BIN)/twillight list --pictures docs/pictures/presets --size 256x192
	$(BIN)/python docs/pictures/cover.py
	$(BIN)/python docs/pictures/papers.py

# The package as one file in dist/, for `pip install dist/*.whl` elsewhere; nothing is compiled at install.
wheel: $(READY)
	@$(BIN)/pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir dist .

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python -m tests.lint

# Limits of `make lint` that are above what is reached: they fall to it.
budgets: $(READY)
	@$(BIN)/python -m tests.lint --lower

# The picture of the rooms in CONTRIBUTING.md.
rooms: $(READY)
	$(BIN)/python -m tests.lint.rooms

# PyTorch's build for the CPU alone is taken where the package index has it: it needs no CUDA. Pip says so if it has not
# (or has it for another platform), and any other failure ends the installation.
NOT_THERE := "No matching distribution found|DO NOT MATCH THE HASHES"
# Nothing is installed again until the pinned versions or the package's own description change.
$(READY): requirements.txt requirements-cpu.txt requirements-cuda.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Twillight needs Python 3.11 or newer: say which with make PYTHON=/path/to/python3"; exit 1; }
	@echo "installing, 1 of 3: the virtual environment .venv"
	@$(PYTHON) -m venv .venv
	@echo "installing, 2 of 3: the packages pinned in requirements.txt; this downloads about a gigabyte and takes minutes"
	@$(INSTALL) --requirement requirements-cpu.txt 2>.venv/cpu.log || grep -Eq $(NOT_THERE) .venv/cpu.log || { cat .venv/cpu.log; echo "PyTorch is not installed: run make again"; exit 1; }
	@$(INSTALL) --requirement requirements.txt
	@$(BIN)/python -c 'import importlib.metadata as m, sys; sys.exit("nvidia" in str(m.requires("torch")))' || { echo "this build of PyTorch needs CUDA: three more gigabytes"; $(INSTALL) --requirement requirements-cuda.txt; }
	@echo "installing, 3 of 3: twillight itself"
	@$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

# Hash of PyTorch's build for the CPU alone (Linux x86_64, Python 3.11), of the version in requirements.txt.
TORCH_CPU := 6746dbcbeb526eb61330b76b41ff1b4eb848951103a892eeb080dfa2b264667b

# The packages that pyproject.toml needs, with the hashes of all their files, for every platform. Pinned versions stay
# as they are; `make pins PINS=--upgrade` takes the newest.
pins:
	@$(PYTHON) -m venv build/pins
	@build/pins/bin/pip install --quiet --disable-pip-version-check uv
	@cat requirements.txt requirements-cuda.txt > build/pins/all.txt
	@build/pins/bin/uv pip compile --quiet $(PINS) --universal --python-version 3.11 --generate-hashes --no-annotate --no-header --extra dev pyproject.toml --output-file build/pins/all.txt
	@awk -v cpu=$(TORCH_CPU) ' \
	  BEGIN { note = "Written by `make pins`, do not edit."; \
	    print "# Versions and hashes of everything `make` installs, for every platform; pyproject.toml has the ranges. " note > "requirements.txt"; \
	    print "# The build of PyTorch for the CPU alone, taken where the package index has it. " note > "requirements-cpu.txt"; \
	    print "# The libraries of CUDA, for other builds of PyTorch on Linux. " note > "requirements-cuda.txt" } \
	  /^[a-z]/ { cuda = /^(cuda|nvidia|triton)/ } \
	  { print > (cuda ? "requirements-cuda.txt" : "requirements.txt") } \
	  /^torch==/ { print $$1 "+cpu --hash=sha256:" cpu > "requirements-cpu.txt" }' build/pins/all.txt

# Products in out/ stay.
clean:
	rm -rf .venv build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find weaves pipeline reports jobs tests -name __pycache__ -prune -exec rm -rf {} +
