//! Contact sheets: many pictures on a page, each with its name below.

use std::path::{Path, PathBuf};

use font8x8::{BASIC_FONTS, UnicodeFonts};
use image::{ImageResult, Rgb, RgbImage, imageops};

/// Pictures in a row.
const COLUMNS: u32 = 8;
/// Rows on a sheet.
const ROWS: u32 = 6;
/// Width and height of a picture.
const PICTURE: u32 = 256;
const GAP: u32 = 4;
/// Height of a letter, which is as wide.
const LETTER: u32 = 8;
/// Lines of a name.
const LINES: u32 = 2;
const CELL: (u32, u32) = (PICTURE + GAP, PICTURE + LINES * (LETTER + 2) + GAP);

/// Puts pictures on sheets `sheet_00.png`, `sheet_01.png`, ... in a folder, in the order given; tells how many there are.
///
/// # Errors
/// If a picture cannot be read or a sheet cannot be written.
pub fn write(folder: &Path, pictures: &[(String, PathBuf)]) -> ImageResult<usize> {
    let sheets = pictures.chunks((COLUMNS * ROWS) as usize);
    let count = sheets.len();
    for (number, pictures) in sheets.enumerate() {
        sheet(pictures)?.save(folder.join(format!("sheet_{number:02}.png")))?;
    }
    Ok(count)
}

fn sheet(pictures: &[(String, PathBuf)]) -> ImageResult<RgbImage> {
    let rows = (pictures.len() as u32).div_ceil(COLUMNS);
    let mut sheet = RgbImage::from_pixel(CELL.0 * COLUMNS + GAP, CELL.1 * rows + GAP, Rgb([255; 3]));
    for (i, (name, path)) in (0u32..).zip(pictures) {
        let (x, y) = (GAP + i % COLUMNS * CELL.0, GAP + i / COLUMNS * CELL.1);
        let picture = image::open(path)?;
        let picture = match picture.width().max(picture.height()) {
            PICTURE => picture,
            _ => picture.resize(PICTURE, PICTURE, imageops::FilterType::Triangle),
        };
        imageops::overlay(&mut sheet, &picture.to_rgb8(), x.into(), y.into());
        label(&mut sheet, x, y + PICTURE + 2, name);
    }
    Ok(sheet)
}

/// Writes the end of a name, which tells more than its beginning.
fn label(sheet: &mut RgbImage, x: u32, y: u32, name: &str) {
    let (in_line, letters) = (PICTURE / LETTER, name.chars().count() as u32);
    let cut = letters.saturating_sub(in_line * LINES);
    for (i, letter) in (0u32..).zip(name.chars().skip(cut as usize)) {
        let glyph = BASIC_FONTS.get(letter).or_else(|| BASIC_FONTS.get('?')).unwrap_or_default();
        let (left, top) = (x + i % in_line * LETTER, y + i / in_line * (LETTER + 2));
        for (dy, row) in (0u32..).zip(glyph) {
            // The lowest bit is the leftmost dot.
            for dx in (0..LETTER).filter(|dx| row >> dx & 1 == 1) {
                sheet.put_pixel(left + dx, top + dy, Rgb([0; 3]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_fill_sheets_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let red = folder.path().join("red.png");
        RgbImage::from_pixel(PICTURE, PICTURE, Rgb([255, 0, 0])).save(&red).unwrap();
        // A name of any length and any letters has its place.
        let name = "❤".to_owned() + &"long/".repeat(40);
        assert_eq!(write(folder.path(), &vec![(name, red); 49]).unwrap(), 2);
        let first = image::open(folder.path().join("sheet_00.png")).unwrap().to_rgb8();
        assert_eq!(first.dimensions(), (CELL.0 * COLUMNS + GAP, CELL.1 * ROWS + GAP));
        assert_eq!(first.get_pixel(GAP, GAP), &Rgb([255, 0, 0]));
        assert!(first.enumerate_pixels().any(|(_, y, p)| y > GAP + PICTURE && p == &Rgb([0; 3])));
        let second = image::open(folder.path().join("sheet_01.png")).unwrap();
        assert_eq!(second.height(), CELL.1 + GAP);
    }
}
