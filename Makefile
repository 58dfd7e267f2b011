# What a newcomer and the CI run. Needs Python >= 3.11 with pip >= 22.3; everything else goes to .venv.
#
#   make demo                     simulate a robot, map its drive, tell where the picture is
#   make demo LOG=path/to/a.clf   the same for a recorded CARMEN log
#   make test                     all tests
#   make lint                     style, types, contracts between packages, protobuf rules
#   make lock                     requirements.lock anew from pyproject.toml

PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/.installed

.PHONY: demo test lint lock install

ifdef LOG
demo: install
	$(BIN)/gridwright replay "$(LOG)"
else
demo: install
	$(BIN)/gridwright simulate out/demo/building.clf
	$(BIN)/gridwright replay out/demo/building.clf --out out/demo
	$(BIN)/gridwright evaluate out/demo/trajectory.tum out/demo/building.relations
endif

test: install
	$(BIN)/pytest

lint: install
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/buf lint proto
	$(BIN)/buf format --diff --exit-code proto

lock: install
	$(BIN)/uv pip compile pyproject.toml --extra server --group dev --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-header --quiet --upgrade --output-file requirements.lock

install: $(INSTALLED)

# Without ensurepip, which some distributions pack apart: the machine's pip installs into the new environment.
$(INSTALLED): requirements.lock pyproject.toml proto/build_hook.py $(wildcard proto/gridwright/v1/*.proto)
	@$(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "Gridwright needs Python >= 3.11: make PYTHON=python3.11")'
	$(PYTHON) -m venv --without-pip .venv
	$(PYTHON) -m pip --python $(BIN)/python --disable-pip-version-check --quiet install \
		--require-hashes --requirement requirements.lock
	$(PYTHON) -m pip --python $(BIN)/python --disable-pip-version-check --quiet install --no-deps --editable .
	touch $@
