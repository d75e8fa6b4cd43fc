//! KHR_texture_basisu: KTX2 images.

use std::fs;
use std::path::Path;

use firsthit_import::scene::{ImageDesc, MaterialModel, Pixels};
use firsthit_import::{ErrorKind, Limits, image};
use proptest::prelude::*;
use serde_json::json;

use super::{asset, read};

fn bytes(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import_packed/data").join(name)).unwrap()
}

fn decoded(bytes: &[u8]) -> Result<ImageDesc, ErrorKind> {
    image::decode(bytes, "test", &Limits::default())
}

fn pixels(image: &ImageDesc) -> &[[u8; 4]] {
    match &image.pixels {
        Pixels::Rgba8(pixels) => pixels,
        _ => panic!("eight bits"),
    }
}

/// The picture before it was compressed.
fn original(x: usize, y: usize, transparent: bool) -> [u8; 4] {
    let inside = |k| (4..10).contains(&k);
    let [r, g, b] = if inside(x) && inside(y) { [255, 0, 0] } else { [12 * x as u8, 10 * y as u8, 128] };
    [r, g, b, if transparent { 13 * x as u8 } else { 255 }]
}

#[test]
fn every_kind_is_decoded() {
    for (kind, tolerance) in [("etc1s", 12.0), ("uastc", 2.0), ("uastc_zstd", 2.0)] {
        for (name, transparent) in [("small", false), ("alpha", true)] {
            let image = decoded(&bytes(&format!("{name}_{kind}.ktx2"))).unwrap();
            assert_eq!((image.width, image.height), (20, 24));
            let mut sum = 0_u64;
            for (i, pixel) in pixels(&image).iter().enumerate() {
                let wanted = original(i % 20, i / 20, transparent);
                sum += (0..4).map(|c| u64::from(pixel[c].abs_diff(wanted[c]))).sum::<u64>();
            }
            let mean = sum as f64 / (4.0 * 480.0);
            println!("{name}_{kind}: mean difference {mean:.2} of 255");
            assert!(mean < tolerance, "{name}_{kind}: {mean}");
        }
    }
    let [plain, packed] = ["alpha_uastc.ktx2", "alpha_uastc_zstd.ktx2"].map(|name| decoded(&bytes(name)).unwrap());
    assert_eq!(pixels(&plain), pixels(&packed));
}

#[test]
fn textures_show_the_image_that_the_extension_names() {
    let Some(path) = asset("ktx2-tile/0.glb") else { return };
    let read = read(&path).unwrap();
    assert!(read.report.warnings.is_empty(), "{:?}", read.report.warnings);
    let scene = read.scene;
    assert_eq!((scene.images[0].width, scene.images[0].height), (1024, 1024));
    let MaterialModel::Pbr(pbr) = &scene.materials[0].model else { panic!() };
    assert_eq!(pbr.base_color_texture.as_ref().unwrap().image, 0);
    // An aerial view of houses and trees: neither dark nor bright, and of many colours.
    let mean: f64 = pixels(&scene.images[0]).iter().map(|p| f64::from(p[1])).sum::<f64>() / (1024.0 * 1024.0);
    assert!((40.0..200.0).contains(&mean), "{mean}");

    // The one that the extension names, though there is another.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.ktx2"), bytes("small_uastc.ktx2")).unwrap();
    let file = json!({
        "asset": {"version": "2.0"},
        "images": [{"uri": "missing.png"}, {"uri": "a.ktx2"}],
        "textures": [{"source": 0, "extensions": {"KHR_texture_basisu": {"source": 1}}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    });
    let path = folder.path().join("made.gltf");
    fs::write(&path, file.to_string()).unwrap();
    let read = super::read(&path).unwrap();
    assert_eq!((read.scene.images[0].width, read.scene.images[0].name.as_str()), (20, "a.ktx2"));
}

#[test]
fn sizes_are_checked_before_decoding() {
    let good = bytes("small_uastc_zstd.ktx2");
    let limits = Limits { image_side: 23, ..Limits::default() };
    assert!(matches!(image::decode(&good, "", &limits), Err(ErrorKind::Limit(_))));
    let limits = Limits { image_bytes: 1919, ..Limits::default() };
    assert!(matches!(image::decode(&good, "", &limits), Err(ErrorKind::Limit(_))));
    let with = |at: usize, value: u64, width: usize| {
        let mut bytes = good.clone();
        bytes[at..at + width].copy_from_slice(&value.to_le_bytes()[..width]);
        decoded(&bytes)
    };
    assert!(matches!(with(96, 1 << 62, 8), Err(ErrorKind::Invalid(c)) if c.contains("are declared for")));
    assert!(matches!(with(88, u64::MAX, 8), Err(ErrorKind::Invalid(c)) if c.contains("leave the file")));
    assert!(matches!(with(36, 6, 4), Err(ErrorKind::Unsupported(_))), "a cube map");
    assert!(matches!(with(20, 0, 4), Err(ErrorKind::Invalid(_))), "no pixel");
    assert!(with(44, 3, 4).is_err() && with(12, 37, 4).is_err());
    for end in 0..good.len() {
        assert!(decoded(&good[..end]).is_err(), "{end} bytes");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn damaged_images_do_no_harm(
        which in 0_usize..3, changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let mut bytes = bytes(["alpha_etc1s.ktx2", "small_uastc.ktx2", "small_uastc_zstd.ktx2"][which]);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Err(error) = decoded(&bytes) {
            prop_assert!(!error.to_string().contains("the decoder failed"), "{}", error);
        }
    }
}
