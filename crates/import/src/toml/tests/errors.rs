//! What a wrong file is told.

use super::read;

/// The error without its file.
#[track_caller]
fn error(name: &str, text: &str) -> String {
    let e = read(name, text).expect_err("must be refused");
    if e.place.is_empty() { e.kind.to_string() } else { format!("{}: {}", e.place, e.kind) }
}

#[test]
fn what_breaks_the_schema_is_told_with_its_line() {
    let sphere = "[[objects]]\nshape = 'sphere'\ncenter = [0, 0, 0]\n";
    for (text, expected) in [
        ("\n\ncolour = 1\n", "line 3: unknown field `colour`, expected one of `name`, "),
        ("a b", "line 1: key with no value"),
        ("camera = { origin = [0, 0, 0],\n target = [0, 0, 'a'] }", "line 2: invalid type: string \"a\""),
        ("[materials.a]\nalbedo = 1", "line 1: missing field `type`"),
        ("\n[materials]\na = { type = 'wood' }", "line 3: unknown variant `wood`, expected one of `diffuse`"),
        ("[materials]\na = { type = 'diffuse', albedo = [1, 2] }", "line 2: invalid length 2"),
        ("[materials]\na = { type = 'diffuse', albedo = -1 }", "line 2: a colour must be finite and not negative"),
        ("[materials]\na = { type = 'diffuse', albedo = [1e99, 0, 0] }", "line 2: a colour must be finite"),
        (
            "[materials]\na = { type = 'diffuse', albedo = '#ff' }",
            "line 2: invalid value: string \"#ff\", expected a colour",
        ),
        ("[materials]\na = { type = 'pbr', ior = inf }", "line 2: numbers must be finite"),
        (
            "[materials]\na = { type = 'pbr', normal_texture = 1 }",
            "line 2: invalid type: integer `1`, expected the name of",
        ),
        ("[materials]\na = { type = 'pbr', normal_texture = { fill = '' } }", "line 2: unknown field `fill`"),
    ] {
        let found = error("scene.toml", text);
        assert!(found.starts_with(expected), "{text}\n{found}");
    }
    for (line, expected) in [
        ("raduis = 1", "line 1: unknown field `raduis`, expected `center` or `radius`"),
        ("", "line 1: missing field `radius`"),
        ("radius = nan", "line 1: numbers must be finite, but here is NaN"),
        ("radius = 1\ntransform = { rotate = 1 }", "line 5: unknown field `rotate`"),
        ("radius = 1\ntransform = { scale = [1, inf, 1] }", "line 5: numbers must be finite"),
    ] {
        let found = error("scene.toml", &format!("{sphere}{line}"));
        assert!(found.starts_with(expected), "{line}\n{found}");
    }
    for (text, expected) in [
        ("{\n\"objects\": [\n{\"shape\": \"sphere\",\n\"raduis\": 1}]}", "line 4: unknown field `raduis`"),
        (
            "{\"objects\": [\n{\"shape\": \"sphere\", \"center\": [0, 0, 0], \"radius\": 1e400}]}",
            "line 2: number out of range",
        ),
        (r#"{"materials": {"a": {"type": "glass"}, "a": {"type": "glass"}}}"#, "line 1: 'a' is given twice"),
        (r#"{"camera": 1, "camera": 2}"#, "line 1: invalid type: integer `1`, expected struct Camera"),
        ("[]", "is no JSON object"),
        ("{", "line 1: EOF while parsing an object"),
    ] {
        let found = error("scene.json", text);
        assert!(found.starts_with(expected), "{text}\n{found}");
    }
}

#[test]
fn what_makes_no_sense_is_told_with_its_element() {
    let object = |text: &str| format!("objects = [{{ {text} }}]");
    let sphere = |text: &str| object(&format!("shape = 'sphere', center = [0, 0, 0], radius = 1, {text}"));
    let light = |text: &str| format!("lights = [{{ {text} }}]");
    let camera = |text: &str| format!("camera = {{ {text} }}");
    let material = |text: &str| format!("[materials]\nm = {{ {text} }}");
    for (text, expected) in [
        (object("shape = 'sphere', center = [0, 0, 0], radius = 0"), "objects[0]: radius must be"),
        (object("shape = 'disk', center = [0, 0, 0], normal = [0, 0, 0], radius = 1"), "objects[0]: "),
        (object("shape = 'polygon', loops = [[[0, 0, 0], [1, 0, 0]]]"), "objects[0]: "),
        (object("shape = 'box', min = [1, 0, 0], max = [0, 1, 1]"), "objects[0]: "),
        (object("shape = 'quadric', coefficients = [0, 0, 0, 0, 0, 0, 0, 0, 0, 1]"), "objects[0]: "),
        (
            object("shape = 'cylinder', from = [1, 1, 1], to = [1, 1, 1], radius = 1"),
            "objects[0]: 'from' and 'to' must be different",
        ),
        (
            object("shape = 'cone', from = [0, 0, 0], to = [1, 1, 1], radius = 1, top_radius = 1"),
            "objects[0]: 'top_radius' must be",
        ),
        (
            object("shape = 'hyperboloid-one', from = [0, 0, 0], to = [1, 1, 1], radius = 1, waist_radius = 1"),
            "objects[0]: 'radius' (at the rims)",
        ),
        (
            object("shape = 'hyperboloid-two', from = [0, 0, 0], to = [1, 0, 0], radius = 1, gap = 1"),
            "objects[0]: 'gap' must be smaller",
        ),
        (
            object("shape = 'mesh', positions = [[0, 0, 0]], triangles = [[0, 0, 1]]"),
            "objects[0]: triangles[0]: position 1 does not exist; there are 1",
        ),
        (
            object("shape = 'mesh', positions = [[0, 0, 0]], triangles = [], uvs = [[0, 0], [1, 1]]"),
            "objects[0]: 2 uvs for 1 positions",
        ),
        (object("shape = 'mesh', positions = [[1e39, 0, 0]], triangles = []"), "objects[0]: positions[0] is too large"),
        (
            object("shape = 'mesh', positions = [[0, 0, 0]], normals = [[0, 0, 0]], triangles = []"),
            "objects[0]: normals[0] has no direction",
        ),
        (object("shape = 'model', file = 'none.obj'"), "objects[0]: cannot read 'none.obj'"),
        (object("shape = 'model', file = '../none.obj'"), "objects[0]: refused to read '../none.obj'"),
        (sphere("material = 'x'"), "objects[0]: material 'x' does not exist; there are: none"),
        (sphere("transform = { scale = 1e200 }"), "objects[0]: the transform makes the object too large"),
        (sphere("transform = { look_at = [0, 0, 0] }"), "objects[0]: 'look_at' must be"),
        (
            sphere("transform = { look_at = [0, 0, 1], rotate_deg = [0, 0, 0] }"),
            "objects[0]: give 'rotate_deg' or 'look_at'",
        ),
        (sphere("transform = { matrix = [[1, 0, 0, 0]] }"), "objects[0]: 'matrix' has 3 rows"),
        (
            sphere("transform = { matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]] }"),
            "objects[0]: 'matrix' has 3 rows",
        ),
        (
            sphere("transform = { matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], scale = 1 }"),
            "objects[0]: 'matrix' stands alone",
        ),
        (
            light(
                "type = 'spot', position = [0, 0, 0], target = [0, 0, 0], intensity = 1, inner_deg = 1, outer_deg = 2",
            ),
            "lights[0]: 'position' and 'target'",
        ),
        (
            light(
                "type = 'spot', position = [0, 0, 0], target = [0, 0, 1], intensity = 1, inner_deg = 3, outer_deg = 2",
            ),
            "lights[0]: 'inner_deg' must not be larger",
        ),
        (
            light("type = 'directional', direction = [0, 0, 0], irradiance = 1"),
            "lights[0]: 'direction' must not be zero",
        ),
        (
            light("type = 'sphere', center = [0, 0, 0], radius = -1, radiance = 1"),
            "lights[0]: 'radius' must be above 0, but is -1",
        ),
        (
            light(
                "type = 'rectangle', center = [0, 1, 0], target = [0, 0, 0], up = [0, 1, 0], width = 1, height = 1, radiance = 1",
            ),
            "lights[0]: 'up' must not",
        ),
        (camera("origin = [1, 1, 1], target = [1, 1, 1]"), "camera: 'origin' and 'target'"),
        (camera("origin = [1, 1, 1], target = [0, 0, 0], up = [2, 2, 2]"), "camera: 'up' must not"),
        (
            camera("origin = [1, 1, 1], target = [0, 0, 0], vfov_deg = 180"),
            "camera: 'vfov_deg' must be between 0 and 180",
        ),
        (
            camera("origin = [1, 1, 1], target = [0, 0, 0], vfov_deg = 9, orthographic_height = 1"),
            "camera: give 'vfov_deg' or",
        ),
        (
            camera("origin = [1, 1, 1], target = [0, 0, 0], aperture = -1"),
            "camera: 'aperture' must not be negative, but is -1",
        ),
        (
            camera("origin = [1, 1, 1], target = [0, 0, 0], focus_distance = 0"),
            "camera: 'focus_distance' must be above 0",
        ),
        ("fog = { scattering = 1, g = 1 }".to_owned(), "fog: 'g' must be between -0.99 and 0.99, but is 1"),
        ("fog = { scattering = 1, min = [0, 0, 0] }".to_owned(), "fog: give both 'min' and 'max'"),
        (
            "fog = { scattering = 1, min = [0, 0, 0], max = [1, 1, 0] }".to_owned(),
            "fog: each number of 'min' must be below",
        ),
        (
            "objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1, moves_to = { scale = 0 } }]".to_owned(),
            "objects[0]: what is flat cannot move",
        ),
        (material("type = 'diffuse', albedo = 2"), "materials.m: 'albedo' must be between 0 and 1"),
        (material("type = 'glass', ior = 0.5"), "materials.m: 'ior' must be between 1 and 10, but is 0.5"),
        (material("type = 'rough_mirror', alpha = 2"), "materials.m: 'alpha' must be between 0 and 1, but is 2"),
        (material("type = 'pbr', metallic = 2"), "materials.m: 'metallic' must be between 0 and 1, but is 2"),
        (material("type = 'pbr', attenuation_distance = 0"), "materials.m: 'attenuation_distance' must be above 0"),
        (material("type = 'pbr', normal_texture = 'none.png'"), "materials.m: cannot read 'none.png'"),
        ("env = { type = 'latlong', file = '/etc/passwd' }".to_owned(), "env: refused to read '/etc/passwd'"),
        ("film = { width = 0, height = 1 }".to_owned(), "film: 'width' and 'height' must be at least 1"),
        ("film = { width = 1, height = 1, filter = 'gauss' }".to_owned(), "film: 'filter' can only be \"box 1px\""),
        ("max_depth = 0".to_owned(), "max_depth: must be -1 (unlimited) or at least 1 path edge, but is 0"),
    ] {
        let found = error("scene.toml", &text);
        assert!(found.starts_with(expected), "{text}\n{found}");
    }
    let two = "objects = [{ shape = 'sphere', center = [0, 0, 0], radius = 1, material = 'c' }]\n\
               [materials]\nb = { type = 'glass' }\na = { type = 'glass' }";
    assert_eq!(error("scene.toml", two), "objects[0]: material 'c' does not exist; there are: 'a', 'b'");
}
