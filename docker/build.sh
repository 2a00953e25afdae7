#!/bin/sh
# Builds both programs as static binaries for a processor (see TARGET_CPU in the Dockerfile) into /out.
set -eu
# With an explicit target, the flags apply to the programs only; macros and build scripts cannot be static.
target=$(rustc --version --verbose | sed -n 's/^host: //p')
export RUSTFLAGS="-C target-feature=+crt-static -C target-cpu=$1"
cargo build --locked --profile dist --target "$target" --package grasp-server --features grasp-server/otlp --package grasp-cli
mkdir -p /out/objects /out/saved
for package in grasp-server grasp-cli; do
    features=
    if [ $package = grasp-server ]; then features=otlp; fi
    print-sbom $package "$target" $features > "/out/$package.sbom.json"
done
cp "target/$target/dist/grasp-server" "target/$target/dist/grasp" /out/
