# Each target does its own set-up (scripts/setup.sh): on a bare Debian 12 with Rust, `make demo` is all it takes.
#
#     make demo     renders a recording into demo/, measures it, says where the page is
#     make test     all tests
#     make test-cluster  shards by Slurm and Snakemake on this machine (scripts/test_cluster.sh says what it needs)
#     make figures  makes the tables and pictures of docs/accuracy.md anew (half an hour)
#     make golden   writes the golden results anew and says what moved
#     make schemas  writes docs/schemas/ from the types
#     make lint     format, clippy, documentation: as CI does
#     make build    the program, target/debug/track
#     make install  the program on the PATH (cargo's folder; a release build)
#     make deb      a Debian package, target/debian/track_*.deb
#     make test-deb that package installed in a bare Debian 12 (root, debootstrap) and the demo measured there
#     make setup    what a build needs, and nothing else

SHELL := /bin/bash

# rustup puts cargo there, but only login shells learn of it.
export PATH := $(PATH):$(or $(CARGO_HOME),$(HOME)/.cargo)/bin

# The dev profile is optimised (Cargo.toml), so demo and tests share one build; a release build takes 5 minutes more from
# cold (two cores) and makes the demo hardly faster.
CARGO_BUILD := cargo build --locked
# (`cargo run` looks through the sources once more, each time.)
TRACK := $(or $(CARGO_TARGET_DIR),target)/debug/track

SCENE := fixtures/scenes/steel_ball.scene.json
DEMO := demo/steel_ball

.PHONY: demo test test-cluster figures golden schemas lint build install deb test-deb setup

demo: build
	$(TRACK) simulate $(SCENE) --out demo
	$(TRACK) $(DEMO).mp4 --calib $(DEMO).calib.json --out demo
	@printf '\nThe page, for your browser: file://%s\n' '$(CURDIR)/$(DEMO).report.html'

test: setup
	cargo test --locked

test-cluster: build
	scripts/test_cluster.sh

# Also docs/demo.svg: the picture of the demo's page, with what is drawn on it.
figures: demo
	scripts/figures.sh
	$(TRACK) $(DEMO).mp4 --calib $(DEMO).calib.json --out target/figures --formats svg
	cp target/figures/steel_ball.picture.svg docs/demo.svg

# After a change that is meant to move numbers; look at the difference before it is committed.
golden: setup
	TRACK_GOLDEN=refresh cargo test --locked --test all golden:: -- --nocapture | grep -E '^moved|^test result' || true

schemas: setup
	TRACK_SCHEMAS=refresh cargo test --locked --test all schemas::

lint:
	@scripts/setup.sh --lint
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
	RUSTDOCFLAGS=-Dwarnings cargo doc --locked --no-deps

build: setup
	$(CARGO_BUILD)

install: setup
	cargo install --locked --path .

deb: setup
	scripts/deb.sh

test-deb: deb
	scripts/test_deb.sh

setup:
	@scripts/setup.sh
