//! Puts pictures on one sheet: `contact-sheet OUT.png COLUMNS WIDTHxHEIGHT IMAGE...`
//!
//! Each picture is fitted into a cell of the given size, in the order of the arguments, row by row.

use std::process::ExitCode;

use image::{Rgb, RgbImage, imageops};

const USAGE: &str = "usage: contact-sheet OUT.png COLUMNS WIDTHxHEIGHT IMAGE...";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match sheet(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn sheet(args: &[String]) -> Result<(), String> {
    const GAP: u32 = 4;
    let [out, columns, cell, images @ ..] = args else { return Err(USAGE.into()) };
    let columns: u32 = columns.parse().map_err(|_| USAGE)?;
    let (w, h) = cell.split_once('x').ok_or(USAGE)?;
    let (w, h): (u32, u32) = (w.parse().map_err(|_| USAGE)?, h.parse().map_err(|_| USAGE)?);
    if columns == 0 || images.is_empty() {
        return Err(USAGE.into());
    }
    let rows = (images.len() as u32).div_ceil(columns);
    let size = ((w + GAP) * columns + GAP, (h + GAP) * rows + GAP);
    let mut page = RgbImage::from_pixel(size.0, size.1, Rgb([255; 3]));
    for (i, path) in (0u32..).zip(images) {
        let picture = image::open(path).map_err(|e| format!("{path}: {e}"))?;
        let picture = picture.resize(w, h, imageops::FilterType::Triangle).to_rgb8();
        let x = GAP + (i % columns) * (w + GAP) + (w - picture.width()) / 2;
        let y = GAP + (i / columns) * (h + GAP) + (h - picture.height()) / 2;
        imageops::overlay(&mut page, &picture, x.into(), y.into());
    }
    page.save(out).map_err(|e| format!("{out}: {e}"))
}
