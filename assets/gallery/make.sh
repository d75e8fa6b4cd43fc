#!/usr/bin/env bash
# Renders the gallery again: bash assets/gallery/make.sh [FOLDER OF SAMPLE MODELS]
# Without the folder (with balloon/, shaderball-usd/ and khronos/NAME/glTF-Binary/NAME.glb in it)
# only the pictures of the models that are shipped here are made.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build --release
out=assets/gallery
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# By Whitted's method, 16 samples where nothing else is said.
render() { target/release/firsthit render --integrator whitted --max-depth 8 "$@" --quiet; }

# The pictures of the lecture; docs/gallery/make.sh makes those of the README and of docs/gallery.md.
render assets/scenes/whitted.toml -s 64 --resolution 960x540 -o $out/whitted.png
render assets/scenes/layers.toml -s 64 --resolution 720x405 -o $out/layers.png
small=(--resolution 480x270 -s 64)
render assets/scenes/shapes.toml "${small[@]}" -o $out/lecture-shapes.png
render assets/scenes/section.toml "${small[@]}" --clip-plane 0,0,1,0 -o $out/lecture-section.png
render assets/scenes/lecture-shadows.toml "${small[@]}" -o $out/lecture-shadows.png
render assets/scenes/lecture-optics.toml "${small[@]}" -o $out/lecture-optics.png
render assets/scenes/lecture-polygon.toml "${small[@]}" -o $out/lecture-polygon.png
render assets/spot/spot.toml "${small[@]}" --integrator normal -o $out/lecture-normal.png
render assets/spot/spot.toml "${small[@]}" --integrator ao -o $out/lecture-occlusion.png
render assets/spot/spot.toml "${small[@]}" --integrator barycentric -o $out/lecture-barycentric.png

# The contact sheet: no flag but the integrator and the size.
models=(
  assets/flight-helmet/FlightHelmet.gltf assets/spot/spot.toml assets/cornell-box/CornellBox-Original.obj
  assets/cornell-box/CornellBox-Sphere.obj assets/cornell-box/CornellBox-Mirror.obj assets/lights-punctual/lights.gltf
)
if [ $# -gt 0 ]; then
  models+=("$1"/balloon/scene.gltf "$1"/shaderball-usd/usd-shaderball-ball.glb)
  for name in AlphaBlendModeTest AttenuationTest BoxVertexColors EmissiveStrengthTest Fox GlamVelvetSofa \
    GlassBrokenWindow MetalRoughSpheresNoTextures MultiUVTest NegativeScaleTest NormalTangentMirrorTest \
    OrientationTest SpecularTest TextureCoordinateTest TextureEncodingTest TextureSettingsTest \
    TransmissionRoughnessTest TransmissionTest UnlitTest VertexColorTest; do
    models+=("$1"/khronos/$name/glTF-Binary/$name.glb)
  done
  models+=("$1"/khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf "$1"/khronos/TextureTransformTest/glTF/TextureTransformTest.gltf)
fi
pictures=()
for model in "${models[@]}"; do
  picture=$work/${#pictures[@]}.png
  render "$model" --resolution 640x480 -o "$picture"
  pictures+=("$picture")
done
cargo run --release -p firsthit-tests --bin contact-sheet -- $out/sheet.png 6 240x180 "${pictures[@]}"
