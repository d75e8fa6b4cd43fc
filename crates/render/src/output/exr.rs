//! OpenEXR: one part, 32-bit float channels, AOVs as `layer.channel`.

use std::io::{self, Cursor, Write};

use exr::prelude::*;

use super::other;
use crate::Aov;
use crate::film::{Film, Picture};

/// What goes into a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Layers {
    /// Colour and AOVs.
    All,
    /// One AOV.
    Only(Aov),
}

/// The channels of an AOV's layer.
const fn channel_names(aov: Aov) -> &'static [&'static str] {
    match aov {
        Aov::Depth => &["Z"],
        Aov::Normal | Aov::GeometricNormal => &["X", "Y", "Z"],
        Aov::Uv | Aov::Barycentric => &["U", "V"],
        Aov::Samples => &["N"],
        Aov::Variance | Aov::Albedo | Aov::InstanceId | Aov::MaterialId | Aov::PrimitiveId | Aov::Heat => {
            &["R", "G", "B"]
        }
    }
}

/// Writes a film. A crop window is the data window within the whole picture's display window.
pub(super) fn write(out: &mut impl Write, film: &Film, layers: Layers) -> io::Result<()> {
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    let mut add = |picture: &Picture, prefix: &str, names: &[&str]| {
        for (i, name) in names.iter().enumerate() {
            let samples = picture.pixels.iter().map(|p| p[i]).collect();
            channels.push(AnyChannel::new(Text::new_or_panic(format!("{prefix}{name}")), FlatSamples::F32(samples)));
        }
    };
    if layers == Layers::All {
        add(&film.color(), "", &["R", "G", "B", "A"]);
    }
    for aov in film.aovs() {
        if let (true, Some(picture)) = (matches!(layers, Layers::All) || layers == Layers::Only(*aov), film.aov(*aov)) {
            add(&picture, &format!("{}.", aov.name()), channel_names(*aov));
        }
    }

    let (window, (width, height)) = (film.window(), film.size());
    let attributes = LayerAttributes {
        software_name: Some(Text::new_or_panic("firsthit")),
        layer_position: Vec2(window.x as i32, window.y as i32),
        ..LayerAttributes::default()
    };
    let layer = Layer::new(
        (window.width as usize, window.height as usize),
        attributes,
        // Blocks are compressed on all threads; in any other order than theirs, files of one picture would differ.
        Encoding { line_order: LineOrder::Increasing, ..Encoding::SMALL_FAST_LOSSLESS },
        AnyChannels::sort(channels),
    );
    let mut image = Image::from_layer(layer);
    image.attributes = ImageAttributes::new(IntegerBounds::new((0, 0), (width as usize, height as usize)));
    // The encoder seeks, so the file is put together in memory.
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).map_err(other)?;
    out.write_all(bytes.get_ref())
}
