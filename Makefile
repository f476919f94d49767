# Everything a checkout needs: `make race` flies, `make test` checks; both make .venv when it is missing.
# The first of these that is fit makes .venv; 3.11 comes first, as PyBullet has wheels for it.
PYTHON ?= python3.11 python3.12 python3.13 python3
VENV   := .venv
BIN    := $(VENV)/bin
FIT    := import sys; assert (3, 11) <= sys.version_info[:2] <= (3, 13)

.PHONY: race web bench test fuzz regression lint docs clean

race: $(VENV)/.app
	$(BIN)/race fly

web: $(VENV)/.app
	$(BIN)/race web

# How long a control step takes here: a minute or two; a busy machine says little.
bench: $(VENV)/.app
	$(BIN)/race bench

# Two files of tests at once; more at once would disturb each other's planners, which use every core.
test: $(VENV)/.dev
	$(BIN)/pytest -n 2 --dist loadfile

# 1200 damaged inputs, disks and environments, some minutes; other ones: make fuzz SEED=1
SEED ?= 0
fuzz: $(VENV)/.dev
	$(BIN)/python -m tests.fuzz --seed $(SEED)
	$(BIN)/python -m tests.fuzz.moments --seed $(SEED)

# Is the racer as fast, safe and smooth as stored, and are nasty courses flown? Flies some minutes; race regress FILE --regen stores anew.
regression: $(VENV)/.dev
	$(BIN)/race regress tests/lap_times/*.yaml
	$(BIN)/pytest -m long tests/courses_nasty

lint: $(VENV)/.dev
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

# The documentation site, into site/: open site/index.html.
docs: $(VENV)/.dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(VENV)/.app: pyproject.toml
	@$(BIN)/python -c '$(FIT); import pip' 2>/dev/null || { \
	for python in $(PYTHON); do \
		$$python -c '$(FIT); import venv, ensurepip' 2>/dev/null && exec $$python -m venv --clear $(VENV); \
	done; \
	echo "needs Python 3.11 to 3.13 with venv, tried: $(PYTHON); name one with PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.dev: $(VENV)/.app
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) dist site .pytest_cache .ruff_cache
