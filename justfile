# `just ci` is what continuous integration runs.

# everything a change must pass
ci:
    bash .ci/run

# the tests, as in the README
test:
    cargo test --workspace --release

# the tests with the long sweeps
test-slow:
    MEDIAL_SLOW=1 cargo test --workspace --release

# formatting and lints
lint:
    cargo fmt --all -- --check
    cargo clippy --workspace --release --all-targets -- -D warnings

# documentation of the library
doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --release

# criterion benchmarks; `just bench delaunay` runs one stage
bench stage="":
    cargo bench {{ if stage == "" { "" } else { "--bench " + stage } }}

# the main job on built-in bones
demo:
    cargo run --release -- demo
