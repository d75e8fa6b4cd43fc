//! Charts as SVG files that stand alone.

use std::fmt::Write as _;

use super::{
    chart::{Chart, HEIGHT, Mark, WIDTH, mark},
    panel::{Panel, picture_panel, rays_of, shape_panels},
    text::{counted, escape, number, slug},
};
use crate::result::{Accuracy, Model};

/// Colours and type of all charts, light and dark.
pub(super) const STYLE: &str = include_str!("chart.css");

/// Which charts to draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Charts {
    /// Sheets: all metrics of a model and a kind of rays in one picture; beside it a sheet of the robust tier's guards,
    /// one of a model's pictures, one of shapes.
    #[default]
    Sheets,
    /// Every chart in a picture of its own.
    Each,
}

/// The charts of a measurement: error against time, both axes logarithmic, one point for each tier and guard.
///
/// Returns names, made of small letters, digits and hyphens, without an extension, each once; and SVG documents that
/// need nothing else. Points without an error stand in a band below the axis which says what that means.
///
/// ```
/// use firsthit_measure::{report, result::{Accuracy, Model, TierRow}};
/// let row = TierRow {
///     model: "ball.obj".into(), tier: "robust".into(), rays: "aimed".into(), ns_per_ray: 120.0,
///     leaks: Some(0), aimed_rays: 100_000, ..TierRow::default()
/// };
/// let model = Model { name: "ball.obj".into(), closed: true, ..Model::default() };
/// let accuracy = Accuracy { models: vec![model], tiers: vec![row], ..Accuracy::default() };
/// let charts = report::svg(&accuracy, report::Charts::Each);
/// assert_eq!(charts[0].0, "ball-obj-aimed-rays-leaks");
/// assert!(charts[0].1.contains("none seen in 100,000"));
/// ```
#[must_use]
pub fn svg(accuracy: &Accuracy, charts: Charts) -> Vec<(String, String)> {
    let mut files = Vec::new();
    for model in &accuracy.models {
        let tiers = rays_of(accuracy, model).into_iter().flat_map(|rays| [Some(rays.tiers), rays.guards]).flatten();
        let pictures = picture_panel(accuracy, model).into_iter().map(|(panel, _)| panel);
        files.extend(tiers.chain(pictures).flat_map(|p| draw(accuracy, Some(model), &p, charts)));
    }
    files.extend(shape_panels(accuracy).iter().flat_map(|(p, ..)| draw(accuracy, None, p, charts)));
    // Models of the same name in two folders shall not overwrite each other's charts.
    for i in 1..files.len() {
        let same = files[..i].iter().filter(|(name, _)| *name == files[i].0).count();
        if same > 0 {
            files[i].0 = format!("{}-{}", files[i].0, same + 1);
        }
    }
    files
}

fn draw(accuracy: &Accuracy, model: Option<&Model>, panel: &Panel<'_>, charts: Charts) -> Vec<(String, String)> {
    match charts {
        Charts::Sheets if panel.charts.is_empty() => Vec::new(),
        Charts::Sheets => vec![(slug(&panel.title), sheet(accuracy, model, panel))],
        Charts::Each => panel.charts.iter().map(|c| (c.slug.clone(), alone(panel, c))).collect(),
    }
}

/// One chart as a document, with its key below.
fn alone(panel: &Panel<'_>, chart: &Chart) -> String {
    let key = key(panel, WIDTH, HEIGHT + 10.0);
    let height = HEIGHT + if key.is_empty() { 0.0 } else { key_height(panel, WIDTH) + 10.0 };
    document(WIDTH, height, &chart.title, &(chart.draw(&at(0.0, 0.0)) + &key))
}

/// All charts of a panel as a document.
fn sheet(accuracy: &Accuracy, model: Option<&Model>, panel: &Panel<'_>) -> String {
    const HEAD: f64 = 64.0;
    let columns = if panel.charts.len() > 1 { 2 } else { 1 };
    let rows = panel.charts.len().div_ceil(columns);
    let width = WIDTH * columns as f64;
    let mut below = HEAD + HEIGHT * rows as f64 + 10.0;

    let mut facts = vec![format!("firsthit {}", accuracy.version)];
    facts.extend(model.map(|m| counted(m.triangles, "triangle")));
    facts.extend(Some(accuracy.machine.cpu.clone()).filter(|cpu| !cpu.is_empty()));
    facts.push(format!("noise of timings {} %", number(100.0 * accuracy.machine.noise)));
    let mut body = format!(
        "<text class=\"fh-head\" x=\"24\" y=\"34\">{}</text><text class=\"fh-sub\" x=\"24\" y=\"54\">{}</text>\n",
        escape(&panel.title),
        escape(&facts.join(" · "))
    );
    for (i, chart) in panel.charts.iter().enumerate() {
        let (column, row) = (i % columns, i / columns);
        body += &chart.draw(&at(WIDTH * column as f64, HEAD + HEIGHT * row as f64));
    }
    body += &key(panel, width, below);
    below += key_height(panel, width);
    document(width, below + 8.0, &panel.title, &body)
}

fn at(x: f64, y: f64) -> String {
    format!("x=\"{x}\" y=\"{y}\" width=\"{WIDTH}\" height=\"{HEIGHT}\"")
}

fn document(width: f64, height: f64, title: &str, body: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height:.0}\" width=\"{width}\" \
         height=\"{height:.0}\" class=\"fh-page\">\n<title>{}</title>\n<style>{STYLE}</style>\n\
         <rect class=\"fh-paper\" width=\"100%\" height=\"100%\"/>\n{body}</svg>\n",
        escape(title)
    )
}

const KEY_ROW: f64 = 20.0;

/// The letters of guards and their names in lines as long as the picture is wide: (x, line, index).
fn key_places(panel: &Panel<'_>, width: f64) -> Vec<(f64, usize)> {
    let (mut x, mut line) = (24.0, 0);
    let mut places = Vec::new();
    for guard in &panel.guards {
        let advance = 44.0 + 6.6 * guard.chars().count() as f64;
        if x > 24.0 && x + advance > width - 12.0 {
            (x, line) = (24.0, line + 1);
        }
        places.push((x, line));
        x += advance;
    }
    places
}

fn key_height(panel: &Panel<'_>, width: f64) -> f64 {
    key_places(panel, width).last().map_or(0.0, |(_, line)| KEY_ROW * (*line as f64 + 1.0) + 4.0)
}

fn key(panel: &Panel<'_>, width: f64, top: f64) -> String {
    let mut out = String::new();
    for (i, (guard, (x, line))) in panel.guards.iter().zip(key_places(panel, width)).enumerate() {
        let y = top + KEY_ROW * line as f64 + 8.0;
        let _ = writeln!(
            out,
            "<g class=\"fh-guard\">{}<text class=\"fh-key\" x=\"{:.1}\" y=\"{:.1}\"><tspan \
             class=\"fh-letter\">{}</tspan> {}</text></g>",
            mark(Mark::Guard(i), x + 6.0, y),
            x + 15.0,
            y + 4.0,
            Mark::letter(i),
            escape(guard)
        );
    }
    out
}
