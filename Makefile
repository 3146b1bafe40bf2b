# Every target sets up what it needs first; what is there already is left alone.
export PATH := $(HOME)/.cargo/bin:$(PATH)

.PHONY: all setup build demo test instrumented soak lint api bench clean
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

# Kernels and solvers under GPU-assisted validation: the layer checks every access inside the kernels.
instrumented: setup
	THIRDBOUNCE_UNOPTIMISED=1 THIRDBOUNCE_TEST_INSTRUMENTED=1 cargo test --locked --test kernels --test solvers

# The long tests: long runs, every injected fault. They write docs/reliability.md.
soak: setup
	cargo test --release --locked --test reliability -- --ignored

# The public interface is listed in public-api/thirdbounce.rs, so that a change of it shows in the change itself. What goes
# from the list or changes in it breaks who depends on it: raise the version's second number. cargo-semver-checks and
# cargo-public-api would judge that themselves, but install for minutes, build the crate twice, and the latter needs a nightly
# compiler; the list is read from the source in seconds, the same with every compiler.
lint: setup
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings
	cargo clippy --locked --no-default-features -- -D warnings
	cargo clippy --locked --no-default-features --features formats -- -D warnings
	cargo clippy --locked --no-default-features --features cli -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps
	cargo run --locked --quiet --package public-api src/lib.rs | diff -u public-api/thirdbounce.rs - || \
		{ echo "the public interface changed: \`make api\`, and look at what changed"; exit 1; }

api: setup
	cargo run --locked --quiet --package public-api src/lib.rs > public-api/thirdbounce.rs

bench: setup
	cargo bench --locked

clean:
	cargo clean
	rm -rf out
