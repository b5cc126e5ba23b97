# `make demo` and `make test` do all the set-up themselves; `make help` lists the rest.

ARGS ?=
BIN := .venv/bin
LIMIT := timeout --signal=ABRT --kill-after=30s 40m
SETUP := deploy/setup.sh pyproject.toml requirements/constraints.txt

.PHONY: help demo test test-all test-rest test-random test-parallel test-quiet test-quick lint imports types evidence docs docs-check wheel lock clean tree site site-links test-site
.DEFAULT_GOAL := help

help: ## list what can be made
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 12

demo: .venv/.ready-to-run ## a whole session with simulated people; options with ARGS="--trials 2"
	$(BIN)/netboard demo $(ARGS)

# Import contracts and generated pages are checked by tests, and so by no target before them. Types are checked while
# tests run: without a cache, mypy keeps one core busy for a minute.
test-parallel test-quiet: export PYTHONDONTWRITEBYTECODE =
test: .venv/.ready-to-develop ## all checks, and all tests but some slow ones; options for pytest with ARGS="-k physics"
	$(MAKE) lint
	$(MAKE) -j 2 test-parallel types
	$(MAKE) test-quiet

test-all: ## all checks and every test, also the slow ones that `make test` leaves out
	NETBOARD_TEST_ALL=1 $(MAKE) test

test-rest: ## the slow tests that `make test` leaves out
	NETBOARD_TEST_ALL=rest $(MAKE) test-parallel
	NETBOARD_TEST_ALL=rest $(MAKE) test-quiet

test-random: ## test-all with random cases of a new seed, which it prints
	seed=$$(od -An -N3 -tu4 /dev/urandom | tr -d ' ') && echo "NETBOARD_TEST_SEED=$$seed" && NETBOARD_TEST_SEED=$$seed $(MAKE) test-all

# A test process that dies is not replaced: pytest-xdist 3.8 gives finished files to the new one and then waits for ever.
# Tests marked quiet have the machine to themselves, all others run two at a time: CONTRIBUTING.md says why. Files
# in their own order: else those with few tests, which are long, come last, and one core has nothing to do. Every test
# has its own time limit; LIMIT ends a run whose workers are lost, and Python then prints where each thread was. Pytest
# takes 8 s longer to collect the tests where Python may not keep what it compiles.
test-parallel: .venv/.ready-to-develop
	$(LIMIT) $(BIN)/python -m pytest -m "not quiet and not site" -n 2 --max-worker-restart 0 --dist loadfile --no-loadscope-reorder $(ARGS) || [ $$? = 5 ]

test-quiet: .venv/.ready-to-develop
	$(LIMIT) $(BIN)/python -m pytest -m quiet tests/integration $(ARGS) || [ $$? = 5 ]

test-quick: lint ## tests without processes and without those that take long, for while you work
	$(BIN)/python -m pytest -m "not slow and not integration and not site" -n 2 --dist loadfile $(ARGS) || [ $$? = 5 ]

lint: .venv/.ready-to-develop ## style and spelling
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell *.md changes deploy docs services src

imports: .venv/.ready-to-develop tree ## who may import whom
	PYTHONPATH=build/tree $(BIN)/lint-imports --no-cache --no-logo

types: .venv/.ready-to-develop tree ## types
	MYPYPATH=build/tree $(BIN)/mypy

evidence: .venv/.ready-to-develop ## what proves netboard, by item: ARGS="faults --quick"; without, the list of items
	PYTHONPATH=tests $(BIN)/python -m evidence $(ARGS)

# Neither tool above knows that services/ is netboard.services: give them one tree, as a wheel has. The evidence for
# netboard is checked as the product is; its tests are not.
tree:
	rm -rf build/tree && mkdir -p build/tree
	cp -Rp src/netboard build/tree/netboard && cp -Rp services build/tree/netboard/services
	cp -Rp tests/evidence build/tree/evidence && find build/tree/evidence -name 'test_*.py' -delete

docs: .venv/.ready-to-develop ## write the generated pages of docs/
	$(BIN)/python docs/generate.py

docs-check: .venv/.ready-to-develop ## whether the generated pages of docs/ are up to date
	$(BIN)/python docs/generate.py --check

# Compiled functions are documented as the Python functions that they are compiled from.
site: .venv/.ready-for-site ## the documentation site, build/site
	rm -rf build/site
	NUMBA_DISABLE_JIT=1 $(BIN)/sphinx-build -q -E -W --keep-going -c docs/site -d build/site-cache . build/site

site-links: .venv/.ready-for-site ## links of the site to other hosts, which needs the internet; the list is build/links/output.txt
	NUMBA_DISABLE_JIT=1 $(BIN)/sphinx-build -q -b linkcheck -c docs/site -d build/site-cache . build/links

test-site: site ## tests of the site: its own links, its search in a browser, and a report at three sizes
	$(BIN)/python -m pytest -m site tests/site $(ARGS)

wheel: .venv/.ready-to-develop ## dist/netboard-*.whl and dist/netboard-*.tar.gz
	rm -rf build/lib build/bdist.* dist
	$(BIN)/python -m build

lock: ## write requirements/constraints.txt anew, with the newest versions that pyproject.toml allows
	python3.11 -m venv --clear build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check '.[analysis,dask,dev,devices,display,environments,evidence,fit,fuzz,lsl,notebook,nwb,parquet,site,triggers]'
	sed -n '/^#/p' requirements/constraints.txt > build/lock/head
	build/lock/bin/python -m pip freeze --exclude netboard | LC_ALL=C sort -f -u | cat build/lock/head - > requirements/constraints.txt

clean: ## remove everything made, but no recording
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache src/*.egg-info *.egg-info
	find src services tests docs -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/.ready-to-run: $(SETUP)
	deploy/setup.sh run
	touch $@

.venv/.ready-to-develop: $(SETUP)
	deploy/setup.sh dev
	touch .venv/.ready-to-run $@

.venv/.ready-for-site: $(SETUP)
	deploy/setup.sh site
	touch .venv/.ready-to-run .venv/.ready-to-develop $@
