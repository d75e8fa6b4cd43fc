mod errors;
mod hostile;

use std::fs;
use std::path::PathBuf;

use firsthit_geometry::{Primitive, Ray};
use glam::{DVec3, Vec2, Vec3, Vec4};
use tempfile::TempDir;

use crate::scene::{
    AlphaMode, Channel, EnvironmentDesc, Filter, LensDesc, LightKind, MaterialModel, PbrMaterial, Projection, SpotRamp,
    SurfaceDesc, Wrap,
};
use crate::{ErrorKind, ImportError, Imported, Limits, Options, SceneDesc, UpAxis, open};

/// A folder with a scene file of this name and text, and a 2 x 2 image `checker.png`.
fn folder(name: &str, text: &str) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("temporary folder");
    let path = dir.path().join(name);
    fs::write(&path, text).expect("file");
    image::RgbaImage::new(2, 2).save(dir.path().join("checker.png")).expect("image");
    (dir, path)
}

fn read(name: &str, text: &str) -> Result<Imported, ImportError> {
    let (_dir, path) = folder(name, text);
    open(path, &Options::default())
}

fn toml(text: &str) -> SceneDesc {
    read("scene.toml", text).unwrap_or_else(|e| panic!("{e}")).scene
}

fn json(text: &str) -> SceneDesc {
    read("scene.json", text).unwrap_or_else(|e| panic!("{e}")).scene
}

/// The nearest hit with the first object of a scene: `t` and the world normal.
fn probe(scene: &SceneDesc, origin: [f64; 3], direction: [f64; 3]) -> Option<(f64, DVec3)> {
    let instance = &scene.instances[0];
    let SurfaceDesc::Shape(shape) = &scene.meshes[instance.mesh].geometries[0].surface else { panic!("a shape") };
    let inverse = instance.transform.inverse();
    let ray = Ray::new(inverse.transform_point3(origin.into()), inverse.transform_vector3(direction.into()));
    let hit = shape.closest_hit(&ray)?;
    let normal = inverse.matrix3.transpose() * hit.normal.unwrap_or_default();
    Some((hit.t, normal.normalize_or_zero()))
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from(b)).length() < 1e-12
}

fn material(text: &str) -> MaterialModel {
    let scene = toml(&format!(
        "[materials]\nm = {{ {text} }}\n[[objects]]\nshape = 'sphere'\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n"
    ));
    scene.materials[0].model.clone()
}

fn pbr(text: &str) -> PbrMaterial {
    match material(&format!("type = 'pbr', {text}")) {
        MaterialModel::Pbr(pbr) => *pbr,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_shape_is_where_the_file_says() {
    // What the object is, a ray, and where and with which normal it must meet it.
    let down = [0.0, -1.0, 0.0];
    let left = [-1.0, 0.0, 0.0];
    type Case<'a> = (&'a str, &'a str, [f64; 3], [f64; 3], f64, [f64; 3]);
    let cases: [Case<'_>; 22] = [
        ("sphere", "center = [1, 2, 3], radius = 2", [1.0, 9.0, 3.0], down, 5.0, [0.0, 1.0, 0.0]),
        ("plane", "point = [0, 1, 0], normal = [0, 2, 0]", [5.0, 4.0, 5.0], down, 3.0, [0.0, 1.0, 0.0]),
        ("disk", "center = [0, 1, 0], normal = [0, 1, 0], radius = 2", [1.0, 4.0, 1.0], down, 3.0, [0.0, 1.0, 0.0]),
        (
            "polygon",
            "loops = [[[0, 0, 0], [0, 0, 3], [3, 0, 3], [3, 0, 0]], [[1, 0, 1], [1, 0, 2], [2, 0, 2], [2, 0, 1]]]",
            [0.5, 1.0, 0.5],
            down,
            1.0,
            [0.0, 1.0, 0.0],
        ),
        ("box", "min = [0, 0, 0], max = [1, 2, 3]", [0.5, 5.0, 0.5], down, 3.0, [0.0, 1.0, 0.0]),
        (
            "quadric",
            "coefficients = [1, 0, 0, 0, 1, 0, 0, 1, 0, -1], clip_max = [9, 0, 9]",
            [0.0, 5.0, 0.0],
            down,
            6.0,
            [0.0, -1.0, 0.0],
        ),
        (
            "quadric",
            "coefficients = [1, 0, 0, 0, 1, 0, 0, 1, 0, -1], clip_min = [-9, -9, -9], clip_max = [9, 0, 9], caps = true",
            [0.0, 5.0, 0.0],
            down,
            5.0,
            [0.0, 1.0, 0.0],
        ),
        ("cylinder", "from = [0, 1, 0], to = [0, 4, 0], radius = 1", [0.5, 9.0, 0.0], down, 5.0, [0.0, 1.0, 0.0]),
        ("cylinder", "from = [0, 1, 0], to = [0, 4, 0], radius = 1", [5.0, 2.0, 0.0], left, 4.0, [1.0, 0.0, 0.0]),
        ("cylinder", "from = [2, 0, 0], to = [-1, 0, 0], radius = 1", [0.0, 5.0, 0.0], down, 4.0, [0.0, 1.0, 0.0]),
        ("cylinder", "from = [2, 0, 0], to = [-1, 0, 0], radius = 1", [5.0, 0.5, 0.0], left, 3.0, [1.0, 0.0, 0.0]),
        (
            "cylinder",
            "from = [2, 0, 0], to = [-1, 0, 0], radius = 1, caps = false",
            [5.0, 0.9, 0.0],
            [-1.0, 0.0, 0.0],
            f64::NAN,
            [0.0; 3],
        ),
        ("cone", "from = [0, 0, 0], to = [0, -2, 0], radius = 1", [0.5, 9.0, 0.0], down, 9.0, [0.0, 1.0, 0.0]),
        (
            "cone",
            "from = [0, 0, 0], to = [0, 2, 0], radius = 2",
            [5.0, 1.0, 0.0],
            left,
            4.0,
            [0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0],
        ),
        (
            "cone",
            "from = [0, 0, 0], to = [0, 1, 0], radius = 2, top_radius = 1",
            [0.9, 5.0, 0.0],
            down,
            4.0,
            [0.0, 1.0, 0.0],
        ),
        ("ellipsoid", "center = [0, 1, 0], radii = [1, 2, 3]", [0.0, 1.0, 9.0], [0.0, 0.0, -1.0], 6.0, [0.0, 0.0, 1.0]),
        // y = 4 (x^2 + z^2): at x = 0.5 the height is 1.
        ("paraboloid", "from = [0, 0, 0], to = [0, 4, 0], radius = 1", [0.5, 9.0, 0.0], down, 5.0, [0.0, 1.0, 0.0]),
        (
            "paraboloid",
            "from = [0, 0, 0], to = [0, 4, 0], radius = 1, caps = false",
            [0.5, 9.0, 0.0],
            down,
            8.0,
            [4.0 / 17.0_f64.sqrt(), -1.0 / 17.0_f64.sqrt(), 0.0],
        ),
        (
            "hyperboloid-one",
            "from = [0, 0, 0], to = [0, 4, 0], waist_radius = 1, radius = 2",
            [5.0, 2.0, 0.0],
            left,
            4.0,
            [1.0, 0.0, 0.0],
        ),
        (
            "hyperboloid-one",
            "from = [0, 0, 0], to = [0, 4, 0], waist_radius = 1, radius = 2",
            [1.9, 9.0, 0.0],
            down,
            5.0,
            [0.0, 1.0, 0.0],
        ),
        (
            "hyperboloid-two",
            "from = [0, 0, 0], to = [0, 4, 0], gap = 2, radius = 2, caps = false",
            [0.0, 2.0, 0.0],
            [0.0, 1.0, 0.0],
            1.0,
            [0.0, -1.0, 0.0],
        ),
        (
            "hyperboloid-two",
            "from = [0, 0, 0], to = [0, 4, 0], gap = 2, radius = 2",
            [1.9, 9.0, 0.0],
            down,
            5.0,
            [0.0, 1.0, 0.0],
        ),
    ];
    for (shape, parameters, origin, direction, t, normal) in cases {
        let scene = toml(&format!("objects = [{{ shape = '{shape}', {parameters} }}]"));
        assert_eq!(scene.instances[0].name, shape, "named after what it is");
        let hit = probe(&scene, origin, direction);
        if t.is_nan() {
            assert_eq!(hit, None, "{shape}: {parameters}");
        } else {
            let (found, n) = hit.unwrap_or_else(|| panic!("no hit: {shape}: {parameters}"));
            assert!((found - t).abs() < 1e-12, "{shape}: {parameters}: t = {found}");
            assert!(near(n, normal), "{shape}: {parameters}: normal {n}");
        }
    }
}

#[test]
fn objects_are_scaled_then_turned_then_moved() {
    let at = |transform: &str| {
        let sphere = "shape = 'sphere', center = [0, 0, 0], radius = 1";
        toml(&format!("objects = [{{ {sphere}, transform = {{ {transform} }} }}]")).instances[0].transform
    };
    let m = at("scale = [1, 2, 3], rotate_deg = [90, 0, 0], translate = [10, 0, 0]");
    assert_eq!(m.transform_point3(DVec3::Y), DVec3::new(10.0, 0.0, 2.0), "quarter turns are exact");
    assert_eq!(m.transform_point3(DVec3::Z), DVec3::new(10.0, -3.0, 0.0));
    // About X first: Z goes to -Y; then about Y: it stays; then about Z: to X.
    let m = at("rotate_deg = [90, 90, 90]");
    assert_eq!(m.transform_vector3(DVec3::Z), DVec3::X);
    assert!(near(at("rotate_deg = [0, 30, 0]").transform_vector3(DVec3::Z), [0.5, 0.0, 0.75_f64.sqrt()]));
    let m = at("matrix = [[0, 0, 1, 7], [0, 1, 0, 8], [-1, 0, 0, 9]]");
    assert_eq!(m.transform_point3(DVec3::X), DVec3::new(7.0, 8.0, 8.0), "rows, as mathematics writes them");
    assert_eq!(m, at("matrix = [[0, 0, 1, 7], [0, 1, 0, 8], [-1, 0, 0, 9], [0, 0, 0, 1]]"));
    let m = at("look_at = [1, 0, 5], translate = [1, 0, 0], scale = 2");
    assert_eq!(m.transform_point3(DVec3::Z), DVec3::new(1.0, 0.0, 2.0), "the front turns to the point");
    let m = at("look_at = [0, -5, 0]");
    assert!(near(m.transform_vector3(DVec3::Z), [0.0, -1.0, 0.0]), "straight down is a direction too");
    assert!((m.matrix3.determinant() - 1.0).abs() < 1e-12);
}

#[test]
fn plain_materials_are_read() {
    use MaterialModel as M;
    assert!(matches!(material("type = 'diffuse', albedo = [0, 0.5, 1]"), M::Diffuse { albedo }
        if albedo == Vec3::new(0.0, 0.5, 1.0)));
    assert!(matches!(material("type = 'emission', radiance = 17"), M::Emission { radiance }
        if radiance == Vec3::splat(17.0)));
    assert!(matches!(material("type = 'mirror'"), M::Mirror { reflectance: Vec3::ONE }));
    assert!(matches!(material("type = 'glass'"), M::Glass { ior: 1.5 }));
    assert!(matches!(
        material("type = 'rough_mirror', alpha = 0.25, reflectance = '#ffffff'"),
        M::RoughMirror { alpha: 0.25, reflectance: Vec3::ONE }
    ));
    assert!(matches!(material("type = 'rough_glass', alpha = 0.5, ior = 2"), M::RoughGlass { ior: 2.0, alpha: 0.5 }));
    let M::Diffuse { albedo } = material("type = 'diffuse', albedo = '#ff8000'") else { panic!("diffuse") };
    // 0x80 = 128: ((128 / 255 + 0.055) / 1.055)^2.4 by the sRGB standard.
    assert!((albedo - Vec3::new(1.0, 0.215_860_5, 0.0)).length() < 1e-6, "{albedo}");
}

#[test]
fn pbr_takes_every_field() {
    let m = pbr("base_color = 0.25, alpha = 0.5, metallic = 1, roughness = 0.1, normal_scale = -2, bump_scale = 3, \
        occlusion_strength = 0.5, emissive = [1, 2, 3], alpha_mode = 'mask', alpha_cutoff = 0.75, double_sided = false, \
        unlit = true, ior = 1.25, transmission = 0.5, thickness = 2, attenuation_color = [1, 0, 0], \
        attenuation_distance = 4, specular = 0.5, specular_color = 1.5");
    assert_eq!(m.base_color, Vec4::new(0.25, 0.25, 0.25, 0.5));
    assert_eq!((m.metallic, m.roughness, m.normal_scale, m.bump_scale), (1.0, 0.1, -2.0, 3.0));
    assert_eq!((m.occlusion_strength, m.emissive), (0.5, Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!((m.alpha_mode, m.double_sided, m.unlit), (AlphaMode::Mask { cutoff: 0.75 }, false, true));
    assert_eq!((m.ior, m.transmission, m.thickness), (1.25, 0.5, 2.0));
    assert_eq!((m.attenuation_color, m.attenuation_distance), (Vec3::X, 4.0));
    assert_eq!((m.specular, m.specular_color), (0.5, Vec3::splat(1.5)));
}

#[test]
fn layers_take_every_field_and_are_there_only_if_named() {
    let m = pbr("dispersion = 0.5, clearcoat = 0.75, clearcoat_roughness = 0.25, clearcoat_normal_scale = 2, \
        sheen_color = [0.5, 0.25, 0], sheen_roughness = 0.75, iridescence = 0.5, iridescence_ior = 1.5, \
        iridescence_thickness_min = 200, iridescence_thickness_max = 300, anisotropy = 0.5, \
        anisotropy_rotation_deg = 180, diffuse_transmission = 0.25, diffuse_transmission_color = [1, 0, 0]");
    assert_eq!(m.dispersion, 0.5);
    let coat = m.clearcoat.expect("a coat");
    assert_eq!((coat.factor, coat.roughness, coat.normal_scale), (0.75, 0.25, 2.0));
    let sheen = m.sheen.expect("sheen");
    assert_eq!((sheen.color, sheen.roughness), (Vec3::new(0.5, 0.25, 0.0), 0.75));
    let film = m.iridescence.expect("a film");
    assert_eq!((film.factor, film.ior, film.thickness_min, film.thickness_max), (0.5, 1.5, 200.0, 300.0));
    let brushed = m.anisotropy.expect("anisotropy");
    assert_eq!((brushed.strength, brushed.rotation), (0.5, std::f32::consts::PI));
    let through = m.diffuse_transmission.expect("diffuse transmission");
    assert_eq!((through.factor, through.color), (0.25, Vec3::X));
    let plain = pbr("");
    assert!(plain.clearcoat.is_none() && plain.sheen.is_none() && plain.iridescence.is_none());
    assert!(plain.anisotropy.is_none() && plain.diffuse_transmission.is_none() && plain.dispersion == 0.0);
}

#[test]
fn pbr_defaults_are_friendly() {
    let m = pbr("");
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.8, 0.8, 0.8, 1.0), 0.0, 0.5));
    assert_eq!((m.double_sided, m.alpha_mode), (true, AlphaMode::Opaque));
    assert_eq!(m.attenuation_distance, f32::INFINITY);
    assert_eq!(pbr("alpha = 0.5").alpha_mode, AlphaMode::Blend);
    assert_eq!(pbr("alpha_cutoff = 0.25").alpha_mode, AlphaMode::Mask { cutoff: 0.25 });
    // A texture is shown as it is, not darkened by a default.
    assert_eq!(pbr("base_color_texture = 'checker.png'").base_color, Vec4::ONE);
    assert_eq!(pbr("roughness_texture = 'checker.png'").roughness, 1.0);
}

#[test]
fn textures_are_names_or_tables() {
    let slots = [
        "base_color",
        "opacity",
        "metallic",
        "roughness",
        "normal",
        "bump",
        "occlusion",
        "emissive",
        "transmission",
        "thickness",
        "specular",
        "specular_color",
        "clearcoat",
        "clearcoat_roughness",
        "clearcoat_normal",
        "sheen_color",
        "sheen_roughness",
        "iridescence",
        "iridescence_thickness",
        "anisotropy",
        "diffuse_transmission",
        "diffuse_transmission_color",
    ];
    let all: String = slots.map(|s| format!("{s}_texture = 'checker.png', ")).concat();
    let m = pbr(&all);
    let (metallic, roughness) = (m.metallic_texture.clone(), m.roughness_texture.clone());
    assert_eq!(
        (metallic.map(|t| t.channel), roughness.map(|t| t.channel)),
        (Some(Channel::Blue), Some(Channel::Green))
    );
    assert_eq!(m.textures().count(), 22, "every slot");
    assert!(m.textures().all(|t| t.image == 0), "one file, one image");

    let t = pbr("base_color_texture = { file = 'checker.png', uv_set = 1, scale = [2, 4], offset = [0.5, 0], \
        rotation_deg = 90, wrap = 'mirror', filter = 'nearest', channel = 'alpha' }")
    .base_color_texture
    .expect("a texture");
    assert_eq!((t.uv_set, t.wrap_u, t.wrap_v), (1, Wrap::Mirror, Wrap::Mirror));
    assert_eq!((t.filter, t.channel), (Filter::Nearest, Channel::Alpha));
    // KHR_texture_transform: scaled, then turned by [cos sin; -sin cos], then moved.
    assert!((t.transform.transform_point2(Vec2::X) - Vec2::new(0.5, -2.0)).length() < 1e-6);
    assert!((t.transform.transform_point2(Vec2::Y) - Vec2::new(4.5, 0.0)).length() < 1e-6);
}

#[test]
fn a_material_may_be_shared_and_one_that_nothing_has_is_left_out() {
    let scene = toml(
        "objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1, material = 'b' },
                    { shape = 'sphere', center = [3, 0, 0], radius = 1, material = 'b' },
                    { shape = 'sphere', center = [6, 0, 0], radius = 1 }]
         [materials]
         a = { type = 'mirror' }
         b = { type = 'glass' }",
    );
    assert_eq!(scene.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["b", "default"]);
    let used: Vec<_> = scene.meshes.iter().map(|m| m.geometries[0].material).collect();
    assert_eq!(used, [Some(0), Some(0), Some(1)]);
}

#[test]
fn inline_meshes_are_read() {
    let imported = read(
        "scene.toml",
        "[[objects]]
         shape = 'mesh'
         name = 'floor'
         positions = [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]
         triangles = [[0, 1, 2], [0, 2, 3]]
         normals = [[0, 2, 0], [0, 2, 0], [0, 2, 0], [0, 2, 0]]
         uvs = [[0, 0], [0, 1], [1, 1], [1, 0]]",
    )
    .expect("a good file");
    let SurfaceDesc::Triangles(mesh) = &imported.scene.meshes[0].geometries[0].surface else { panic!("triangles") };
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 2));
    assert_eq!((mesh.normals[0], mesh.uvs[0][2]), (Vec3::Y, Vec2::ONE));
    assert_eq!(imported.report.triangles_all_scenes, 2);
}

#[test]
fn lights_of_all_kinds_are_read() {
    let scene = toml(
        "lights = [
            { type = 'point', name = 'bulb', position = [0, 2, 0], intensity = 5, range = 10 },
            { type = 'directional', direction = [0, -2, 0], irradiance = [1, 1, 0.5], angle_deg = 0.5 },
            { type = 'spot', position = [0, 3, 0], target = [0, 0, 0], intensity = 1, inner_deg = 10, outer_deg = 20 },
            { type = 'rectangle', center = [0, 3, 0], target = [0, 0, 0], width = 4, height = 2, radiance = 9 },
            { type = 'sphere', center = [1, 2, 3], radius = 0.5, radiance = 2 },
        ]",
    );
    let [bulb, sun, spot, panel, ball] = &scene.lights[..] else { panic!("five lights") };
    assert_eq!(bulb.name, "bulb");
    assert!(matches!(bulb.kind, LightKind::Point { position, intensity, range: Some(10.0) }
        if position == 2.0 * DVec3::Y && intensity == Vec3::splat(5.0)));
    assert!(matches!(sun.kind, LightKind::Directional { direction: DVec3::NEG_Y, angle, .. }
        if angle == 0.5_f32.to_radians()));
    assert!(matches!(spot.kind, LightKind::Spot { direction: DVec3::NEG_Y, ramp: SpotRamp::Gltf, inner, outer, .. }
        if inner == 10_f32.to_radians() && outer == 20_f32.to_radians()));
    let LightKind::Rectangle { corner, edge_u, edge_v, .. } = panel.kind else { panic!("a rectangle") };
    assert!(near(edge_u.cross(edge_v), [0.0, -8.0, 0.0]), "it shines towards the target");
    assert_eq!((edge_u.length(), edge_v.length()), (4.0, 2.0));
    assert!(near(corner + (edge_u + edge_v) / 2.0, [0.0, 3.0, 0.0]));
    assert!(matches!(ball.kind, LightKind::Sphere { radius: 0.5, .. }));
}

#[test]
fn cameras_look_where_the_file_says() {
    let scene = toml(
        "camera = { origin = [0, 1, 5], target = [0, 1, 0], vfov_deg = 60, aperture = 0.1 }
         [[cameras]]
         name = 'plan'
         origin = [0, 9, 0]
         target = [0, 0, 0]
         up = [0, 0, -1]
         orthographic_height = 4
         focus_distance = 8.5",
    );
    assert_eq!(scene.settings.camera, Some(0));
    let [front, plan] = &scene.cameras[..] else { panic!("two cameras") };
    assert_eq!(front.transform.matrix3, glam::DMat3::IDENTITY);
    assert!(matches!(front.projection, Projection::Perspective { vertical_fov, aspect: None }
        if vertical_fov == 60_f64.to_radians()));
    assert_eq!(front.lens, Some(LensDesc { aperture: 0.1, focus_distance: Some(5.0) }));
    assert_eq!(plan.lens, Some(LensDesc { aperture: 0.0, focus_distance: Some(8.5) }));
    assert_eq!(plan.name, "plan");
    assert!(near(plan.transform.transform_vector3(DVec3::NEG_Z), [0.0, -1.0, 0.0]));
    assert!(near(plan.transform.transform_vector3(DVec3::Y), [0.0, 0.0, -1.0]));
    assert_eq!(plan.projection, Projection::Orthographic { half_height: 2.0, aspect: None });
}

#[test]
fn fog_and_motion_are_read() {
    let scene = toml(
        "fog = { scattering = [0.1, 0.2, 0.3], absorption = 0.5, g = 0.4, min = [0, 0, 0], max = [1, 2, 3] }
         [[objects]]
         shape = 'sphere'
         center = [1, 0, 0]
         radius = 1
         transform = { translate = [0, 1, 0] }
         moves_to = { translate = [0, 1, 4], scale = 2 }
         [[objects]]
         shape = 'sphere'
         center = [0, 0, 0]
         radius = 1",
    );
    let fog = scene.fog.unwrap();
    assert_eq!((fog.scattering, fog.absorption, fog.g), (Vec3::new(0.1, 0.2, 0.3), Vec3::splat(0.5), 0.4));
    assert_eq!(fog.bounds, Some((DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0))));
    let [moving, still] = &scene.instances[..] else { panic!("two objects") };
    let (from, to) = (moving.transform, moving.moves_to.unwrap());
    // Whatever the shape's own place in it: from there to here.
    let point = DVec3::new(0.3, 0.2, 0.1);
    let inside = from.inverse().transform_point3(point + DVec3::Y);
    assert!((to.transform_point3(inside) - (point * 2.0 + DVec3::new(0.0, 1.0, 4.0))).length() < 1e-12);
    assert_eq!(still.moves_to, None);
    assert!(toml("").fog.is_none());
}

#[test]
fn environments_are_read() {
    let env = |text: &str| toml(&format!("env = {{ {text} }}")).environment;
    assert!(matches!(env("type = 'constant', radiance = 0.5"), Some(EnvironmentDesc::Constant { radiance })
        if radiance == Vec3::splat(0.5)));
    assert!(matches!(env("type = 'studio', scale = 2"), Some(EnvironmentDesc::Studio { rotation: 0.0, scale })
        if scale == Vec3::splat(2.0)));
    assert!(matches!(env("type = 'latlong', file = 'checker.png', rotation_deg = 90"),
        Some(EnvironmentDesc::LatLong { image: 0, rotation, scale: Vec3::ONE }) if rotation == 90_f32.to_radians()));
    assert!(toml("").environment.is_none(), "the renderer may choose");
}

#[test]
fn json_selects_the_reference_conventions() {
    let scene = json(
        r#"{"film": {"width": 256, "height": 128, "filter": "box 1px", "space": "linear Rec.709"}, "max_depth": -1,
            "note": 3, "exact": "1.0 in every pixel", "materials": {},
            "lights": [{"type": "spot", "position": [0, 3, 0], "target": [0, 0, 0], "intensity": [1, 1, 1],
                        "inner_deg": 10.0, "outer_deg": 20.0}]}"#,
    );
    assert!(scene.settings.reference_conventions);
    assert_eq!(scene.settings.resolution, Some((256, 128)));
    assert_eq!(scene.settings.max_path_edges, Some(u32::MAX));
    assert!(matches!(scene.lights[0].kind, LightKind::Spot { ramp: SpotRamp::LinearAngle, .. }));
    assert!(matches!(scene.environment, Some(EnvironmentDesc::Constant { radiance: Vec3::ZERO })), "else black");
    assert_eq!(json(r#"{"max_depth": 2}"#).settings.max_path_edges, Some(2));

    assert!(!json(r#"{"conventions": "firsthit"}"#).settings.reference_conventions);
    assert!(toml("conventions = 'reference'").settings.reference_conventions);
    assert!(!toml("").settings.reference_conventions);
}

#[test]
fn scenes_include_scenes_but_not_themselves() {
    let ball = "[[objects]]\nshape = 'sphere'\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n\
                [[lights]]\ntype = 'point'\nposition = [0, 1, 0]\nintensity = 1\n\
                [materials]\nm = { type = 'pbr', base_color_texture = 'checker.png' }\n\
                [env]\ntype = 'latlong'\nfile = 'checker.png'\n";
    let (dir, path) = folder(
        "scene.toml",
        "[materials]
         m = { type = 'pbr', base_color_texture = 'own.png' }
         [[objects]]
         shape = 'sphere'
         center = [0, 0, 0]
         radius = 1
         material = 'm'
         [[objects]]
         shape = 'model'
         file = 'part/ball.toml'
         transform = { translate = [5, 0, 0] }
         [[objects]]
         shape = 'model'
         file = 'part/ball.toml'
         up = '+Z'
         [[objects]]
         shape = 'model'
         file = 'part/ball.toml'
         materials = { m = 'm' }",
    );
    let part = dir.path().join("part");
    fs::create_dir(&part).expect("folder");
    fs::write(part.join("ball.toml"), ball).expect("file");
    fs::copy(dir.path().join("checker.png"), part.join("checker.png")).expect("image");
    fs::copy(dir.path().join("checker.png"), dir.path().join("own.png")).expect("image");

    let scene = open(&path, &Options::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.instances.iter().map(|i| i.mesh).collect::<Vec<_>>(), [0, 1, 1, 2], "read once, placed twice");
    let image_of = |mesh: usize| {
        let material = scene.meshes[mesh].geometries[0].material.expect("a material");
        let MaterialModel::Pbr(pbr) = &scene.materials[material].model else { panic!("pbr") };
        pbr.base_color_texture.as_ref().expect("a texture").image
    };
    assert_eq!([image_of(0), image_of(1), image_of(2)], [0, 1, 0], "indices are moved; the last is replaced");
    assert!(matches!(scene.environment, Some(EnvironmentDesc::LatLong { image: 1, .. })));
    let lights: Vec<_> = scene
        .lights
        .iter()
        .map(|l| match l.kind {
            LightKind::Point { position, .. } => position,
            _ => panic!("a point"),
        })
        .collect();
    assert_eq!(lights, [DVec3::new(5.0, 1.0, 0.0), DVec3::new(0.0, 0.0, -1.0), DVec3::Y]);
    assert!(matches!(
        open(
            part.join("ball.toml"),
            &Options { limits: Limits { depth: 0, ..Limits::default() }, ..Options::default() }
        ),
        Err(ImportError { kind: ErrorKind::Limit(_), .. })
    ));

    let include = |file: &str| format!("objects = [{{ shape = 'model', file = '{file}' }}]");
    fs::write(dir.path().join("a.toml"), include("b.toml")).expect("file");
    fs::write(dir.path().join("b.toml"), include("a.toml")).expect("file");
    let e = open(dir.path().join("a.toml"), &Options::default()).expect_err("a circle");
    assert!(e.to_string().ends_with("a.toml: this scene file includes itself"), "{e}");
    for i in 0..40 {
        fs::write(dir.path().join(format!("{i}.toml")), include(&format!("{}.toml", i + 1))).expect("file");
    }
    let e = open(dir.path().join("0.toml"), &Options::default()).expect_err("too deep");
    assert!(matches!(e.kind, ErrorKind::Limit(_)), "{e}");
}

#[test]
fn a_doubling_of_includes_stops_at_the_limit() {
    let (dir, path) = folder("0.toml", "");
    let twice = |file: &str| format!("objects = [{0}, {0}]", format!("{{ shape = 'model', file = '{file}' }}"));
    for i in 0..12 {
        fs::write(dir.path().join(format!("{i}.toml")), twice(&format!("{}.toml", i + 1))).expect("file");
    }
    fs::write(dir.path().join("12.toml"), "objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1 }]")
        .expect("file");
    let limit = |instances| Options { limits: Limits { instances, ..Limits::default() }, ..Options::default() };
    assert_eq!(open(&path, &limit(4096)).unwrap_or_else(|e| panic!("{e}")).scene.instances.len(), 4096);
    assert!(matches!(open(&path, &limit(4095)), Err(ImportError { kind: ErrorKind::Limit(_), .. })));
}

#[test]
fn long_names_count_against_the_limit() {
    let (dir, path) = folder("scene.toml", "");
    let model = "{ shape = 'model', file = 'part.toml' }";
    fs::write(&path, format!("objects = [{}]", [model; 100].join(", "))).expect("file");
    let limit = Options { limits: Limits { instances: 1000, ..Limits::default() }, ..Options::default() };
    for (length, fits) in [(9, true), (9000, false)] {
        let name = "n".repeat(length);
        let ball = format!("objects = [{{ shape = 'sphere', center = [0, 0, 0], radius = 1, name = '{name}' }}]");
        fs::write(dir.path().join("part.toml"), ball).expect("file");
        assert_eq!(open(&path, &limit).is_ok(), fits);
    }
}

#[test]
fn scene_files_that_hold_nothing_are_not_read_without_end() {
    let (dir, path) = folder("a0.toml", "");
    for i in 0..15 {
        for side in ["a", "b"] {
            let model = |side: &str| format!("{{ shape = 'model', file = '{side}{}.toml' }}", i + 1);
            let text = format!("objects = [{}, {}]", model("a"), model("b"));
            fs::write(dir.path().join(format!("{side}{i}.toml")), text).expect("file");
        }
    }
    for side in ["a15.toml", "b15.toml"] {
        fs::write(dir.path().join(side), "").expect("file");
    }
    let e = open(&path, &Options::default()).expect_err("2^15 ways lead to the last");
    assert!(matches!(e.kind, ErrorKind::Limit(_)), "{e}");
}

#[test]
fn directions_between_points_far_apart_are_found() {
    let scene = toml(
        "lights = [
            { type = 'rectangle', center = [0, 1e300, 0], target = [0, 0, 0], up = [1e-200, 0, 0], width = 1,
              height = 1, radiance = 1 },
            { type = 'directional', direction = [0, -1e-300, 0], irradiance = 1 },
         ]
         camera = { origin = [0, 0, 1e200], target = [0, 0, 0] }",
    );
    let LightKind::Rectangle { edge_u, edge_v, .. } = scene.lights[0].kind else { panic!("a rectangle") };
    assert!(near(edge_u.cross(edge_v), [0.0, -1.0, 0.0]));
    assert!(matches!(scene.lights[1].kind, LightKind::Directional { direction: DVec3::NEG_Y, .. }));
    assert_eq!(scene.cameras[0].transform.matrix3.z_axis, DVec3::Z);
    let e = read(
        "a.toml",
        "lights = [{ type = 'spot', position = [1e308, 0, 0], target = [-1e308, 0, 0], \
                            intensity = 1, inner_deg = 1, outer_deg = 2 }]",
    );
    let e = e.expect_err("too far apart").to_string();
    assert!(e.ends_with("'position' and 'target' must be different points at a finite distance"), "{e}");
}

#[test]
fn the_whole_scene_is_turned_upright() {
    let (_dir, path) = folder(
        "scene.toml",
        "objects = [{ shape = 'sphere', center = [0, 0, 1], radius = 0.5 }]
         lights = [{ type = 'directional', direction = [0, 0, -1], irradiance = 1 }]
         camera = { origin = [0, -5, 0], target = [0, 0, 0], up = [0, 0, 1] }",
    );
    let scene = open(&path, &Options { up: Some(UpAxis::PosZ), ..Options::default() }).expect("a good file").scene;
    assert_eq!(probe(&scene, [0.0, 9.0, 0.0], [0.0, -1.0, 0.0]).map(|h| h.0), Some(7.5));
    assert!(
        matches!(scene.lights[0].kind, LightKind::Directional { direction, .. } if near(direction, [0.0, -1.0, 0.0]))
    );
    assert!(near(scene.cameras[0].transform.translation, [0.0, 0.0, 5.0]));
    assert!(near(scene.cameras[0].transform.transform_vector3(DVec3::Y), [0.0, 1.0, 0.0]));
}
