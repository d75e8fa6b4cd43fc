//! What can be relied on in a scene that was read.

use std::fmt::{self, Debug, Write};

use firsthit_geometry::transform::Transform;
use firsthit_import::Imported;
use firsthit_import::scene::{EnvironmentDesc, MaterialModel, Pixels, SceneDesc, SurfaceDesc, TriangleMesh};

/// A PNG image of one black pixel.
pub(super) const PIXEL: [u8; 67] = *b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\0\0\0\0\x3a\x7e\x9b\x55\
    \0\0\0\nIDAT\x78\xda\x63\x60\0\0\0\x02\0\x01\xe5\x27\xde\xfc\0\0\0\0IEND\xae\x42\x60\x82";

/// Indices are in range, arrays as long as they should be, and numbers finite: those that a file has otherwise are
/// warned of.
pub(super) fn check(imported: &Imported) {
    let scene = &imported.scene;
    let warned = !imported.report.warnings.is_empty();
    for (i, mesh) in scene.meshes.iter().enumerate() {
        for (k, geometry) in mesh.geometries.iter().enumerate() {
            assert!(geometry.material.is_none_or(|m| m < scene.materials.len()), "mesh {i}, part {k}");
            match &geometry.surface {
                SurfaceDesc::Triangles(mesh) => triangles(mesh, warned),
                // Some have no bounds.
                SurfaceDesc::Shape(shape) => assert!(has_no("NaN", shape), "mesh {i}, part {k}: {shape:?}"),
            }
        }
    }
    for instance in &scene.instances {
        assert!(instance.mesh < scene.meshes.len(), "{instance:?}");
        assert!(Transform::new(instance.transform).is_ok(), "{instance:?}");
        assert!(instance.moves_to.is_none_or(|t| Transform::new(t).is_ok()), "{instance:?}");
    }
    images(scene);
    numbers(scene, warned);
    for warning in &imported.report.warnings {
        let said = warning.to_string();
        assert!(!warning.message.is_empty() && said.len() < 2000, "{} characters: {said}", said.len());
    }
    let settings = &scene.settings;
    assert!(settings.camera.is_none_or(|c| c < scene.cameras.len()), "{settings:?}");
}

fn triangles(mesh: &TriangleMesh, warned: bool) {
    let TriangleMesh { positions, triangles, normals, tangents, uvs, colors, moves_to } = mesh;
    let count = positions.len();
    assert!(triangles.iter().flatten().all(|&i| (i as usize) < count), "an index is out of range");
    assert!(positions.iter().all(|p| p.is_finite()), "a position is not finite");
    let lengths = [normals.len(), tangents.len(), colors.len()].into_iter().chain(uvs.iter().map(Vec::len));
    lengths.for_each(|n| assert!(n == 0 || n == count, "{n} attributes of {count} vertices"));
    if let Some(to) = moves_to {
        assert!(to.positions.len() == count && to.positions.iter().all(|p| p.is_finite()), "{count} vertices move");
        assert_eq!((to.normals.len(), to.tangents.len()), (normals.len(), tangents.len()));
    }
    let unit = |length: f32| (length - 1.0).abs() < 1e-3;
    let normal = normals.iter().find(|n| !unit(n.length()));
    assert!(normal.is_none(), "a normal is not of length 1: {normal:?}");
    let tangent = tangents.iter().find(|t| !unit(t.truncate().length()) || t.w.abs() != 1.0);
    assert!(tangent.is_none(), "a tangent is not of length 1: {tangent:?}");
    let finite = uvs.iter().flatten().all(|uv| uv.is_finite()) && colors.iter().all(|c| c.is_finite());
    assert!(finite || warned, "texture coordinates or colours are not finite, without a warning");
}

fn images(scene: &SceneDesc) {
    for image in &scene.images {
        let count = match &image.pixels {
            Pixels::Rgba8(p) => p.len(),
            Pixels::Rgba16(p) => p.len(),
            Pixels::Rgb32F(p) => p.len(),
        };
        assert!(count > 0 && count as u64 == u64::from(image.width) * u64::from(image.height), "{count} pixels");
    }
    for material in &scene.materials {
        if let MaterialModel::Pbr(pbr) = &material.model {
            assert!(pbr.textures().all(|t| t.image < scene.images.len()), "{material:?}");
        }
    }
    if let Some(EnvironmentDesc::LatLong { image, .. }) = scene.environment {
        assert!(image < scene.images.len());
    }
}

/// Materials, lights, cameras and what is around.
fn numbers(scene: &SceneDesc, warned: bool) {
    for material in &scene.materials {
        let mut model = material.model.clone();
        if let MaterialModel::Pbr(pbr) = &mut model {
            // Infinite: no absorption.
            assert!(pbr.attenuation_distance > 0.0, "{material:?}");
            pbr.attenuation_distance = 1.0;
        }
        assert!(is_finite(&model) || warned, "{material:?}");
    }
    for light in &scene.lights {
        assert!(is_finite(&light.kind) || warned, "{light:?}");
    }
    for camera in &scene.cameras {
        assert!(is_finite(&(camera.transform, camera.projection, camera.lens)) || warned, "{camera:?}");
    }
    let around = (&scene.environment, &scene.fog);
    assert!(is_finite(&around) || warned, "{around:?}");
}

fn is_finite(value: &impl Debug) -> bool {
    has_no("NaN", value) && has_no("inf", value)
}

/// Whether a number is not among those of a value, by what is printed of it without names: so that nothing that is added
/// to it is forgotten here.
fn has_no(number: &'static str, value: &impl Debug) -> bool {
    struct Words(&'static str, bool);
    impl Write for Words {
        fn write_str(&mut self, text: &str) -> fmt::Result {
            self.1 &= text.split(|c: char| !c.is_ascii_alphanumeric()).all(|word| word != self.0);
            Ok(())
        }
    }
    let mut words = Words(number, true);
    write!(words, "{value:?}").is_ok() && words.1
}
