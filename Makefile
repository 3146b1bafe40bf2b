# Every target sets up what it needs first; what is there already is left alone.
export PATH := $(HOME)/.cargo/bin:$(PATH)

.PHONY: all setup build library libraries demo test python-test dist instrumented sanitize soak lint api header install bench bench-page clean
all: build

setup:
	@sh .ci/setup

# Shown by --version.
export THIRDBOUNCE_COMMIT := $(shell git rev-parse --short HEAD 2>/dev/null)

# Features of packages. The filters of HDF5 reach down to the crate that reads captures: with them, all that `make demo` built would be built again.
PACKAGED := --features thirdbounce-command/hdf5-filters

# Programs beside the command, which `make demo` leaves out.
BESIDE := thirdbounce-benchmark thirdbounce-live thirdbounce-tags thirdbounce-track

# What cargo built, here or in the folder of its variable.
RELEASE := $(or $(CARGO_TARGET_DIR),target)/release

build: setup
	@[ -x $(RELEASE)/thirdbounce ] || echo "build: the first time takes about four minutes on two cores"
	cargo build --release --locked --bins

# Simulates a scene, reconstructs it, evaluates it against the truth and writes pictures to out/demo. Builds the command alone;
# `make build` takes it over.
demo: setup
	@[ -x $(RELEASE)/thirdbounce ] || echo "demo: building takes about three minutes on two cores the first time"
	cargo build --release --locked --bin thirdbounce
	$(RELEASE)/thirdbounce demo --out out/demo

TESTED = $(COMMAND) $(FEATURES) $(addprefix --package ,shares thirdbounce thirdbounce-command $(BESIDE) thirdbounce-capi)
# One failing program does not end it: the others run, and what failed is listed last. With the dependencies and the library that `make demo` built. COMMAND, FEATURES: how cargo builds the command, if not as for users.
test: setup
	@[ -d $(RELEASE)/examples ] || echo "test: building and running all tests takes about ten minutes on two cores the first time"
	@failed=; run() { .ci/timed cargo "$$@" || failed="$$failed\n  cargo $$*"; }; export THIRDBOUNCE_TESTED='$(TESTED)'; \
	run test --release --locked --no-fail-fast --config .ci/unoptimised.toml $(FEATURES) --lib; \
	run build --release --locked $(COMMAND) $(FEATURES) --examples; \
	run test --release --locked --no-fail-fast $(TESTED) --bins --test '*'; \
	run test --release --locked --no-fail-fast $(COMMAND) $(FEATURES) --doc; \
	[ -z "$$failed" ] || { printf "failed:$$failed\n"; exit 1; }

# The Python package, from its wheel in an empty virtual environment. Where there is no Python or no network, it says so.
python-test: setup
	@.ci/python-test

# A tarball, a wheel and a Debian package, for Linux with glibc 2.28 or later, in dist/.
dist: setup
	@echo "dist: everything is built anew for an older glibc: about twenty minutes on two cores the first time"
	@.ci/dist

# Kernels and solvers under GPU-assisted validation: the layer checks every access inside the kernels.
instrumented: setup
	THIRDBOUNCE_UNOPTIMISED=1 THIRDBOUNCE_TEST_INSTRUMENTED=1 cargo test --release --locked --test kernels --test solvers

# The C and C++ programs under the address, undefined-behaviour and thread sanitizers.
sanitize: setup
	cargo test --release --locked --package thirdbounce-capi -- --ignored

# The long tests: long runs, every injected fault, whole solves of every kind, kernels at each vector width of lavapipe. Those of reliability write benches/results/reliability.tsv.
soak: setup
	cargo test --release --locked $(PACKAGED) --test reliability --test kernels --test solvers --test files --test cli --test benchmark -- --ignored

# The public interface is listed in public-api/thirdbounce.rs, so that a change of it shows in the change itself. What goes
# from the list or changes in it breaks who depends on it: raise the version's second number. cargo-semver-checks and
# cargo-public-api would judge that themselves, but install for minutes, build the crate twice, and the latter needs a nightly
# compiler; the list is read from the source in seconds, the same with every compiler.
# In the profile of releases, macros and the programs of builds are those that `make demo` built. The library alone, without its
# features: public-api asks for no other features of crates than all parts together do, so that few are compiled again.
ROOTS := src/lib.rs $(sort $(wildcard crates/*/src/lib.rs))
lint: setup
	cargo fmt --all --check
	cargo clippy --release --locked $(PACKAGED) --workspace --all-targets -- -D warnings
	cargo clippy --release --locked --package thirdbounce --package public-api -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps
	cargo run --locked --quiet --package public-api $(ROOTS) | diff -u public-api/thirdbounce.rs - || \
		{ echo "the public interface changed: \`make api\`, and look at what changed"; exit 1; }
	@if command -v cbindgen >/dev/null; then \
		cbindgen --config capi/cbindgen.toml --crate thirdbounce-capi capi | diff -u include/thirdbounce.h - || \
			{ echo "the C interface changed: \`make header\`, and look at what changed"; exit 1; }; \
	else echo "skipped: the C header is not compared, as cbindgen is not installed"; fi
	cd crates/export/assets && sha256sum --check --quiet SHA256SUMS
	@if command -v cargo-deny >/dev/null; then cargo deny --locked check; \
	else echo "skipped: advisories, licences and sources are not checked, as cargo-deny is not installed"; fi

api: setup
	cargo run --locked --quiet --package public-api $(ROOTS) > public-api/thirdbounce.rs

# Writes the C header anew. Needs `cargo install cbindgen`.
header:
	cbindgen --config capi/cbindgen.toml --crate thirdbounce-capi --output include/thirdbounce.h capi

# The C library, for programs that are linked in the clone.
library: setup
	@[ -f $(RELEASE)/libthirdbounce.so ] || echo "library: the first time takes minutes"
	cargo build --release --locked --package thirdbounce-capi
	ln -sf libthirdbounce.so $(RELEASE)/$(SONAME)

# Everything that `make install` installs.
libraries: build
	cargo build --release --locked $(PACKAGED) --workspace --exclude thirdbounce-python --exclude fixtures --exclude tag-fixtures --exclude public-api

# Installs the command and the programs beside it with a manual page for every verb and completions for shells, the C library, its headers, and its files
# for pkg-config and CMake below PREFIX. DESTDIR goes before it, for packages. With sudo, the user who
# called it compiles: root may have no Rust.
PREFIX ?= /usr/local
VERSION := $(shell sed -n '/^version/{s/[^0-9.]//gp;q}' capi/Cargo.toml)
SONAME := libthirdbounce.so.$(basename $(VERSION))
install:
	$(if $(SUDO_USER),sudo -H -u $(SUDO_USER)) $(MAKE) libraries
	install -d $(DESTDIR)$(PREFIX)/bin
	install -m 755 -s $(addprefix $(RELEASE)/,thirdbounce $(BESIDE)) $(DESTDIR)$(PREFIX)/bin
	$(RELEASE)/shares $(DESTDIR)$(PREFIX)/share
	install -d $(DESTDIR)$(PREFIX)/lib/pkgconfig $(DESTDIR)$(PREFIX)/lib/cmake/thirdbounce $(DESTDIR)$(PREFIX)/include
	install -m 755 -s $(RELEASE)/libthirdbounce.so $(DESTDIR)$(PREFIX)/lib/libthirdbounce.so.$(VERSION)
	ln -sf libthirdbounce.so.$(VERSION) $(DESTDIR)$(PREFIX)/lib/$(SONAME)
	ln -sf $(SONAME) $(DESTDIR)$(PREFIX)/lib/libthirdbounce.so
	install -m 644 $(RELEASE)/libthirdbounce.a $(DESTDIR)$(PREFIX)/lib
	install -m 644 include/thirdbounce.h include/thirdbounce.hpp $(DESTDIR)$(PREFIX)/include
	sed 's|@PREFIX@|$(PREFIX)|; s|@VERSION@|$(VERSION)|' capi/thirdbounce.pc.in \
		> $(DESTDIR)$(PREFIX)/lib/pkgconfig/thirdbounce.pc
	install -m 644 capi/cmake/thirdbounceConfig.cmake $(DESTDIR)$(PREFIX)/lib/cmake/thirdbounce
	sed 's|@VERSION@|$(VERSION)|' capi/cmake/thirdbounceConfigVersion.cmake.in \
		> $(DESTDIR)$(PREFIX)/lib/cmake/thirdbounce/thirdbounceConfigVersion.cmake

bench: setup
	cargo bench --locked

# Runs the standard benchmark and the stiff cases, stores their numbers in benches/results/benchmark.json, and renews the curve and
# the tables of README.md and docs/accuracy.md. Continues an interrupted run; `rm -r out/benchmark` begins anew.
bench-page: build
	$(RELEASE)/thirdbounce benchmark --out out/benchmark
	cargo bench --locked --bench builds -- stability --pages out/benchmark/benchmark.json

clean:
	cargo clean
	rm -rf out dist
