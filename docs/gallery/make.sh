#!/usr/bin/env bash
# Renders the pictures of docs/gallery.md again, with no flags: bash docs/gallery/make.sh FOLDER OF SAMPLE MODELS
# The folder has balloon/ and khronos/NAME/ in it. A picture takes at most a minute; its words say how long it took.
set -euo pipefail
models=$(realpath "$1")
cd "$(dirname "$0")/../.."
cargo build --release
cargo build --release -p firsthit-tests --bin contact-sheet
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
picture() {
  target/release/firsthit render "$2" -o "$work/$1.png"
  target/release/contact-sheet "docs/gallery/$1.png" 1 400x225 "$work/$1.png"
}
khronos() { picture "$1" "$models/khronos/$2/glTF-Binary/$2.glb"; }

picture flight-helmet assets/flight-helmet/FlightHelmet.gltf
picture spot assets/spot/spot.toml
picture cornell-mirror assets/cornell-box/CornellBox-Mirror.obj
picture balloon "$models/balloon/scene.gltf"
picture lamp "$models/khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf"
khronos sofa GlamVelvetSofa
khronos suzanne IridescenceSuzanne
khronos transmission TransmissionTest
khronos rough-glass TransmissionRoughnessTest
khronos car-paint ClearCoatCarPaint

# The picture of the README: 64 samples, shown at two thirds.
target/release/firsthit render assets/flight-helmet/FlightHelmet.gltf -s 64 -o "$work/readme.png"
target/release/contact-sheet assets/gallery/flight-helmet.png 1 853x480 "$work/readme.png"
