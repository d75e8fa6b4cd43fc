//! EXT_lights_image_based.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use firsthit_import::scene::{EnvironmentDesc, Pixels};
use firsthit_import::{Imported, SceneDesc};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

use super::read;

/// A scene in a cube of faces with one colour each; on the faces of the sides the upper half is brighter.
fn cube(light: &Value) -> Result<Imported, firsthit_import::ImportError> {
    let folder = tempfile::tempdir().unwrap();
    let colors: [[u8; 3]; 6] = [[255, 0, 0], [0, 255, 255], [0, 255, 0], [255, 0, 255], [0, 0, 255], [255, 255, 0]];
    for (k, color) in colors.into_iter().enumerate() {
        let face = image::RgbaImage::from_fn(8, 8, |_, y| {
            // RGBD: divided by alpha.
            let divisor = if y < 4 { 51 } else { 255 };
            image::Rgba([color[0], color[1], color[2], divisor])
        });
        face.save(folder.path().join(format!("{k}.png"))).unwrap();
    }
    let file = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_lights_image_based"],
        "images": (0..6).map(|k| json!({"uri": format!("{k}.png")})).collect::<Vec<_>>(),
        "scenes": [{"extensions": {"EXT_lights_image_based": {"light": 0}}}],
        "extensions": {"EXT_lights_image_based": {"lights": [light]}},
    });
    let path = folder.path().join("made.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    read(&path)
}

/// What comes from a direction.
fn from(scene: &SceneDesc, d: DVec3) -> Vec3 {
    let Some(EnvironmentDesc::LatLong { image, rotation, scale }) = scene.environment else { panic!("no map") };
    assert_eq!(rotation, 0.0);
    let image = &scene.images[image];
    let Pixels::Rgb32F(pixels) = &image.pixels else { panic!("floats") };
    let (u, v) = ((d.x.atan2(-d.z) / TAU).rem_euclid(1.0), d.normalize().y.acos() / PI);
    let at = |x: f64, n: u32| ((x * f64::from(n)) as usize).min(n as usize - 1);
    Vec3::from(pixels[at(v, image.height) * image.width as usize + at(u, image.width)]) * scale
}

#[test]
fn the_faces_of_the_cube_are_where_they_belong() {
    let light = json!({"intensity": 2, "specularImageSize": 8, "specularImages": [[0, 1, 2, 3, 4, 5]],
        "irradianceCoefficients": vec![[0, 0, 0]; 9]});
    let imported = cube(&light).unwrap();
    assert!(
        imported.report.warnings.iter().all(|w| w.message.contains("no surface")),
        "{:?}",
        imported.report.warnings
    );
    let scene = imported.scene;
    for (direction, color) in
        [(DVec3::X, [1, 0, 0]), (DVec3::NEG_X, [0, 1, 1]), (DVec3::Z, [0, 0, 1]), (DVec3::NEG_Z, [1, 1, 0])]
    {
        let color = Vec3::from(color.map(|c: i32| c as f32));
        let (above, below) = (from(&scene, direction + 0.5 * DVec3::Y), from(&scene, direction - 0.5 * DVec3::Y));
        // Twice, by the intensity; five times, by alpha.
        assert!(
            (above - 10.0 * color).length() < 1e-4 && (below - 2.0 * color).length() < 1e-4,
            "{direction}: {above}"
        );
    }
    // The upper half of the ceiling's image is where -Z is, that of the floor's where +Z is.
    let green = from(&scene, DVec3::new(0.1, 1.0, -0.5));
    assert!((green - 10.0 * Vec3::Y).length() < 1e-4, "{green}");
    assert!((from(&scene, DVec3::new(0.1, 1.0, 0.5)) - 2.0 * Vec3::Y).length() < 1e-4);
    let floor = from(&scene, DVec3::new(0.1, -1.0, 0.5));
    assert!((floor - 10.0 * Vec3::new(1.0, 0.0, 1.0)).length() < 1e-4, "{floor}");
}

#[test]
fn the_cube_may_be_turned() {
    // A quarter turn about Y takes +Z to +X.
    let light = json!({"rotation": [0, FRAC_1_SQRT_2, 0, FRAC_1_SQRT_2], "specularImages": [[0, 1, 2, 3, 4, 5]]});
    let scene = cube(&light).unwrap().scene;
    assert!((from(&scene, DVec3::X - 0.5 * DVec3::Y) - Vec3::Z).length() < 1e-4);
}

#[test]
fn broken_lights_are_errors_and_broken_images_warnings() {
    for (light, cause) in [
        (json!({"specularImages": [[0, 1, 2, 3, 4, 6]]}), "element 6 does not exist"),
        (json!({"specularImages": [[0, 1, 2, 3, 4]]}), "invalid length"),
        (json!({"specularImages": []}), "has no images"),
        (json!({}), "missing field"),
        (json!({"specularImages": [[0, 1, 2, 3, 4, 5]], "rotation": [0, 0, 0, 0]}), "is no quaternion"),
    ] {
        let error = cube(&light).unwrap_err();
        assert!(error.place.starts_with("/extensions/EXT_lights_image_based/lights/0"), "{error}");
        assert!(error.to_string().contains(cause), "{error}");
    }
}
