# Everything a checkout needs: `make race` flies, `make test` checks; both make .venv when it is missing.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin

.PHONY: race web bench test regression lint docs clean

race: $(VENV)/.app
	$(BIN)/race fly

web: $(VENV)/.app
	$(BIN)/race web

# How long a control step takes here: a minute or two; a busy machine says little.
bench: $(VENV)/.app
	$(BIN)/race bench

test: $(VENV)/.dev
	$(BIN)/pytest

# Is the racer as fast, safe and smooth as stored? Flies some minutes; race regress FILE --regen stores anew.
regression: $(VENV)/.dev
	$(BIN)/race regress tests/lap_times/*.yaml

lint: $(VENV)/.dev
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

# The documentation site, into site/: open site/index.html.
docs: $(VENV)/.dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(VENV)/.app: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	touch $@

$(VENV)/.dev: $(VENV)/.app
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) dist site .pytest_cache .ruff_cache
