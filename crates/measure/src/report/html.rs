//! One page that shows what was measured, and needs nothing but itself.

use std::fmt::Write as _;

use super::{
    chart::{Mark, mark},
    panel::{Panel, capital, picture_panel, rays_of, shape_panels},
    svg::STYLE as CHART_STYLE,
    table::{PICTURES, SHAPES, TIERS, table},
    text::{counted, escape, number},
};
use crate::result::{Accuracy, Machine, Model};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Of [`SCRIPT`]: no other script runs on the page. The test that opens a browser fails when it is out of date; print
/// it with `openssl dgst -sha256 -binary page.js | base64`.
const SCRIPT_HASH: &str = "sha256-QYHcNMfL2T6X8nf5SkZ9fkoxVtl8T2JC/yDnt10bsdY=";

/// The page: a sentence for each model, charts of error against time, tables, machine and method.
///
/// It is one file: style, script and charts stand inside, and its policy forbids any request. Text from the
/// measurement (names of files, the processor) is escaped. Without scripts all is there but sorting.
///
/// ```
/// use firsthit_measure::{report, result::{Accuracy, Model}};
/// let verdict = "Use robust: no leaks, 1.04 times the time of fast.".to_string();
/// let model = Model { name: "<ball>.obj".into(), verdict, ..Model::default() };
/// let page = report::html(&Accuracy { models: vec![model], ..Accuracy::default() });
/// assert!(page.contains("Use robust: no leaks") && page.contains("&lt;ball&gt;.obj"));
/// ```
#[must_use]
pub fn html(accuracy: &Accuracy) -> String {
    let mut body = String::new();
    header(&mut body, accuracy);
    body += "<main>\n";
    for (i, model) in accuracy.models.iter().enumerate() {
        model_section(&mut body, accuracy, model, i);
    }
    shapes_section(&mut body, accuracy);
    method_section(&mut body, accuracy);
    body += "</main>\n";
    page(&title(accuracy), &body)
}

/// A whole page with style and script. `body` is markup.
pub(super) fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
         script-src '{SCRIPT_HASH}'; img-src data:; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n\
         <title>{}</title>\n<style>{CHART_STYLE}{STYLE}</style>\n</head>\n<body>\n\
         {body}<script>{SCRIPT}</script>\n</body>\n</html>\n",
        escape(title)
    )
}

fn title(accuracy: &Accuracy) -> String {
    let names: Vec<_> = accuracy.models.iter().map(|m| m.name.as_str()).collect();
    if names.is_empty() { "What accuracy costs".into() } else { format!("What accuracy costs: {}", names.join(", ")) }
}

fn header(out: &mut String, accuracy: &Accuracy) {
    out.push_str("<header>\n<p class=\"brand\">firsthit accuracy</p>\n<h1>What accuracy costs in time</h1>\n");
    for (i, model) in accuracy.models.iter().enumerate() {
        let closed = if model.closed { "closed" } else { "not closed" };
        let link = if accuracy.models.len() > 1 {
            format!("<a href=\"#model-{i}\">{}</a>", escape(&model.name))
        } else {
            escape(&model.name)
        };
        let _ = writeln!(
            out,
            "<section class=\"verdict\"><h2>{link} <small>{}, {closed}</small></h2><p>{}</p></section>",
            counted(model.triangles, "triangle"),
            escape(&model.verdict)
        );
    }
    out.push_str("</header>\n");
}

fn model_section(out: &mut String, accuracy: &Accuracy, model: &Model, number: usize) {
    let measured = rays_of(accuracy, model);
    let pictures = picture_panel(accuracy, model);
    if measured.is_empty() && pictures.is_none() {
        return;
    }
    let _ = writeln!(out, "<section id=\"model-{number}\"><h2>{}</h2>", escape(&model.name));
    let tabs = measured.iter().map(|rays| {
        let mut tab = charts(&rays.tiers);
        if let Some(guards) = &rays.guards {
            tab += "<h3>The robust tier, guard by guard</h3>\n";
            tab += &charts(guards);
        }
        tab += &table(&rays.tiers.title, TIERS, &rays.rows, |r| !r.guard.is_empty());
        (format!("{} rays", capital(rays.kind)), tab)
    });
    out.push_str(&tabbed(&format!("m{number}"), "Kind of rays", tabs));
    if let Some((panel, rows)) = pictures {
        let _ = writeln!(out, "<h3>Pictures</h3>");
        out.push_str(&charts(&panel));
        out.push_str(&table(&panel.title, PICTURES, &rows, |_| false));
    }
    out.push_str("</section>\n");
}

fn shapes_section(out: &mut String, accuracy: &Accuracy) {
    let panels = shape_panels(accuracy);
    if panels.is_empty() {
        return;
    }
    out.push_str("<section id=\"shapes\"><h2>Analytic shapes</h2>\n");
    let tabs = panels.iter().map(|(panel, kind, rows)| {
        let numbers = table(&panel.title, SHAPES, rows, |_| false);
        (format!("{} rays", capital(kind)), charts(panel) + &numbers)
    });
    out.push_str(&tabbed("shapes", "Kind of rays", tabs));
    out.push_str("</section>\n");
}

/// Panels of which one is shown, chosen by radio buttons: that works without a script, and by keyboard.
pub(super) fn tabbed(name: &str, legend: &str, tabs: impl Iterator<Item = (String, String)>) -> String {
    let tabs: Vec<_> = tabs.collect();
    let mut out = format!("<div class=\"tabs\" role=\"group\" aria-label=\"{}\">\n", escape(legend));
    for (i, (label, _)) in tabs.iter().enumerate() {
        let checked = if i == 0 { " checked" } else { "" };
        let _ = writeln!(
            out,
            "<input type=\"radio\" name=\"{name}\" id=\"{name}-{i}\" class=\"r{i}\"{checked}>\
             <label for=\"{name}-{i}\">{}</label>",
            escape(label)
        );
    }
    for (i, (label, panel)) in tabs.iter().enumerate() {
        // The style knows so many; more are shown below each other.
        let class = if i < 8 { format!("panel p{i}") } else { "panel more".into() };
        let _ = writeln!(out, "<div class=\"{class}\"><h3 class=\"print\">{}</h3>{panel}</div>", escape(label));
    }
    out + "</div>\n"
}

fn charts(panel: &Panel<'_>) -> String {
    let mut out = String::from("<div class=\"charts\">\n");
    for chart in &panel.charts {
        let _ = writeln!(out, "<figure>{}</figure>", chart.draw("").trim_end());
    }
    out += "</div>\n";
    if !panel.guards.is_empty() {
        out += "<ul class=\"key\" aria-label=\"Guards\">";
        for (i, guard) in panel.guards.iter().enumerate() {
            let _ = write!(
                out,
                "<li><svg class=\"fh-chart\" viewBox=\"0 0 12 12\" aria-hidden=\"true\"><g class=\"fh-guard\">{}</g></svg>\
                 <b>{}</b> {}</li>",
                mark(Mark::Guard(i), 6.0, 6.0),
                Mark::letter(i),
                escape(guard)
            );
        }
        out += "</ul>\n";
    }
    out
}

fn method_section(out: &mut String, accuracy: &Accuracy) {
    let machine = &accuracy.machine;
    let facts = [
        (
            "Noise of timings",
            format!("{} % (interquartile range over median of the same work)", number(100.0 * machine.noise)),
        ),
        ("Seed of all rays", accuracy.seed.to_string()),
        ("Effort", format!("{}, {} s in all", accuracy.effort, number(accuracy.seconds))),
        ("Version", format!("firsthit {}", accuracy.version)),
    ];
    facts_section(out, machine, &facts, &accuracy.notes);
    out.push_str(include_str!("method.html"));
    out.push_str("</section>\n");
}

/// The head of the section about machine and method, left open for more.
pub(super) fn facts_section(out: &mut String, machine: &Machine, facts: &[(&str, String)], notes: &[String]) {
    out.push_str("<section id=\"method\"><h2>How it was measured</h2>\n<dl>");
    let of_machine = [
        ("Processor", machine.cpu.clone()),
        ("Logical processors", machine.cores.to_string()),
        ("System", machine.os.clone()),
    ];
    for (what, value) in of_machine.iter().chain(facts) {
        let value = if value.is_empty() { "unknown" } else { value };
        let _ = write!(out, "<div><dt>{what}</dt><dd>{}</dd></div>", escape(value));
    }
    out.push_str("</dl>\n");
    if !notes.is_empty() {
        out.push_str("<h3>Notes</h3>\n<ul class=\"notes\">");
        for note in notes {
            let _ = write!(out, "<li>{}</li>", escape(note));
        }
        out.push_str("</ul>\n");
    }
}
