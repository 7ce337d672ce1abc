#!/usr/bin/env bash
# Builds web/dist/live.html: the solver as WebAssembly, and the page around it. It takes Node.js and
#   rustup target add wasm32-unknown-unknown
# or, where rustup has no network, Debian's packages rustc-web, cargo-web, rust-web-src and lld-19.
# Ends with status 3 where neither is there.
set -euo pipefail
cd "$(dirname "$0")/.."
target=wasm32-unknown-unknown
solver=target/$target/web/leafdyn_web.wasm
options=(build --profile web --package leafdyn-web --target "$target" --locked)
# Vector instructions, which all browsers have: the leaf of Fig. 4 in 2.8 ms in place of 3.3.
export RUSTFLAGS="-C target-feature=+simd128"

if rustup target list --installed 2>/dev/null | grep -qx "$target"; then
    cargo "${options[@]}"
elif [ -d /usr/src/rustc-1.85.0/library ] && [ -x /usr/bin/cargo ] && command -v wasm-ld-19 >/dev/null; then
    # Its compiler is older than the one that is asked for, and has the standard library as source.
    export PATH=/usr/bin:$PATH RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
    export RUSTC_WRAPPER=$PWD/web/older-rustc.sh CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=wasm-ld-19
    /usr/bin/cargo "${options[@]}" --ignore-rust-version -Z build-std=std,panic_abort
else
    echo "web/build.sh: there is no Rust for $target: rustup target add $target, or on Debian" >&2
    echo "  apt-get install rustc-web cargo-web rust-web-src lld-19" >&2
    exit 3
fi
node web/page.mjs "$solver"
