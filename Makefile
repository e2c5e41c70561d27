# Every developer verb; `make help` lists them. .ci/run runs `make test` and `make lint`; with TEGA_CI=all `make slow` and
# .ci/extras too, which makes environments of its own.
VENV ?= .venv
BIN := $(VENV)/bin
TOOLS := $(CURDIR)/tools/emulators:$(CURDIR)/tools/campaigns:$(CURDIR)/tools/figures
ARM64 := aarch64-unknown-linux-gnu
PYTHON ?= python3
.DEFAULT_GOAL := help
.PHONY: help setup build test slow guards letting-go deep stress lint fmt fuzz bench counts figures msrv licences arm64 wheels site pictures shots measured mutants words clean

help: ## print this
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## /\t/' | expand -t 10

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

setup: $(BIN)/python ## virtual environment with everything a developer needs
	$(BIN)/pip install --quiet maturin '.[lint]'
	$(MAKE) build
	$(BIN)/pip install --quiet --editable tools/emulators --editable tools/campaigns --editable tools/figures

build: ## release build of the extension into the virtual environment, editable
	VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --quiet

test: ## everything that needs no waiting, Rust tests included, on all cores
	$(BIN)/python -m pytest

slow: ## what waits in true time: emulated devices, sessions, kills, soaks; then the day's third of the guards
	$(BIN)/python -m pytest -m 'slow and not deep'
	$(MAKE) guards THIRD=today

guards: ## tests have to fail without the guard they show; all of them into tests/hazards/guards-seen.md (THIRD=today: a third)
	PYTHONPATH=tests $(BIN)/python -m hazards.without $(if $(THIRD),--third $(THIRD),--page)

letting-go: ## every signal to each process of a program and to several at once, into docs/evidence/faults.md
	PYTHONPATH=tests $(BIN)/python -m hazards.letting_go

deep: ## what computes for long: all tests marked deep, and each property with 2,000 examples
	HYPOTHESIS_PROFILE=deep $(BIN)/python -m pytest -m deep
	HYPOTHESIS_PROFILE=deep $(BIN)/python -m pytest tests/*/property

stress: ## the properties at the ends of the number range, into docs/evidence/installing.md
	PYTHONPATH=tests $(BIN)/python tests/tega/property/stress_page.py docs/evidence/installing.md

lint: ## formatting, clippy, ruff, mypy, layers, stub against extension
	cargo fmt --all --check
	cargo fmt --check --manifest-path fuzz/Cargo.toml
	cargo fmt --check --manifest-path benches/Cargo.toml
	cargo clippy --workspace --all-targets --locked -- -D warnings
	cargo clippy --manifest-path fuzz/Cargo.toml --all-targets --locked -- -D warnings
	cargo clippy --manifest-path benches/Cargo.toml --all-targets --locked -- -D warnings
	RUSTDOCFLAGS='-D warnings' cargo doc --workspace --no-deps --locked --quiet
	$(if $(shell rustup target list --installed 2>/dev/null | grep $(ARM64)),cargo clippy --workspace --exclude tega-py --lib \
		--target $(ARM64) --locked -- -D warnings,@echo 'arm64 kernels not checked: rustup target add $(ARM64)')
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/mypy
	$(BIN)/mypy --platform win32 --follow-imports silent python
	$(BIN)/mypy --platform darwin --follow-imports silent python
	$(BIN)/python -m mypy.stubtest tega._native
	$(BIN)/python -m pytest -q tests/tega/unit/test_crate_files.py

fmt: ## rustfmt, ruff format, ruff --fix
	cargo fmt --all
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# Stable with the nightly switches let through; the code is built as it ships, without `cfg(fuzzing)`.
fuzz: ## one fuzz target for five minutes: make fuzz T=name (needs cargo-fuzz)
	cd fuzz && mkdir -p corpus/$(T) && RUSTC_BOOTSTRAP=1 cargo fuzz run --no-cfg-fuzzing --features libfuzzer $(FUZZ) $(T) \
		corpus/$(T) seeds/$(T) -- -max_total_time=300

bench: ## run time against error, then the kernels without Python
	$(BIN)/tega-teleop bench
	cd benches && cargo bench --quiet

figures: ## measure on an idle machine, and write benches/results.json and docs/evidence/pareto.md
	$(BIN)/python benches/figures.py

counts: ## instruction counts against the committed ones (needs valgrind; UPDATE=1 rewrites them)
	$(BIN)/python benches/counts.py $(if $(UPDATE),--update)

msrv: ## the crates on the oldest compiler that Cargo.toml names (needs rustup)
	cargo +$(shell sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml).0 check --workspace --all-targets --locked

licences: ## of every crate and package; known faults where cargo-deny and pip-audit are installed
	$(BIN)/python .ci/licences

# Debian: qemu-user gcc-aarch64-linux-gnu libc6-dev-arm64-cross; rustup target add aarch64-unknown-linux-gnu.
arm64: ## the crates' tests on an emulated arm64 processor, NEON kernels included
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
	CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER='qemu-aarch64 -L /usr/aarch64-linux-gnu' \
	cargo test --workspace --exclude tega-py --release --locked --target aarch64-unknown-linux-gnu

wheels: ## Linux wheels for x86-64 and arm64, each tried in an environment of its own; then the examples with the first
	PYTHON=$(PYTHON) .ci/wheels
	TEGA_WHEEL=$$(echo dist/tega-*x86_64.whl) $(BIN)/python -m pytest -n0 -q -k contract tests/docs/test_own_packages.py

site: ## all pages with search, commands, settings and Python, into target/site; needs the extra docs, no network
	PYTHONPATH=$(TOOLS) \
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict

# docs/images/placement-emg.svg and placement-vest.svg are drawn by hand. pareto.png comes with `make figures`.
pictures: ## the drawn pictures of the docs, and the demo's animation; needs lab, observe, record, sim, study, view
	$(BIN)/python docs/images/draw.py
	$(BIN)/python docs/images/draw_tutorials.py
	$(BIN)/python -m tega_figures.program_diagrams docs/images
	$(BIN)/python -m tega_figures.byte_layouts docs/images
	$(BIN)/python -m tega_figures.placement_left docs/images
	$(BIN)/python -m tega_figures.page_plots docs/images
	$(BIN)/python -m tega_figures.terminal_shots docs/images
	$(BIN)/python -m tega_figures.simulated_person picture docs/images/sim-emg.png
	$(BIN)/python -m tega_figures.scene.picture docs/images/scene.webp docs/images/scene-tags.svg
	$(BIN)/python -m tega_figures.study_console docs/images/study-console.svg
	$(BIN)/tega-teleop demo --fast --out target/demo
	cp target/demo/demo.png docs/images/demo.png

# A browser draws page, report and terminal. Without a graphics card that takes ten minutes. The report's pictures are of
# 72 trials; the figures of the pages on evidence are of 600, which take an hour and more.
shots: ## the pictures that take a Chromium (Debian: apt install chromium) and the extra browser: page, report, calibration
	$(BIN)/python -m tega_figures.page_shots docs/images
	$(BIN)/python -m tega_figures.calibrate_shots docs/images/calibrate-emg.webp
	$(BIN)/tega-teleop study simulate --operators 4 --trials 3 --seed 1 --out target/study
	$(BIN)/python -m tega_figures.report_shots target/study/report.html docs/images

measured: ## the pictures of the simulated world, of an hour of faults, and of the cost of fingers (on a quiet machine)
	$(BIN)/python -m tega_figures.bench.fingers docs/images/fingers.png
	$(BIN)/python -m tega_figures.world.pictures docs/images
	$(BIN)/tega-teleop soak --seconds 3600 --seed 7 --out target/soak
	cp target/soak/faults.png docs/images/soak.png

# It needs: pip install 'tools/campaigns[mutants]', cargo install cargo-mutants. It goes on where it was ended.
mutants: ## change the hot paths in one place at a time; count the changes that no test detects; hours, on one core
	PYTHONPATH=$(TOOLS) $(BIN)/python -m tega_campaigns.mutants cover
	PYTHONPATH=$(TOOLS) $(BIN)/python -m tega_campaigns.mutants python --n 200 --seed 1
	PYTHONPATH=$(TOOLS) $(BIN)/python -m tega_campaigns.mutants rust --n 100 --seed 1
	PYTHONPATH=$(TOOLS) $(BIN)/python -m tega_campaigns.mutants table

words: ## what pages name and show is there; words of pages, help, messages and docstrings per 10,000, by plain English
	$(BIN)/python -m pytest -m words
	$(BIN)/python tools/words.py

clean: ## remove build output
	rm -rf target fuzz/target benches/target dist $(VENV)
