#!/usr/bin/env bash
# Renders the pictures of docs/effects.md again: bash docs/effects/make.sh FOLDER_OF_SAMPLE_MODELS
# The folder has khronos/NAME/... in it, as the Khronos sample assets are laid out.
set -euo pipefail
cd "$(dirname "$0")/../.."
[ -n "${FIRSTHIT:-}" ] || cargo build --release
out=docs/effects
# MODEL NAME, then effects: the picture with all, and without each.
ablate() {
  local model=$1 name=$2
  shift 2
  local render=(${FIRSTHIT:-target/release/firsthit} render "$model" --resolution 256x192 --spp 128 --quiet)
  "${render[@]}" -o "$out/$name.png"
  for effect in "$@"; do
    "${render[@]}" --effects "auto,-$effect" -o "$out/$name-without-$effect.png"
  done
}
ablate assets/flight-helmet/FlightHelmet.gltf helmet textures normal-maps reflection indirect-light
ablate assets/cornell-box/CornellBox-Sphere.obj cornell area-lights shadows refraction indirect-light
if [ $# -gt 0 ]; then
  ablate "$1/khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf" lamp punctual-lights environment transmission textures
fi
