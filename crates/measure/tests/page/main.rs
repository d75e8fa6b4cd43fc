//! The page of an accuracy measurement, as a text and in a real browser.

mod browser;
mod sample;

use std::collections::HashSet;

use firsthit_measure::{
    bench::{Bench, BenchModel, BuildRow, SpeedRow},
    report::{self, Charts},
    result::{Accuracy, Model, TierRow},
};

#[test]
fn text_of_the_measurement_cannot_become_markup() {
    let evil = "</style></script><script>alert(1)</script><img src=x onerror=alert(1)>\"'&\u{0}";
    let model = Model { name: evil.into(), verdict: evil.into(), ..Model::default() };
    let row = TierRow {
        model: evil.into(),
        tier: evil.into(),
        guard: evil.into(),
        rays: evil.into(),
        ns_per_ray: 1.0,
        compared: 10,
        ..TierRow::default()
    };
    let mut accuracy = Accuracy {
        version: evil.into(),
        effort: evil.into(),
        models: vec![model],
        tiers: vec![row],
        notes: vec![evil.into()],
        ..Accuracy::default()
    };
    accuracy.machine.cpu = evil.into();
    accuracy.machine.os = evil.into();
    let page = report::html(&accuracy);
    assert_eq!(page.matches("<script").count(), 1, "only the page's own");
    for (name, svg) in report::svg(&accuracy, Charts::Each).into_iter().chain([("page".into(), page)]) {
        assert!(!svg.contains("<img") && !svg.contains("alert(1)<"), "{name}");
        assert!(!svg.contains('\0'), "{name}");
    }
}

#[test]
fn text_of_a_measurement_of_speed_cannot_become_markup() {
    let evil = "</style></script><script>alert(1)</script><img src=x onerror=alert(1)>\"'&\u{0}";
    let bench = Bench {
        version: evil.into(),
        models: vec![BenchModel { name: evil.into(), triangles: 1 }],
        builds: vec![BuildRow { model: evil.into(), engine: evil.into(), ..BuildRow::default() }],
        rows: vec![SpeedRow { model: evil.into(), engine: evil.into(), rays: evil.into(), ..SpeedRow::default() }],
        notes: vec![evil.into()],
        ..Bench::default()
    };
    for page in [report::bench_html(&bench), report::bench_html(&Bench::default())] {
        assert_eq!(page.matches("<script").count(), 1, "only the page's own");
        assert!(!page.contains("<img") && !page.contains("alert(1)<") && !page.contains('\0'));
        let words = page.split("<script>").next().unwrap();
        assert!(words.contains("How it was measured") && !words.contains("NaN"));
    }
}

#[test]
fn nothing_measured_is_still_a_page() {
    let page = report::html(&Accuracy::default());
    let words = page.split("<script>").next().unwrap();
    assert!(words.contains("How it was measured") && !words.contains("NaN"));
    assert!(report::svg(&Accuracy::default(), Charts::Sheets).is_empty());
}

#[test]
fn a_page_and_its_charts_ask_for_nothing_from_outside() {
    let accuracy = sample::accuracy();
    let page = report::html(&accuracy);
    let charts = report::svg(&accuracy, Charts::Each);
    for text in charts.iter().chain(&report::svg(&accuracy, Charts::Sheets)).map(|c| &c.1).chain([&page]) {
        // The name of the SVG language is the one address.
        assert!(!text.replace("http://www.w3.org/2000/svg", "").contains("//www"), "no address");
        for what in ["http:", "https:", "@import", "url(", "src=", "xlink"] {
            let found = text.replace("\"http://www.w3.org/2000/svg\"", "").contains(what);
            assert!(!found, "{what}");
        }
    }
}

#[test]
fn charts_have_names_of_their_own_and_plot_numbers_only() {
    let accuracy = sample::accuracy();
    for choice in [Charts::Each, Charts::Sheets] {
        let charts = report::svg(&accuracy, choice);
        let names: HashSet<_> = charts.iter().map(|c| &c.0).collect();
        assert_eq!(names.len(), charts.len());
        for (name, svg) in &charts {
            assert!(name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-'), "{name}");
            for attribute in [" x=\"", " y=\"", " d=\"", " cx=\"", " x1=\"", " y2=\""] {
                for value in svg.split(attribute).skip(1).filter_map(|rest| rest.split('"').next()) {
                    assert!(!value.contains("NaN") && !value.contains("inf"), "{name}: {attribute}{value}");
                }
            }
        }
    }
}

#[test]
fn a_zero_stands_in_the_band_below_whatever_could_be_counted() {
    let row = |tier: &str, ns_per_ray: f64, leaks: u64| TierRow {
        model: "m".into(),
        tier: tier.into(),
        rays: "aimed".into(),
        ns_per_ray,
        leaks: Some(leaks),
        aimed_rays: 1_000_000,
        ..TierRow::default()
    };
    let accuracy = Accuracy {
        models: vec![Model { name: "m".into(), ..Model::default() }],
        // One seen is less than the 3 of the bound: it must still stand above what saw none.
        tiers: vec![row("fast", 100.0, 900), row("robust", 110.0, 1), row("exact", 200.0, 0)],
        ..Accuracy::default()
    };
    let charts = report::svg(&accuracy, Charts::Each);
    let svg = &charts.iter().find(|c| c.0 == "m-aimed-rays-leaks").unwrap().1;
    let heights: Vec<f64> = svg
        .split("class=\"fh-target\"")
        .skip(1)
        .map(|rest| rest.split("cy=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap())
        .collect();
    let band: f64 = svg
        .split("class=\"fh-band\"")
        .nth(1)
        .unwrap()
        .split(" y=\"")
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let &[fast, robust, exact] = &heights[..] else { panic!("{heights:?}") };
    assert!(fast < robust && robust < band && band < exact, "{heights:?}, band from {band}");
    assert!(svg.contains("none seen in 1,000,000: &lt; 3 per million"));
}
