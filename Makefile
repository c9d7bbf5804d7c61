# Two commands do everything on a fresh machine: make demo, make test.
PYTHON ?= python3
VENV ?= .venv
RUN := $(VENV)/bin/python
# Two workers: the suite is bound by single-threaded sparse solves.
WORKERS ?= 2
FUZZ ?= 5000
SEED ?= 1
# address of the project, for the metadata of a release; interpreters on which the wheel is tried
PROJECT_URL ?=
PYTHONS ?= python3.11 python3.12 python3.13
# options of bench-scale, such as --sizes 4.7
SCALE ?=
# options of bench-noise, such as --base REV --turns 3 --bed FOLDER
NOISE ?=
# options of the run of planted faults, such as "geometry solvers --sample 5 --minutes 10"
MUTANTS ?=
# threads of the linear algebra libraries: several processes run side by side
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# modules are compiled once, for the many processes of tests and benches
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.PHONY: help venv dev node demo test test-browser test-corpus test-oldest lint format bench bench-atlas bench-hard bench-packing bench-speed bench-scale bench-batch bench-front bench-maps bench-look bench-noise bench-hand fuzz mutants figures docs dist clean

help: ## show this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-14s %s\n", $$1, $$2}'

$(VENV)/.installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "Python 3.11 or newer is needed: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check --editable .
	$(RUN) -m compileall -q circparam  # else each start compiles it where bytecode is not written
	@touch $@

$(VENV)/.dev: $(VENV)/.installed
	$(RUN) -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

# Tests that need npm packages skip without them: no npm and no network are no failure.
NODE_FOLDER := tests/browser
$(NODE_FOLDER)/node_modules/.installed: $(NODE_FOLDER)/package.json
	@if ! command -v npm > /dev/null; then echo "npm is not installed: tests of three.js, the glTF validator and the pages are skipped"; \
	elif npm install --prefix $(NODE_FOLDER) --no-save --no-package-lock --no-audit --no-fund --loglevel=error --prefer-offline --fetch-retries=0 --fetch-timeout=60000; \
	then touch $@; \
	else echo "npm packages were not installed: tests of three.js, the glTF validator and the pages are skipped"; fi

node: $(NODE_FOLDER)/node_modules/.installed ## npm packages that some tests need, where npm is installed

venv: $(VENV)/.installed ## a virtual environment with circparam in it

dev: $(VENV)/.dev ## the same with everything that tests, lint and bench need

demo: $(VENV)/.installed ## unwrap a textured sample and say where mesh, picture and page are
	@mkdir -p demo-output
	@$(RUN) -m circparam samples head-1 -o demo-output/head.glb --overwrite
	@$(RUN) -m circparam unwrap demo-output/head.glb -o demo-output/head_uv.glb --overwrite \
	  --rebake --preview demo-output/head_uv.png
	@$(RUN) -m circparam view demo-output/head_uv.glb -o demo-output/head_uv.html --overwrite -q
	@echo
	@echo "The unwrapped mesh, its texture in the new uv:  $(CURDIR)/demo-output/head_uv.glb"
	@echo "How it looks:         $(CURDIR)/demo-output/head_uv.png"
	@echo "Turn it in a browser: $(CURDIR)/demo-output/head_uv.html"
	@echo "Try your own:         $(VENV)/bin/circparam unwrap MESH"

test: $(VENV)/.dev node ## all tests but those in a browser and on real meshes
	$(RUN) -m pytest -n $(WORKERS) --dist worksteal -m "not corpus"

test-browser: $(VENV)/.dev node ## the HTML pages in headless chromium (2 minutes; node and chromium)
	$(RUN) -m pytest tests/browser

test-oldest: ## files, USD and batches with the oldest versions that pyproject.toml allows
	rm -rf .venv-oldest
	$(PYTHON) -m venv .venv-oldest
	$(PYTHON) -m tests.tools.oldest > .venv-oldest/constraints.txt
	.venv-oldest/bin/python -m pip install --quiet --disable-pip-version-check --prefer-binary \
	  --constraint .venv-oldest/constraints.txt --editable '.[formats,batch,usd]' pytest pytest-randomly hypothesis
	.venv-oldest/bin/python -m pytest -q -p no:cacheprovider tests/formats tests/batch/test_run.py \
	  -k "foreign or trimesh or hostile or stl or continuation or nothing or endless or usd"

test-corpus: $(VENV)/.dev ## the tests on real meshes alone (CIRCPARAM_CORPUS names their folder)
	CIRCPARAM_WHOLE_CORPUS=1 $(RUN) -m pytest -n $(WORKERS) --dist worksteal -m corpus

lint: $(VENV)/.dev ## ruff and mypy
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

format: $(VENV)/.dev ## let ruff lay out the code
	$(RUN) -m ruff check --fix .
	$(RUN) -m ruff format .

bench: $(VENV)/.dev ## the measured claims: speed, memory, distortion, beside peers
	$(RUN) -m tests.bench

bench-atlas: $(VENV)/.dev ## charts, seams and distortion of whole atlases, on all cores
	env -u OMP_NUM_THREADS $(RUN) -m tests.bench atlas

bench-hard: $(VENV)/.dev ## hard surfaces beside xatlas: seams, charts, seams in flats
	env -u OMP_NUM_THREADS $(RUN) -m tests.bench atlas --hard

bench-front: $(VENV)/.dev ## the table at the head of README, beside xatlas, UVAtlas and Blender
	env -u OMP_NUM_THREADS $(RUN) -m tests.bench front

bench-noise: $(VENV)/.dev ## what a change is worth, over many meshes in several rotations (NOISE="--base REV")
	$(RUN) -m tests.bench noise $(NOISE)

bench-maps: $(VENV)/.dev ## maps between pairs of surfaces: inversions, landmarks, known answers, weights
	$(RUN) -m tests.bench maps

bench-look: $(VENV)/.dev ## textured models before and after --rebake, drawn by three.js (node and Chromium)
	$(RUN) -m tests.bench look

bench-hand: $(VENV)/.dev ## what an artist's options reach: stacks of copies
	$(RUN) -m tests.bench hand

bench-packing: $(VENV)/.dev ## covered share on identical charts
	$(RUN) -m tests.bench packing

bench-speed: $(VENV)/.dev ## seconds of whole atlases beside xatlas and UVAtlas, with a profile
	env -u OMP_NUM_THREADS $(RUN) -m tests.bench speed

bench-scale: $(VENV)/.dev ## rough meshes of 0.09 to 1.2 million faces, made here (SCALE="--sizes 4.7,10 --holes 20000" for others)
	env -u OMP_NUM_THREADS $(RUN) -m tests.bench scale $(SCALE)

bench-batch: $(VENV)/.dev ## many files: rates, overhead, memory, and the tests of faults that take minutes
	CIRCPARAM_SLOW=1 $(RUN) -m pytest -m slow tests/batch tests/cli
	$(RUN) -m tests.bench batch

fuzz: $(VENV)/.dev ## hostile meshes and broken files: make fuzz FUZZ=5000 SEED=1
	$(RUN) -m tests.fuzz --cases $(FUZZ) --seed $(SEED)

mutants: $(VENV)/.dev ## planted faults in each room: the share that the tests notice (an hour; MUTANTS="geometry --minutes 5")
	$(RUN) -m tests.tools.mutants $(MUTANTS)

figures: $(VENV)/.dev ## the pictures of README and docs
	$(RUN) -m tests.tools.figures

docs: $(VENV)/.dev ## docs/cli.md out of the help texts, typed keywords out of the options
	$(RUN) -m tests.tools.reference
	$(RUN) -m tests.tools.keywords

dist: $(VENV)/.dev ## wheel and sdist in dist/, tried on each Python that is here (PROJECT_URL=https://... for the links)
	$(RUN) -m tests.tools.release --url '$(PROJECT_URL)' --pythons $(PYTHONS)
	$(RUN) -m tests.tools.extension dist

clean: ## remove what make has made
	rm -rf $(VENV) .venv-oldest demo-output test-artefacts build dist *.egg-info
	rm -rf $(NODE_FOLDER)/node_modules
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
