# Every target installs what it needs into .venv, once: the stamps are older than what they depend on
# only after pyproject.toml or constraints.txt changed.
PYTHON ?= $(shell for name in python3 python3.14 python3.13 python3.12 python3.11; do \
    "$$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && { echo "$$name"; break; }; done)
export PYTHON

VENV_DEPENDS = pyproject.toml constraints.txt
VCAN_PACKAGES = user-mode-linux kmod iproute2 can-utils
C_PACKAGES = gcc libc6-dev
BROWSER_PACKAGES = chromium
PEER_PACKAGES = libusb-1.0-0 libgl1 libegl1 libx11-6 libidn2-0
DURATION ?= 15

.PHONY: help run vcan ecu install test lint bench clean
help:
	@echo "make run      install the core, run the highway scenario for $(DURATION) s"
	@echo "make vcan     the same on a real vcan, with candump beside it"
	@echo "make ecu      build the lane keeping ECU and let it steer on a real vcan for $(DURATION) s"
	@echo "make install  install everything: all extras, Debian packages for vcan, C and browser"
	@echo "make test     run all tests, those of the bus on a real vcan"
	@echo "make lint     style, format, types"
	@echo "make bench    measure, open3d beside it"
	@echo "make clean    remove .venv and what was made"

run: .venv/core
	.venv/bin/vsensor run --duration $(DURATION)

vcan: .venv/core
	@tools/debian $(VCAN_PACKAGES)
	tools/vcan tools/show_vcan --duration $(DURATION)

ecu: .venv/core
	@tools/debian $(VCAN_PACKAGES) $(C_PACKAGES)
	tools/ecu/build
	tools/vcan .venv/bin/python -m tools.ecu.closed_loop --seconds $(DURATION)

install: .venv/test
	@tools/debian $(VCAN_PACKAGES) $(C_PACKAGES) $(BROWSER_PACKAGES)

test: .venv/test
	@tools/debian $(VCAN_PACKAGES) $(C_PACKAGES) $(BROWSER_PACKAGES)
	.venv/bin/python tools/test.py

lint: .venv/lint
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy --strict vsensor

bench: .venv/bench
	@tools/debian $(PEER_PACKAGES) $(VCAN_PACKAGES) $(BROWSER_PACKAGES)
	.venv/bin/python -m tools.bench

clean:
	rm -rf .venv build dist out .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find vsensor tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# Each level holds the ones before it, so that no target installs twice what another has installed.
.venv/core: $(VENV_DEPENDS)
	@tools/venv $@ ""

.venv/test: $(VENV_DEPENDS)
	@tools/venv $@ "[test]"
	@touch .venv/core

.venv/bench: $(VENV_DEPENDS)
	@tools/venv $@ "[test,peers]"
	@touch .venv/core .venv/test

.venv/lint: $(VENV_DEPENDS)
	@tools/venv $@ "[dev]"
	@touch .venv/core .venv/test
