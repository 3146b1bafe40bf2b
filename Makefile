# Every target sets up what it needs first; what is there already is left alone.
export PATH := $(HOME)/.cargo/bin:$(PATH)

.PHONY: all setup build demo test soak lint bench clean
all: build

setup:
	@sh .ci/setup

build: setup
	cargo build --release --locked

# Simulates a scene, reconstructs it, evaluates it against the truth and writes pictures to out/demo.
demo: build
	target/release/thirdbounce demo --out out/demo

test: setup
	cargo test --locked

# The long tests: long runs, every injected fault. They write docs/reliability.md.
soak: setup
	cargo test --release --locked --test reliability -- --ignored

lint: setup
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings

bench: setup
	cargo bench --locked

clean:
	cargo clean
	rm -rf out
