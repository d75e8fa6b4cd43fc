//! What was measured, for people: charts and a page.

mod bars;
mod bench;
mod chart;
mod html;
mod label;
mod panel;
mod scale;
mod svg;
mod table;
mod text;

pub use bench::bench_html;
pub use html::html;
pub use svg::{Charts, svg};
