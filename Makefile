# `make help` lists the targets.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

VENV := .venv
PY := $(VENV)/bin/python
PLUGIN := dist/groundtie_qgis.zip
QUICK := -m "not slow"

# Tests start many processes, each of which would compile the package again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo check test test-newest test-debian test-qgis test-newer-qgis lint bench
.PHONY: fuzz failures plugin docs clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "%-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: $(VENV)/.installed ## make .venv with the groundtie command

$(VENV)/.installed: pyproject.toml
	scripts/make_venv.sh $(VENV)
	$(PY) -m pip install --quiet --upgrade pip
	$(PY) -m pip install --quiet --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(PY) -m pip install --quiet --editable '.[dev]'
	touch $@

demo: install ## simulate a SAR-optical pair, register it, compare with the truth; results in demo/
	$(PY) scripts/demo.py demo

check: lint ## lint and the quick tests of every module, in a minute or so
	env -u GROUNDTIE_REQUIRE_QGIS $(PY) -m pytest -n 2 --dist=loadfile $(QUICK) \
		--ignore=tests/qgis --durations=0 --durations-min=2

test: ## everything; quick tests and QGIS with Debian's packages
	$(MAKE) --jobs=2 --output-sync=target test-newest test-debian test-qgis

test-newest: lint
	env -u GROUNDTIE_REQUIRE_QGIS $(PY) -m pytest -n 2 --dist=loadfile --no-loadscope-reorder \
		--ignore=tests/qgis

# The quick tests meet every module, and test-qgis runs the tools with the same packages. What looks
# at the repository or at the benchmarks is the same with any. `make test-debian QUICK=` runs all.
test-debian:
	scripts/test_debian.sh $(QUICK) --ignore=tests/house --ignore=tests/benchmarks \
		--ignore=tests/qgis

# A process of its own: a crash of QGIS must not take the other results with it.
test-qgis: plugin
	scripts/test_debian.sh tests/qgis

test-newer-qgis: plugin ## the plugin in a newer Debian's QGIS, unpacked into build/ (as root)
	scripts/test_newer_debian.sh -n 2 --dist=loadfile tests/qgis

lint: $(VENV)/.installed-dev ## ruff, mypy, import contracts
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports

bench: $(VENV)/.installed-dev ## accuracy on real pairs, speed
	$(PY) benchmarks/run.py

failures: $(VENV)/.installed-dev ## kill jobs at each step, fill their disks (as root: those are mounted)
	$(PY) -m benchmarks.failures

fuzz: $(VENV)/.installed-dev ## read 20,000 damaged files; failures are kept in benchmarks/results/fuzz
	$(PY) -m benchmarks.fuzz --cases 20000

plugin: ## build dist/groundtie_qgis.zip
	$(or $(wildcard $(PY)),python3) scripts/build_plugin.py $(PLUGIN)

docs: $(VENV)/.installed-dev ## make docs/ into a site, dist/site
	$(PY) scripts/help_pages.py dist/site

clean: ## remove everything that can be made again
	rm -rf $(VENV) build demo dist algorithms/*.egg-info
	rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
