//! A race as tables, and in a few figures.

use std::fmt::Write as _;

use crate::race::Row;

/// What one engine is measured by: the better of some others, on the same rays in the same run.
struct Figure {
    engine: &'static str,
    against: &'static [&'static str],
}

const fn figure(engine: &'static str, against: &'static [&'static str]) -> Figure {
    Figure { engine, against }
}

const FIGURES: [Figure; 12] = [
    figure("firsthit-robust", &["embree-robust"]),
    figure("firsthit-robust", &["embree-fast"]),
    figure("firsthit-robust-high", &["embree-robust"]),
    figure("firsthit-robust-high", &["embree-fast"]),
    figure("firsthit-fast", &["embree-fast", "embree-high-fast"]),
    figure("firsthit-fast-high", &["embree-fast", "embree-high-fast"]),
    figure("firsthit-robust-batch", &["embree-pack16", "embree-high-pack16"]),
    figure("firsthit-robust-batch", &["firsthit-robust"]),
    figure("firsthit-robust", &["firsthit-fast"]),
    figure("firsthit-double", &["firsthit-fast"]),
    figure("firsthit-exact", &["firsthit-fast"]),
    figure("obvhs-cwbvh", &["embree-fast"]),
];

/// Ratios of the best repetitions.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// `engine / better of others`.
    pub name: String,
    /// Geometric mean over all scenes and rays where both are.
    pub mean: f64,
    /// The least, and where it is.
    pub worst: (f64, String),
    /// How many there are.
    pub count: usize,
}

/// The figures that a race has rows for.
#[must_use]
pub fn ratios(rows: &[Row]) -> Vec<Ratio> {
    FIGURES.iter().filter_map(|f| ratio(rows, f)).collect()
}

/// The best speed of an engine on the rays of a row.
fn beside(rows: &[Row], row: &Row, engine: &str) -> Option<f64> {
    let same = |r: &&Row| r.scene == row.scene && r.rays == row.rays && r.engine == engine;
    rows.iter().find(same).map(|r| r.mrays_per_s_best)
}

fn ratio(rows: &[Row], figure: &Figure) -> Option<Ratio> {
    let mut each: Vec<(f64, String)> = Vec::new();
    for row in rows.iter().filter(|r| r.engine == figure.engine) {
        let best = figure.against.iter().filter_map(|e| beside(rows, row, e)).reduce(f64::max);
        each.extend(best.map(|b| (row.mrays_per_s_best / b, format!("{} {}", row.scene, row.rays))));
    }
    let mean = (each.iter().map(|r| r.0.ln()).sum::<f64>() / each.len() as f64).exp();
    let count = each.len();
    let name = match figure.against {
        [one] => format!("{} / {one}", figure.engine),
        several => format!("{} / better of {}", figure.engine, several.join(", ")),
    };
    let worst = each.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Ratio { name, mean, worst, count })
}

/// The figures as a Markdown table.
#[must_use]
pub fn figures(rows: &[Row]) -> String {
    let mut out = String::from("| figure | geometric mean | worst | over |\n|---|---|---|---|\n");
    for Ratio { name, mean, worst: (least, place), count } in ratios(rows) {
        let _ = writeln!(out, "| {name} | {mean:.2} | {least:.2} ({place}) | {count} |");
    }
    out
}

/// Every row, as Markdown tables: one for each scene and kind of rays, one of what was built.
#[must_use]
pub fn tables(rows: &[Row]) -> String {
    let mut out = String::new();
    for (i, row) in rows.iter().enumerate() {
        let first = |same: &dyn Fn(&Row) -> bool| !rows[..i].iter().any(same);
        if first(&|r| r.scene == row.scene) {
            let _ = writeln!(out, "\n## {}, {} triangles", row.scene, row.triangles);
            builds(&mut out, rows.iter().filter(|r| r.scene == row.scene));
        }
        if first(&|r| (&r.scene, r.rays) == (&row.scene, row.rays)) {
            let _ = writeln!(
                out,
                "\n### {}, {}: Mrays/s\n\n| engine | best | median | x embree-fast | x embree-robust | wrong | sure | \
                 inexcusable |\n|---|---|---|---|---|---|---|---|",
                row.scene, row.rays
            );
        }
        let times =
            |engine| beside(rows, row, engine).map_or("-".to_owned(), |b| format!("{:.2}", row.mrays_per_s_best / b));
        let _ = writeln!(
            out,
            "| {} | {:.2} | {:.2} | {} | {} | {} | {} | {} |",
            row.engine,
            row.mrays_per_s_best,
            row.mrays_per_s_median,
            times("embree-fast"),
            times("embree-robust"),
            row.wrong,
            row.wrong_sure,
            row.wrong_inexcusable
        );
    }
    out
}

fn builds<'a>(out: &mut String, rows: impl Iterator<Item = &'a Row>) {
    out.push_str("\n| engine | build, s | bytes a triangle | by its own account |\n|---|---|---|---|\n");
    let mut seen: Vec<&str> = Vec::new();
    for row in rows {
        if seen.contains(&row.engine) {
            continue;
        }
        seen.push(row.engine);
        let own = row.own_bytes_per_triangle.map_or("-".to_owned(), |b| format!("{b:.1}"));
        let _ = writeln!(out, "| {} | {:.3} | {:.1} | {own} |", row.engine, row.build_s, row.bytes_per_triangle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(scene: &str, engine: &'static str, speed: f64) -> Row {
        Row {
            scene: scene.into(),
            triangles: 10,
            rays: "primary",
            count: 5,
            engine,
            mrays_per_s_best: speed,
            mrays_per_s_median: speed,
            wrong: 0,
            wrong_sure: 0,
            wrong_inexcusable: 0,
            build_s: 0.5,
            bytes_per_triangle: 60.0,
            own_bytes_per_triangle: None,
        }
    }

    #[test]
    fn ratios_are_to_the_better_one() {
        let rows = [
            row("a", "firsthit-fast", 8.0),
            row("a", "embree-fast", 2.0),
            row("a", "embree-high-fast", 4.0),
            row("b", "firsthit-fast", 4.0),
            row("b", "embree-fast", 8.0),
            row("c", "firsthit-fast", 9.0),
        ];
        let ratios = ratios(&rows);
        assert_eq!(ratios.len(), 1);
        assert!((ratios[0].mean - 1.0).abs() < 1e-12);
        assert_eq!((&ratios[0].worst, ratios[0].count), (&(0.5, "b primary".to_owned()), 2));
        assert!(figures(&rows).contains("| 1.00 | 0.50 (b primary) | 2 |"));
        let text = tables(&rows);
        assert!(text.contains("| firsthit-fast | 8.00 | 8.00 | 4.00 | - | 0 | 0 | 0 |"), "{text}");
        assert_eq!(text.matches("## b, 10 triangles").count(), 1);
    }
}
