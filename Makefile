# What a person or a machine runs here. `make` alone lists the targets.
#
#   PYTHON=/path/to/python   the interpreter that the environment is made with, 3.11 or newer
#   ARGS, PYTEST_ARGS        passed on, as in: make test PYTEST_ARGS='tests/robots -x'

SHELL := /bin/sh
VENV := .venv
BIN := $(VENV)/bin
UV := $(BIN)/uv
UV_PIN := uv==0.13.9
WEB_PACKAGES := web/node_modules/.package-lock.json

# Nothing of an environment that happens to be active reaches this one.
unexport VIRTUAL_ENV CONDA_PREFIX PYTHONHOME PYTHONPATH
unexport PIP_PREFIX PIP_REQUIRE_VIRTUALENV PIP_TARGET PIP_USER
unexport UV_PROJECT_ENVIRONMENT UV_PYTHON UV_SYSTEM_PYTHON

# uv trusts the certificates that the machine trusts, as pip does.
export UV_SYSTEM_CERTS ?= 1

.DELETE_ON_ERROR:
.PHONY: help reproduce test test-slow check docs front bench browser extras lock wheel clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1|\2/p' Makefile | awk -F'|' '{printf "make %-10s %s\n", $$1, $$2}'

reproduce: $(VENV)/.run-stamp ## make every figure and table of the paper, into results/
	$(BIN)/passiflex reproduce --out results $(ARGS)

test: $(VENV)/.dev-stamp ## run the tests, without the slow ones, on all cores; compiled in half the time, by -O1
	PASSIFLEX_OPTIMISE=$${PASSIFLEX_OPTIMISE:-1} $(BIN)/python -m pytest -m "not slow" -n auto --dist loadfile $(PYTEST_ARGS) $(ARGS)

test-slow: $(VENV)/.dev-stamp ## run the slow tests only
	$(BIN)/python -m pytest -m slow $(PYTEST_ARGS) $(ARGS)

check: $(VENV)/.dev-stamp $(WEB_PACKAGES) ## lint, formatting and types; types and tests of web/
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	cd tests && ../$(BIN)/mypy --strict --config-file= --cache-dir=../.mypy_cache/outside typed_use.py
	$(BIN)/vermin --quiet --no-tips --violations --target=3.11- --backport typing_extensions src tests benchmarks examples hatch_build.py
	$(BIN)/python hatch_build.py npm run check
	$(BIN)/python hatch_build.py npm test

docs: $(VENV)/.dev-stamp ## build the documentation into docs/_build/html; a warning is an error
	$(BIN)/python -m sphinx -W -b html docs docs/_build/html $(ARGS)

front: $(VENV)/.dev-stamp ## draw the README's picture, docs/front.svg, anew
	$(BIN)/python docs/front_picture.py

bench: $(VENV)/.dev-stamp ## run every script in benchmarks/
	@for script in $$(grep -l __main__ benchmarks/*.py); do \
	    echo "== $$script"; $(BIN)/python "$$script" $(ARGS) || exit 1; \
	done

wheel: $(VENV)/.run-stamp ## build the wheel into dist/
	$(UV) build --wheel --no-build-isolation --python $(BIN)/python --out-dir dist

browser: ## install Debian's chromium where there is none: the tests of the report drive it
	@if [ -n "$$PASSIFLEX_BROWSER" ] || command -v chromium >/dev/null 2>&1; then exit 0; fi; \
	if ! command -v apt-get >/dev/null 2>&1; then \
	    echo "make: no chromium here, and no apt-get to install it with." \
	         "Install Chromium or Chrome and name it: PASSIFLEX_BROWSER=/path/to/it" >&2; \
	    exit 1; \
	fi; \
	root=; \
	if [ "$$(id -u)" != 0 ]; then \
	    if ! command -v sudo >/dev/null 2>&1; then \
	        echo "make: no chromium here, and only root may install it: apt-get install chromium" >&2; exit 1; \
	    fi; \
	    root=sudo; \
	fi; \
	$$root apt-get -qq update && \
	$$root env DEBIAN_FRONTEND=noninteractive apt-get -qq install --yes --no-install-recommends chromium

extras: $(VENV)/.dev-stamp ## add what the extras need (Rerun, MCAP, Dask, zig) to the environment

clean: ## remove the environment, the caches and what was built; results/ stays
	rm -rf $(VENV) dist build docs/_build docs/generated web/node_modules src/passiflex/reports/bundle
	rm -rf .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find src tests benchmarks docs -type d -name __pycache__ -prune -exec rm -rf {} +

# --- the environment -------------------------------------------------------------------------------

# Sets $py to the newest Python that is new enough.
define find_python
for py in $${PYTHON:-python3.14 python3.13 python3.12 python3.11 python3 python}; do \
    if "$$py" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then break; fi; \
    py=; \
done; \
if [ -z "$$py" ]; then \
    echo "make: no Python >= 3.11 among: $${PYTHON:-python3.14 ... python3.11, python3, python}." \
         "Install one, or name it: make PYTHON=/path/to/python" >&2; \
    exit 1; \
fi
endef

# Sets the index that uv uses to pip's where only pip was told of one.
define find_index
index=$${PIP_INDEX_URL:-$$("$$py" -m pip config get global.index-url 2>/dev/null)}; \
if [ -n "$$index" ]; then UV_DEFAULT_INDEX=$${UV_DEFAULT_INDEX:-$$index}; export UV_DEFAULT_INDEX; fi
endef

# The sources of the report's viewer: a change bundles it anew.
WEB := hatch_build.py $(shell find web -type d \( -name node_modules -o -name dist \) -prune -o -type f -print)

# Adds what a lock names, by hash, and this package in place. Nothing is removed: the two locks are one
# resolution, so that either can be added to the other.
define install
@$(find_python); $(find_index); \
echo "installing $(1) into $(VENV)"; \
$(UV) pip install --quiet --python $(BIN)/python --require-hashes --requirements $(1) && \
$(UV) pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation \
    --reinstall-package passiflex --editable .
@touch $@
endef

$(VENV)/.run-stamp: requirements.lock pyproject.toml $(WEB) | $(UV)
	$(call install,requirements.lock)

$(VENV)/.dev-stamp: requirements-dev.lock pyproject.toml $(WEB) | $(UV)
	$(call install,requirements-dev.lock)

$(UV):
	@$(find_python); \
	echo "making $(VENV) with $$("$$py" --version)"; \
	if uv --version >/dev/null 2>&1; then \
	    { [ -x $(BIN)/python ] || uv venv --quiet --python "$$py" $(VENV); } && \
	    ln -sf "$$(command -v uv)" $@; \
	else \
	    { [ -x $(BIN)/python ] || "$$py" -m venv --without-pip $(VENV); } && \
	    "$$py" -m pip --quiet --disable-pip-version-check --python $(BIN)/python install $(UV_PIN); \
	fi

# The libraries of web/, for the type checker and the tests there.
$(WEB_PACKAGES): web/package-lock.json | $(VENV)/.dev-stamp
	$(BIN)/python hatch_build.py npm ci --loglevel=error
	@touch $@

# --- the locks -------------------------------------------------------------------------------------

EXPORT := export --quiet --frozen --no-emit-project --no-header --no-annotate
LOCK_NOTE := \# Made by `make lock` from pyproject.toml, for every Python and platform at once. Not edited by hand.

lock: | $(UV) ## resolve the dependencies anew and write the two requirement locks
	@$(find_python); $(find_index); $(UV) lock --upgrade --python $(BIN)/python
	@{ echo '$(LOCK_NOTE)'; $(UV) $(EXPORT) --no-default-groups --group build; } > requirements.lock
	@{ echo '$(LOCK_NOTE)'; $(UV) $(EXPORT) --all-groups --all-extras; } > requirements-dev.lock
	@! grep -n '://' requirements.lock requirements-dev.lock
