//! A picture of the growth: time of a ray over the logarithm of the number of triangles.

use std::fmt::Write;

use super::{Fit, Growth, Row};

/// Size of the picture.
const SIZE: [f64; 2] = [760.0, 420.0];
/// Where the plot begins and ends, in x and y.
const PLOT: [[f64; 2]; 2] = [[60.0, 560.0], [370.0, 30.0]];
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7a6a00", "#555555"];

/// Where numbers are in the picture.
struct Scale {
    log: [f64; 2],
    most: f64,
}

impl Scale {
    fn at(&self, triangles: f64, ns: f64) -> [f64; 2] {
        let [[left, right], [low, high]] = PLOT;
        let x = (triangles.log10() - self.log[0]) / (self.log[1] - self.log[0]).max(1e-9);
        [left + (right - left) * x, low + (high - low) * ns / self.most]
    }
}

impl Growth {
    /// A chart of all rows, with the fitted lines dashed, as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let sizes = || self.rows.iter().map(|r| (r.triangles as f64).log10());
        let scale = Scale {
            log: [sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max)],
            most: self.rows.iter().map(|r| r.ns_per_ray).fold(1.0, f64::max) * 1.05,
        };
        let [[left, right], [low, high]] = PLOT;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <path d=\"M{left} {high}V{low}H{right}\" fill=\"none\" stroke=\"#333\"/>\n\
             <text x=\"{left}\" y=\"18\">ns a ray; dashed: a + b log2(triangles), fitted to what fits into {} MiB</text>\n",
            SIZE[0],
            SIZE[1],
            self.cache >> 20
        );
        for decade in scale.log[0].ceil() as i32..=scale.log[1].floor() as i32 {
            let [x, _] = scale.at(10f64.powi(decade), 0.0);
            let _ = writeln!(out, "<path d=\"M{x:.1} {low}V{high}\" stroke=\"#ddd\"/>");
            let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">1e{decade}</text>", low + 18.0);
        }
        let step = 10f64.powf((scale.most / 5.0).log10().round());
        for k in 1..=(scale.most / step) as u32 {
            let [_, y] = scale.at(1.0, f64::from(k) * step);
            let _ = writeln!(out, "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#ddd\"/>");
            let label = f64::from(k) * step;
            let _ = writeln!(out, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", left - 6.0, y + 4.0);
        }
        for (k, fit) in self.fits.iter().enumerate() {
            self.curve(fit, COLOURS[k % COLOURS.len()], k, &scale, &mut out);
        }
        out + "</svg>\n"
    }

    /// One mesh, tier and kind of rays.
    fn curve(&self, fit: &Fit, colour: &str, index: usize, scale: &Scale, out: &mut String) {
        let same = |r: &&Row| (r.mesh, &r.precision, r.rays) == (fit.mesh, &fit.precision, fit.rays);
        let rows: Vec<&Row> = self.rows.iter().filter(same).collect();
        let places: Vec<[f64; 2]> = rows.iter().map(|r| scale.at(r.triangles as f64, r.ns_per_ray)).collect();
        let text: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            text.join(" ")
        );
        for [x, y] in &places {
            let _ = writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{colour}\"/>");
        }
        let ends = [rows.first(), rows.last()].map(|r| {
            let n = r.map_or(1.0, |r| r.triangles as f64);
            scale.at(n, fit.at_1 + fit.per_doubling * n.log2())
        });
        let [[x0, y0], [x1, y1]] = ends;
        let _ = writeln!(
            out,
            "<path d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\" stroke=\"{colour}\" stroke-dasharray=\"5 4\" fill=\"none\"/>"
        );
        let (x, y) = (PLOT[0][1] + 14.0, 40.0 + 18.0 * index as f64);
        let _ = writeln!(out, "<path d=\"M{x} {}h18\" stroke=\"{colour}\" stroke-width=\"3\"/>", y - 4.0);
        let _ =
            writeln!(out, "<text x=\"{}\" y=\"{y}\">{}, {}, {}</text>", x + 24.0, fit.mesh, fit.precision, fit.rays);
    }
}
