//! `firsthit query` as a user meets it: rows in, rows out, and what is wrong with a row.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::Ray;
use glam::{DAffine3, DVec3, Vec3};
use serde_json::Value;
use tempfile::TempDir;

/// Two squares, one above the other, each of two triangles.
const SQUARES: &str = "\
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 -2\nv 1 0 -2\nv 1 1 -2\nv 0 1 -2
f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8
";

const NAMES: &str = "hit,t,instance,geometry,primitive,u,v,nx,ny,nz";

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(TempDir::new().unwrap());
        folder.write("squares.obj", SQUARES);
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// `firsthit query QUESTION squares.obj OPTIONS`.
    fn command(&self, question: &str, options: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firsthit"));
        command.current_dir(self.0.path()).args(["query", question, "squares.obj"]).args(options);
        command.env_clear().stdin(Stdio::null());
        command
    }

    fn run(&self, question: &str, options: &[&str]) -> Run {
        Run(self.command(question, options).output().unwrap())
    }

    /// With something on standard input.
    fn pipe(&self, question: &str, options: &[&str], input: &[u8]) -> Run {
        let mut command = self.command(question, options);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let input = input.to_vec();
        let writer = std::thread::spawn(move || drop(stdin.write_all(&input)));
        let output = child.wait_with_output().unwrap();
        writer.join().unwrap();
        Run(output)
    }
}

struct Run(Output);

impl Run {
    #[track_caller]
    fn ok(self) -> String {
        let error = String::from_utf8_lossy(&self.0.stderr).into_owned();
        assert_eq!(self.0.status.code(), Some(0), "{error}");
        String::from_utf8(self.0.stdout).unwrap()
    }

    #[track_caller]
    fn bytes(self) -> Vec<u8> {
        assert_eq!(self.0.status.code(), Some(0), "{}", String::from_utf8_lossy(&self.0.stderr));
        self.0.stdout
    }

    #[track_caller]
    fn fails(self, code: i32, words: &[&str]) {
        let error = String::from_utf8(self.0.stderr).unwrap();
        assert_eq!(self.0.status.code(), Some(code), "{error}");
        for word in words {
            assert!(error.contains(word), "no '{word}' in: {error}");
        }
    }
}

/// A NumPy array of 64-bit floats.
fn npy(width: usize, numbers: &[f64]) -> Vec<u8> {
    let rows = numbers.len() / width;
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, {width}), }}\n");
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    out
}

/// The shape and the numbers of a file that was written.
fn from_npy(bytes: &[u8]) -> (String, Vec<f64>) {
    let (head, data) = bytes.split_at(128);
    let head = String::from_utf8_lossy(head);
    let shape = head.split_once("'shape': ").unwrap().1.split_once(", }").unwrap().0.to_owned();
    assert!(head.contains("'descr': '<f8', 'fortran_order': False"), "{head}");
    (shape, data.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect())
}

/// Numbers in [0, 1), the same every time.
fn random() -> impl FnMut() -> f64 {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Rays that meet none, one or both of the squares.
fn rays(count: usize) -> Vec<[f64; 6]> {
    let mut random = random();
    let mut ray = || {
        let [x, y, dx, dy] = std::array::from_fn(|_| random() * 2.0 - 0.5);
        [x, y, 1.0 + random(), 0.2 * dx - 0.1, 0.2 * dy - 0.1, -1.0]
    };
    (0..count).map(|_| ray()).collect()
}

fn csv(rays: &[[f64; 6]]) -> String {
    let mut text = String::new();
    for [a, b, c, d, e, f] in rays {
        writeln!(text, "{a:?},{b:?},{c:?},{d:?},{e:?},{f:?}").unwrap();
    }
    text
}

/// What `squares.obj` is.
fn squares() -> Scene {
    let corner = |z: f32| [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y].map(|p| p + Vec3::Z * z);
    let mut builder = SceneBuilder::new(BuildOptions::default());
    let mesh = builder.add_mesh(vec![Geometry::Triangles {
        positions: [corner(0.0), corner(-2.0)].concat(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    }]);
    builder.add_instance(mesh, DAffine3::IDENTITY);
    builder.build().unwrap()
}

#[test]
fn every_question_has_its_rows() {
    let folder = Folder::new();
    folder.write("rays.csv", "ox,oy,oz,dx,dy,dz\n0.75,0.25,1,0,0,-2\n# a miss:\n\n5,5,1,0,0,-1\n");
    let asked = |question, options: &[&str]| folder.run(question, &[&["--rays", "rays.csv"], options].concat()).ok();
    let hits = format!("{NAMES}\n1,0.5,0,0,0,0.5,0.25,0.0,0.0,1.0\n0,inf,-1,-1,-1,0.0,0.0,0.0,0.0,0.0\n");
    assert_eq!(asked("closest", &[]), hits);
    assert_eq!(asked("any", &[]), "hit\n1\n0\n");
    assert_eq!(asked("count", &["-q"]), "count\n2\n0\n");
    let first = "0,1,0.5,0,0,0,0.5,0.25,0.0,0.0,1.0\n";
    assert_eq!(asked("all", &[]), format!("ray,{NAMES}\n{first}{}", first.replace(",0.5,0,0,0", ",1.5,0,0,2")));

    // Along the diagonal, which two triangles share.
    let diagonal = b"0.5,0.5,1,0,0,-1,0,2";
    for (options, counted) in [(&[][..], 2), (&["--crossings=triangles"], 2), (&["--crossings=surfaces"], 1)] {
        assert_eq!(folder.pipe("count", options, diagonal).ok(), format!("count\n{counted}\n"), "{options:?}");
    }
    for tier in ["fast", "double", "exact"] {
        assert_eq!(asked("closest", &["--precision", tier]), hits, "{tier}");
    }
}

#[test]
fn formats_hold_the_same_numbers() {
    let folder = Folder::new();
    let rays = rays(3000);
    folder.write("rays.csv", csv(&rays));
    folder.write("rays.npy", npy(6, rays.as_flattened()));
    let json = |ray: &[f64; 6]| serde_json::to_string(ray).unwrap() + "\n";
    folder.write("rays.jsonl", rays.iter().map(json).collect::<String>());
    let asked = folder.run("closest", &["--rays", "rays.csv"]).ok();
    for input in ["rays.npy", "rays.jsonl"] {
        assert_eq!(folder.run("closest", &["--rays", input]).ok(), asked, "{input}");
    }
    let table: Vec<f64> = asked.lines().skip(1).flat_map(|l| l.split(',').map(|x| x.parse().unwrap())).collect();
    assert_eq!(table.len(), 30_000);

    for (input, output) in [("rays.csv", "hits.npy"), ("rays.npy", "more.npy")] {
        folder.run("closest", &["--rays", input, "-o", output]).ok();
        assert_eq!(from_npy(&folder.read(output)), ("(3000, 10)".into(), table.clone()));
    }
    // The number of rows is known: the array may go into a pipe.
    let piped = folder.run("closest", &["--rays", "rays.npy", "--format", "npy"]).bytes();
    assert_eq!(piped, folder.read("more.npy"));
    folder.run("any", &["--rays", "rays.npy", "-o", "any.npy"]).ok();
    let (shape, any) = from_npy(&folder.read("any.npy"));
    assert_eq!((shape.as_str(), any), ("(3000,)", table.chunks(10).map(|row| row[0]).collect()));

    let lines = folder.run("closest", &["--rays", "rays.npy", "--format", "jsonl"]).ok();
    for (line, row) in lines.lines().zip(table.chunks(10)) {
        let value: Value = serde_json::from_str(line).unwrap();
        assert_eq!(value["hit"], Value::Bool(row[0] == 1.0));
        assert_eq!(value["t"].is_null(), row[1].is_infinite());
        assert_eq!(value["primitive"].as_f64(), Some(row[4]));
    }
    assert_eq!(lines.lines().count(), 3000);
}

#[test]
fn blocks_keep_order_and_bits_for_any_number_of_threads() {
    let folder = Folder::new();
    let scene = squares();
    // More than two blocks.
    let rays = rays(150_000);
    folder.write("rays.npy", npy(6, rays.as_flattened()));
    for threads in ["1", "2", "5"] {
        folder.run("closest", &["--rays", "rays.npy", "-o", "hits.npy", "-t", threads]).ok();
        let (shape, table) = from_npy(&folder.read("hits.npy"));
        assert_eq!(shape, "(150000, 10)");
        for (&[ox, oy, oz, dx, dy, dz], row) in rays.iter().zip(table.chunks(10)) {
            let hit = scene.closest_hit(&Ray::new(DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz)));
            let expected = hit.map_or([0.0, f64::INFINITY, -1.0], |h| [1.0, h.t, h.id.primitive.into()]);
            assert_eq!([row[0], row[1], row[4]], expected);
            assert_eq!([row[5], row[6]], hit.map_or([0.0; 2], |h| [h.u.into(), h.v.into()]));
        }
    }
    let all = |threads| folder.run("all", &["--rays", "rays.npy", "-t", threads]).ok();
    let lists = all("1");
    assert_eq!(lists, all("3"));
    let counts = folder.run("count", &["--rays", "rays.npy"]).ok();
    let total: usize = counts.lines().skip(1).map(|n| n.parse::<usize>().unwrap()).sum();
    assert_eq!(lines_of(&lists).count(), total);
    let indices: Vec<u64> = lines_of(&lists).map(|l| l.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(indices.is_sorted() && indices.last() > Some(&149_000));
}

fn lines_of(table: &str) -> impl Iterator<Item = &str> {
    table.lines().skip(1)
}

#[test]
fn a_bad_row_is_named_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("old.csv", "old");
    let many = csv(&rays(70_000));
    for (text, words) in [
        ("1,2,3,4,5,6\n1,2,x,4,5,6\n", &["bad.csv: line 2: 'x' is not a number (column oz)"][..]),
        ("\n# rays\n1,2,3,4,5\n", &["bad.csv: line 3: there are 5 numbers; a ray has 6 or 8"]),
        ("origin,direction\n", &["line 1: 'origin,direction' is neither", "ox,oy,oz,dx,dy,dz[,t_min,t_max]"]),
        ("[1,2,3,4,5,6]\n[1,2,3]\n", &["line 2: there are 3 numbers"]),
        (&(many.clone() + "1,2,3,4,5,6e\n"), &["line 70001: '6e'"]),
        (&"1,".repeat(40_000), &["line 1: the line is longer than any row"]),
        ("\u{93}NUMPY", &["line 1"]),
    ] {
        folder.write("bad.csv", text);
        let run = folder.run("closest", &["--rays", "bad.csv", "-o", "old.csv"]);
        run.fails(1, words);
        assert_eq!(folder.files(), ["bad.csv", "old.csv", "squares.obj"]);
        assert_eq!(folder.read("old.csv"), b"old");
    }
    let whole = npy(6, &[0.0; 60]);
    for (bytes, words) in [
        (&whole[..whole.len() - 1], "ends after 9 of its 10 rows"),
        (&whole[..20], "ends within the header"),
        (&npy(7, &[0.0; 7]), "in a row there are 7 numbers; a ray has 6 or 8"),
        (b"\xff\xfe1,2", "is not text"),
    ] {
        folder.write("bad.csv", bytes);
        folder.run("any", &["--rays", "bad.csv", "-o", "new.npy"]).fails(1, &["bad.csv", words]);
        assert!(!folder.path("new.npy").exists());
    }
    // Those before it are on standard output by then.
    let run = folder.pipe("any", &[], (many + "oh").as_bytes());
    assert_eq!(run.0.stdout.iter().filter(|b| **b == b'\n').count(), 65_537);
    run.fails(1, &["standard input: line 70001: 'oh'"]);
}

#[test]
fn wrong_usage_is_told_at_once() {
    let folder = Folder::new();
    folder.write("rays.csv", "0,0,1,0,0,-1\n");
    let run = |question, options: &[&str]| folder.run(question, &[&["--rays", "rays.csv"], options].concat());
    run("closest", &["--crossings", "surfaces"]).fails(2, &["only `all` and `count`"]);
    run("closest", &["-o", "hits.txt"]).fails(2, &["hits.txt", ".csv, .jsonl or .npy"]);
    run("closest", &["-o", "no/hits.csv"]).fails(1, &["no folder"]);
    run("all", &["--format", "npy"]).fails(2, &["-o FILE.npy"]);
    run("closest", &["-o", "rays.csv"]).fails(1, &["rays.csv: this file is read too"]);
    run("closest", &["-o", "squares.obj", "--format", "csv"]).fails(1, &["squares.obj: this file is read too"]);
    run("nearest", &[]).fails(2, &["nearest", "closest"]);
    folder.run("any", &["--rays", "none.csv"]).fails(1, &["none.csv"]);
    folder.run("any", &["--rays", "."]).fails(1, &["folder"]);
    assert_eq!(folder.files(), ["rays.csv", "squares.obj"]);
    run("closest", &["-o", "hits.txt", "--format", "jsonl"]).ok();
    assert!(folder.read("hits.txt").starts_with(b"{\"hit\":true"));
}

#[test]
fn rays_that_are_none_are_misses() {
    let folder = Folder::new();
    let rows = "nan,0,1,0,0,-1\n0.2,0.1,1,0,0,0\n0.2,0.1,1,0,0,-1,5,2\n0.2,0.1,1,0,0,-inf\n\n";
    assert_eq!(folder.pipe("any", &["-q"], rows.as_bytes()).ok(), "hit\n0\n0\n0\n0\n");
    assert_eq!(folder.pipe("any", &[], b"").ok(), "hit\n");
    assert_eq!(folder.pipe("any", &[], b"\xef\xbb\xbfox,oy,oz,dx,dy,dz\r\n0.2,0.1,1,0,0,-1\r\n").ok(), "hit\n1\n");
    assert_eq!(folder.pipe("any", &["--format=npy"], &npy(8, &[])).bytes().len(), 128);
}

#[test]
fn a_reader_that_leaves_is_no_error() {
    let folder = Folder::new();
    folder.write("rays.csv", csv(&rays(100_000)));
    for format in ["csv", "jsonl"] {
        let mut command = folder.command("all", &["--rays", "rays.csv", "--format", format]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), output.stderr), (Some(0), Vec::new()));
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_query_leaves_nothing_behind() {
    let folder = Folder::new();
    let mut command = folder.command("any", &["-o", "hits.csv"]);
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    // Of rays that never end; once there is a file of answers, the handler is there.
    stdin.write_all(&b"0,0,1,0,0,-1\n".repeat(70_000)).unwrap();
    let start = std::time::Instant::now();
    while folder.files().len() < 2 {
        assert!(start.elapsed().as_secs() < 60);
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(folder.files(), ["squares.obj"]);
}

#[test]
fn the_camera_sees_parts() {
    let folder = Folder::new();
    let square = |name: &str, z: f32| {
        format!("o {name}\nusemtl m{name}\n{}", {
            let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| format!("v {x} {y} {z}\n"));
            corners.concat() + "f -4 -3 -2\nf -4 -2 -1\n"
        })
    };
    // One hides the other; the third lies beside the picture.
    folder.write(
        "squares.obj",
        square("front", 0.0) + &square("be,hind", -1.0) + &square("beside", 0.0).replace("v ", "v 9"),
    );
    let view = ["--camera-position", "0.5,0.5,4", "--camera-focal-point", "0.5,0.5,0", "--camera-orthographic", "-q"];
    let asked = |options: &[&str]| folder.run("visible", &[&view, options].concat());
    let text = asked(&["--resolution", "200x100", "--camera-view-angle", "30"]).ok();
    let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0], ["instance", "geometry", "name", "material", "pixels", "share"]);
    assert_eq!(rows.len(), 4, "{text}");
    let pixels: u64 = rows[1][4].parse().unwrap();
    // A square of one unit, in a picture of 8 tan 15 degrees.
    let expected = (100.0 / (8.0 * 15_f64.to_radians().tan())).powi(2);
    assert!((pixels as f64 / expected - 1.0).abs() < 0.05, "{text}");
    // Quoted, since a comma is in it; what is hidden and what is beside the picture has no pixel.
    assert!(text.contains(",\"mbe,hind\",0,0.0\n") && rows[3][3..] == ["mbeside", "0", "0.0"], "{text}");
    for threads in ["1", "3"] {
        let again =
            asked(&["--resolution", "200x100", "--camera-view-angle", "30", "-t", threads, "--format", "jsonl"]);
        let text = again.ok();
        let first: Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
        assert_eq!((first["pixels"].as_u64(), &first["material"]), (Some(pixels), &Value::from("mfront")));
        assert_eq!(first["share"].as_f64(), Some(pixels as f64 / 20_000.0));
    }
    asked(&["--format", "npy"]).fails(2, &["names"]);
    asked(&["--rays", "rays.csv"]).fails(2, &["--rays"]);
    folder.run("closest", &["--resolution", "20x10"]).fails(2, &["only `visible`"]);
    folder.run("any", &["--camera", "1"]).fails(2, &["only `visible`"]);
}

#[test]
fn points_are_near_and_inside() {
    let folder = Folder::new();
    // A cube from -1 to 1.
    folder.write(
        "squares.obj",
        "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n\
         f 5 6 7 8\nf 2 1 4 3\nf 6 2 3 7\nf 1 5 8 4\nf 8 7 3 4\nf 1 2 6 5\n",
    );
    folder.write("points.csv", "x,y,z\n0,0.25,0.5\n4,5,1\n");
    let asked =
        |question, options: &[&str]| folder.run(question, &[&["--points", "points.csv"], options].concat()).ok();
    assert_eq!(asked("distance", &[]), "distance\n0.5\n5.0\n");
    for sign in ["auto", "winding", "fast-winding", "parity", "pseudonormal", "exact"] {
        assert_eq!(asked("signed-distance", &["--sign", sign]), "distance\n-0.5\n5.0\n", "{sign}");
        assert_eq!(asked("contains", &["--sign", sign, "-t", "1"]), "inside\n1\n0\n", "{sign}");
    }
    assert_eq!(asked("winding-number", &[]), "winding\n1.0\n0.0\n");
    let nearest = asked("closest-point", &["--format", "jsonl"]);
    let first: Value = serde_json::from_str(nearest.lines().next().unwrap()).unwrap();
    assert_eq!(["distance", "x", "y", "z", "nz"].map(|key| first[key].as_f64()), [0.5, 0.0, 0.25, 1.0, 1.0].map(Some));
    assert_eq!(folder.pipe("distance", &["-q"], b"[1, 1, 3]\n{\"x\":0,\"y\":0,\"z\":-4}").ok(), "distance\n2.0\n3.0\n");
    assert_eq!(
        folder.pipe("closest-point", &["-q"], b"nan,0,0").ok().lines().nth(1).unwrap().split(',').next(),
        Some("inf")
    );
    folder.pipe("contains", &[], b"1,2\n").fails(1, &["line 1: there are 2 numbers; a point has 3"]);
    folder.run("closest", &["--points", "points.csv"]).fails(2, &["--points"]);
    folder.run("distance", &["--rays", "points.csv"]).fails(2, &["--rays"]);
    folder.run("distance", &["--points", "points.csv", "--sign", "parity"]).fails(2, &["--sign"]);
}
