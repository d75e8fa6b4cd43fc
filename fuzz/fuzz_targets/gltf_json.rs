#![no_main]
firsthit_fuzz::files!(gltf_json);
