use std::io::Cursor;

use super::*;
use crate::{Aov, Crop, ViewTransform};

/// A film of 5 x 3 pixels with opaque, partly covered and empty ones, bright and dark, and two AOVs.
fn film(crop: Option<Crop>, alpha: bool) -> Film {
    let mut film = Film::new(5, 3, crop, &[Aov::Depth, Aov::Normal]).unwrap();
    for mut band in film.bands_mut(2) {
        for y in band.rows() {
            for x in band.columns() {
                let a = if alpha { x as f32 / 4.0 } else { 1.0 };
                let v = 0.1 * x as f32 + 0.3 * y as f32;
                let pixel = band.pixel(x, y);
                pixel[0].add([v * a, 4.0 * v * a, 0.01 * a, a]);
                pixel[1].add([v + 1.0, v + 1.0, v + 1.0, 1.0]);
                pixel[2].add([0.0, -1.0, v, 1.0]);
            }
        }
    }
    film
}

fn view(transform: ViewTransform) -> View {
    View { transform, exposure: 0.0, backdrop: None }
}

fn png(film: &Film, view: &View, depth: BitDepth) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_png(&mut bytes, &film.color(), view, depth).unwrap();
    bytes
}

#[test]
fn extensions_choose_the_format_and_unknown_ones_are_refused() {
    let format = |p: &str| Format::from_path(Path::new(p));
    assert_eq!(format("a/b.png").unwrap(), Format::Png);
    assert_eq!(format("b.EXR").unwrap(), Format::Exr);
    assert_eq!(format("b.c.hdr").unwrap(), Format::Hdr);
    for bad in ["b", "b.jpg", "png", ".png", "b.png.tmp", ""] {
        let error = format(bad).unwrap_err();
        assert!(error.to_string().ends_with("the extension must be .png, .exr or .hdr"), "{error}");
    }
}

/// Read back by another decoder, every value is the nearest to the view transform's.
#[test]
fn png_holds_the_display_values() {
    for alpha in [false, true] {
        let film = film(None, alpha);
        for transform in ViewTransform::ALL {
            let v = view(transform);
            let eight = image::load_from_memory(&png(&film, &v, BitDepth::Eight)).unwrap();
            let sixteen = image::load_from_memory(&png(&film, &v, BitDepth::Sixteen)).unwrap();
            assert_eq!(eight.color().has_alpha(), alpha);
            assert_eq!(sixteen.color().bytes_per_pixel(), if alpha { 8 } else { 6 });
            let (eight, sixteen) = (eight.to_rgba8(), sixteen.to_rgba16());
            for (i, p) in film.color().pixels.iter().enumerate() {
                let (x, y) = (i as u32 % 5, i as u32 / 5);
                let straight = if p[3] > 0.0 { glam::Vec3::new(p[0], p[1], p[2]) / p[3] } else { glam::Vec3::ZERO };
                let expected = v.apply(straight).extend(p[3]).to_array();
                for c in 0..4 {
                    assert!((f32::from(eight[(x, y)][c]) - 255.0 * expected[c]).abs() <= 0.501);
                    assert!((f32::from(sixteen[(x, y)][c]) - 65535.0 * expected[c]).abs() <= 0.51);
                }
            }
        }
    }
}

#[test]
fn png_says_how_to_read_its_numbers() {
    let film = film(None, false);
    let chunk = |bytes: &[u8], name: &[u8]| bytes.windows(4).any(|w| w == name);
    let srgb = png(&film, &view(ViewTransform::PbrNeutral), BitDepth::Eight);
    assert!(chunk(&srgb, b"sRGB"));
    let linear = png(&film, &view(ViewTransform::None), BitDepth::Eight);
    assert!(!chunk(&linear, b"sRGB") && chunk(&linear, b"gAMA"));
    assert_eq!(srgb, png(&film, &view(ViewTransform::PbrNeutral), BitDepth::Eight), "the same bytes every time");
}

#[test]
fn exr_holds_colour_and_aovs_bit_by_bit() {
    let folder = tempfile::tempdir().unwrap();
    let crop = Crop { x: 1, y: 1, width: 3, height: 2 };
    let film = film(Some(crop), true);
    let path = folder.path().join("a.exr");
    assert_eq!(write_film(&path, &film, &WriteOptions::default()).unwrap(), std::slice::from_ref(&path));

    let image = ::exr::prelude::read_all_flat_layers_from_file(&path).unwrap();
    let layer = &image.layer_data[0];
    let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(names, ["A", "B", "G", "R", "depth.Z", "normal.X", "normal.Y", "normal.Z"]);
    assert_eq!((image.attributes.display_window.size.0, image.attributes.display_window.size.1), (5, 3));
    assert_eq!((layer.attributes.layer_position.0, layer.attributes.layer_position.1), (1, 1));
    let channel = |name: &str| -> Vec<f32> {
        let channel = layer.channel_data.list.iter().find(|c| c.name.eq(name)).unwrap();
        channel.sample_data.values_as_f32().collect()
    };
    let of = |picture: Picture, c: usize| -> Vec<f32> { picture.pixels.iter().map(|p| p[c]).collect() };
    for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        assert_eq!(channel(name), of(film.color(), c));
    }
    assert_eq!(channel("depth.Z"), of(film.aov(Aov::Depth).unwrap(), 0));
    assert_eq!(channel("normal.Y"), of(film.aov(Aov::Normal).unwrap(), 1));
}

#[test]
fn hdr_holds_the_colour_to_its_eight_bits() {
    let folder = tempfile::tempdir().unwrap();
    let film = film(None, false);
    let path = folder.path().join("a.hdr");
    let files = write_film(&path, &film, &WriteOptions::default()).unwrap();
    assert_eq!(files, ["a.hdr", "a.depth.exr", "a.normal.exr"].map(|n| folder.path().join(n)));
    let back = image::open(&path).unwrap().to_rgb32f();
    for (p, q) in film.color().pixels.iter().zip(back.pixels()) {
        let largest = p[0].max(p[1]).max(p[2]);
        for c in 0..3 {
            assert!((p[c] - q[c]).abs() <= largest / 128.0, "{p:?} {q:?}");
        }
    }
}

#[test]
fn a_file_is_whole_or_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    fs::write(&path, "old").unwrap();
    let failed = atomically(&path, |out| {
        out.write_all(b"half of it")?;
        Err(io::Error::other("disk full"))
    });
    assert_eq!(failed.unwrap_err().to_string(), "disk full");
    assert_eq!(fs::read(&path).unwrap(), b"old");
    write_film(&path, &film(None, false), &WriteOptions::default()).unwrap();
    assert!(image::open(&path).is_ok());
    let mut names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["a.depth.exr", "a.normal.exr", "a.png"], "nothing is left behind");
}

#[test]
fn what_cannot_be_written_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let film = film(None, false);
    let missing = folder.path().join("no/such/folder/a.png");
    let error = write_film(&missing, &film, &WriteOptions::default()).unwrap_err();
    assert!(matches!(&error, OutputError::Io { path, .. } if *path == missing), "{error}");
    let taken = folder.path().join("b.png");
    fs::create_dir(&taken).unwrap();
    assert!(matches!(write_film(&taken, &film, &WriteOptions::default()), Err(OutputError::Io { .. })));
    let empty = Film::new(4, 4, Some(Crop { x: 4, y: 0, width: 1, height: 1 }), &[]).unwrap();
    let target = folder.path().join("c.png");
    assert!(matches!(write_film(&target, &empty, &WriteOptions::default()), Err(OutputError::Empty)));
    assert!(write_png(&mut Cursor::new(Vec::new()), &empty.color(), &View::default(), BitDepth::Eight).is_err());
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
}

#[test]
fn a_place_is_tried_without_a_trace() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    fs::write(&path, "old").unwrap();
    try_path(&path).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"old");
    try_path(&folder.path().join("b.png")).unwrap();
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    assert!(try_path(&folder.path().join("no/such/folder/a.png")).is_err());
    assert!(try_path(folder.path()).is_err());
}

/// Blocks are compressed on several threads, and must lie in the file in one order.
#[test]
fn one_picture_is_one_file() {
    let mut film = Film::new(256, 256, None, &[Aov::Depth]).unwrap();
    for mut band in film.bands_mut(16) {
        for y in band.rows() {
            for x in band.columns() {
                // Some blocks are much harder to compress than others.
                let v = (x * y * (y / 32)) as f32;
                band.pixel(x, y)[0].add([v.sin(), v.cos(), v, 1.0]);
            }
        }
    }
    let file = || {
        let mut bytes = Vec::new();
        exr::write(&mut bytes, &film, exr::Layers::All).unwrap();
        bytes
    };
    let first = file();
    assert!((0..16).all(|_| file() == first));
}
