# One command each, from a fresh clone: `make repro` computes the tables, `make test` checks the code.

PYTHON ?= python3.11
VENV := .venv
BIN := $(CURDIR)/$(VENV)/bin
INSTALLED := $(VENV)/.installed

SHELF := .cache/shelf
PEERS := .cache/peers

export PATH := $(BIN):$(PATH)
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: setup ship quick repro study cases test lint bench bench-peers open-world shelf mlflow verify-determinism verify-interruption verify-load verify-hostile verify-execution sources reach

setup: $(INSTALLED)

$(VENV)/bin/pip:
	$(PYTHON) -m venv $(VENV)

$(INSTALLED): requirements.lock requirements-torch.lock pyproject.toml | $(VENV)/bin/pip
	@echo "Installing the locked packages; this takes a few minutes."
	$(BIN)/pip install -qq --no-deps -r requirements.lock
	$(BIN)/pip install -qq --no-deps -r requirements-torch.lock
	$(BIN)/pip install -qq --no-deps -e .
	touch $@

# The weights and limits that `plan` uses: those of the pipeline, taken into the package on purpose.
ship: setup
	python -m guided_lgp.ship

# DVC wants a Git repository; an unpacked archive of the sources has none.
repro: setup
	git rev-parse --git-dir > /dev/null 2>&1 || dvc config --local core.no_scm true
	dvc repro
	-guided-lgp mlflow sync
	python -m guided_lgp.report.pages

# The whole pipeline with small numbers, in a clone of its own, which is made anew.
quick: setup
	rm -rf quick
	git clone -q . quick
	cp tests/params.yaml quick
	rm quick/dvc.lock
	cd quick && MLFLOW_TRACKING_URI=sqlite:///mlflow.db dvc repro
	@echo "Report: quick/reports/report.html"

# Spread over draws, ablations, data efficiency: policies of their own, on the data of `repro`. The
# report shows the spread but cannot depend on it, or `dvc repro` would run the studies.
study: setup
	dvc repro studies/dvc.yaml
	dvc repro -f -s render_reports
	python -m guided_lgp.report.pages

# Families of problems where geometry decides, with policies of their own: an hour. The report
# shows their results without depending on them.
cases: setup
	dvc repro cases/dvc.yaml
	dvc repro -f -s render_reports
	python -m guided_lgp.report.pages

test: lint
	pytest -n auto --dist loadfile --no-loadscope-reorder

lint: setup
	ruff format --check .
	ruff check .
	mypy
	lint-imports

bench: setup
	dvc repro -q generate_scenes
	python benchmarks/run.py

# Keyframes of KOMO, in an environment of its own, beside the coarse bound: a minute.
bench-peers: setup $(PEERS)/.installed
	python benchmarks/run.py peers

$(PEERS)/.installed: benchmarks/peers.txt
	$(PYTHON) -m venv $(PEERS)
	$(PEERS)/bin/pip install -qq --no-deps -r benchmarks/peers.txt
	touch $@

# 390 generated scenes of thirteen kinds, with and without a plan, whose truth is known: minutes.
open-world: setup
	python benchmarks/open_world.py

# The shelf task of guided-tamp-benchmark, judged by that package in an environment of its own.
shelf: setup $(SHELF)/.installed
	python benchmarks/shelf.py

$(SHELF)/.installed: benchmarks/shelf.txt
	$(PYTHON) -m venv $(SHELF)
	$(SHELF)/bin/pip install -qq --no-deps -r benchmarks/shelf.txt
	touch $@

# Random sequences with the other robots and with hand-overs, planned and carried out.
reach: setup
	python benchmarks/robots.py

# The small profile with one worker, with two and on Dask, compared byte by byte.
verify-determinism: setup
	python tests/determinism.py

# The small profile with every process killed at random moments, against an undisturbed run.
verify-interruption: setup
	python tests/interruption.py

# 500 plans in one process, 200 experiments in one database.
verify-load: setup
	python tests/load.py

# The sources that the stages depend on, as they load and read them, into the files of stages.
sources: setup
	python tests/stage_sources.py

# Spoilt input, kills, races, planted files, full disks, odd environments: half an hour.
verify-hostile: setup
	python tests/hostile.py

# Plans under gravity: limits, friction, towers, closed loop: three quarters of an hour on two cores.
verify-execution: setup
	python benchmarks/execution.py

mlflow: setup
	guided-lgp mlflow ui
