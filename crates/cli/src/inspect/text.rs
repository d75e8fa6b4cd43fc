//! The inspection as text.

use std::fmt;

use super::{Bounds, Inspection, Mesh, Timing};
use crate::console::{count, grouped, visible};

/// Entries of each list that are printed; JSON has all.
const SHOWN: usize = 16;

impl fmt::Display for Inspection<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", visible(&self.model))?;
        let row = |f: &mut fmt::Formatter<'_>, name: &str, value: String| writeln!(f, "  {name:11} {value}");

        let mut triangles = grouped(self.triangles);
        if self.stored_triangles != self.triangles {
            triangles += &format!(", {} stored", grouped(self.stored_triangles));
        }
        if self.triangles_all_scenes != self.triangles {
            triangles += &format!(", {} in all scenes", grouped(self.triangles_all_scenes));
        }
        if self.degenerate_triangles > 0 {
            triangles += &format!(", {} without area", grouped(self.degenerate_triangles));
        }
        row(f, "triangles", triangles)?;
        if self.shapes > 0 {
            row(f, "shapes", grouped(self.shapes))?;
        }
        row(f, "bounds", self.bounds.as_ref().map_or_else(|| "none".into(), Bounds::to_string))?;
        row(f, "instances", grouped(self.instances as u64))?;
        row(f, "meshes", grouped(self.meshes as u64))?;
        list(f, &self.mesh_list, |m| (m.name, mesh(m)))?;
        row(f, "materials", grouped(self.materials as u64))?;
        list(f, &self.material_list, |m| {
            let textures =
                if m.textures == 0 { String::new() } else { format!(", {}", count(m.textures as u64, "texture")) };
            let alpha = if m.alpha == "opaque" { String::new() } else { format!(", alpha {}", m.alpha) };
            (m.name, format!("{}{textures}{alpha}{}", m.kind, if m.double_sided { "" } else { ", single-sided" }))
        })?;
        row(f, "textures", grouped(self.textures as u64))?;
        list(f, &self.texture_list, |t| (t.name, format!("{} x {}", t.width, t.height)))?;
        row(f, "lights", grouped(self.lights as u64))?;
        list(f, &self.light_list, |l| (l.name, l.kind.into()))?;
        row(f, "cameras", grouped(self.cameras as u64))?;
        list(f, &self.camera_list, |c| (c.name, c.kind.into()))?;
        if self.animations > 0 {
            row(f, "animations", grouped(self.animations as u64))?;
            list(f, &self.animation_list, |a| {
                (a.name, format!("{} s, {}", significant(a.seconds), count(a.channels, "channel")))
            })?;
        }
        if self.scenes > 1 {
            row(f, "scenes", visible(&self.scene_list.join(", ")).into_owned())?;
        }
        if !self.variants.is_empty() {
            row(f, "variants", visible(&self.variants.join(", ")).into_owned())?;
        }
        row(f, "extensions", grouped(self.extensions.len() as u64))?;
        list(f, &self.extensions, |e| {
            let required = if e.required { "required, " } else { "" };
            let note = if e.note.is_empty() { String::new() } else { format!(": {}", e.note) };
            (e.name, format!("{required}{}{note}", e.support))
        })?;
        let bytes = grouped(self.bvh.bytes);
        row(f, "tree", format!("SAH cost {:.1}, depth {}, {bytes} bytes", self.bvh.sah_cost, self.bvh.depth))?;
        let called = self.effects.iter().filter(|e| e.called_for);
        row(f, "effects", grouped(called.clone().count() as u64))?;
        list(f, &called.collect::<Vec<_>>(), |e| (e.name, e.by_in_words()))?;
        row(f, "by default", "as `render` without options".into())?;
        for choice in self.choices {
            writeln!(f, "    {}", visible(choice))?;
        }
        row(f, "warnings", grouped(self.warnings.len() as u64 + self.more_warnings))?;
        for warning in self.warnings.iter().take(SHOWN) {
            writeln!(f, "    {}", visible(warning))?;
        }
        more(f, self.warnings.len() as u64 + self.more_warnings)?;
        self.timing.as_ref().map_or(Ok(()), |timing| timing.fmt(f))
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let images = count(self.images_decoded as u64, "image");
        let threads = count(self.threads as u64, "thread");
        writeln!(f, "  {:11} stages overlap, on {threads}", "timing")?;
        for (stage, seconds) in [("read", self.read), ("parse", self.parse), ("meshes", self.meshes)] {
            writeln!(f, "    {stage:12}  {:8.2} ms", 1e3 * seconds)?;
        }
        let sum = 1e3 * self.images_in_all;
        writeln!(f, "    {:12}  {:8.2} ms: {images}, {sum:.2} ms in all threads", "images", 1e3 * self.images)?;
        writeln!(f, "    {:12}  {:8.2} ms", "trees", 1e3 * self.trees)?;
        writeln!(f, "    {:12}  {:8.2} ms", "whole", 1e3 * self.whole)?;
        match self.ratio {
            Some(ratio) => {
                let alone = 1e3 * self.images_alone;
                writeln!(f, "    {:12}  {alone:8.2} ms; the whole is {ratio:.2} times that", "images alone")
            }
            None => Ok(()),
        }
    }
}

/// Entries below a row: name and description.
fn list<'a, T>(
    f: &mut fmt::Formatter<'_>,
    entries: &'a [T],
    describe: impl Fn(&'a T) -> (&'a str, String),
) -> fmt::Result {
    let shown = entries.iter().take(SHOWN).map(describe);
    let shown: Vec<_> = shown.map(|(name, description)| (visible(name), description)).collect();
    let width = shown.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).min(40);
    for (name, description) in shown {
        writeln!(f, "    {:width$}  {}", if name.is_empty() { "-" } else { &name }, visible(&description))?;
    }
    more(f, entries.len() as u64)
}

fn more(f: &mut fmt::Formatter<'_>, count: u64) -> fmt::Result {
    match count.saturating_sub(SHOWN as u64) {
        0 => Ok(()),
        n => writeln!(f, "    and {} more (--json lists all)", grouped(n)),
    }
}

fn mesh(m: &Mesh<'_>) -> String {
    let mut parts = Vec::new();
    if m.triangles > 0 {
        parts.push(count(m.triangles, "triangle"));
    }
    if m.shapes > 0 {
        parts.push(count(m.shapes, "shape"));
    }
    if m.instances != 1 {
        parts.push(count(m.instances, "instance"));
    }
    match m.closed {
        Some(true) => parts.push("closed".into()),
        Some(false) => parts.push(format!("open ({})", count(m.boundary_edges, "boundary edge"))),
        None => {}
    }
    if m.manifold == Some(false) {
        parts.push("not manifold".into());
    }
    if m.oriented == Some(false) {
        parts.push("not consistently oriented".into());
    }
    if m.degenerate > 0 {
        parts.push(format!("{} without area", grouped(m.degenerate)));
    }
    parts.join(", ")
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point = |p: [f64; 3]| format!("({})", p.map(significant).join(", "));
        write!(f, "{} to {}", point(self.min), point(self.max))
    }
}

/// Six significant digits: models are as small as 1e-6 and as far away as 1e7.
fn significant(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    if rounded == 0.0 || (1e-5..1e9).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_keep_six_digits_at_any_scale() {
        let texts = [0.0, 1.0, -12.3456789, 0.000123456789, 1e7, 1.23456789e-6].map(significant);
        assert_eq!(texts, ["0", "1", "-12.3457", "0.000123457", "10000000", "1.23457e-6"]);
    }
}
