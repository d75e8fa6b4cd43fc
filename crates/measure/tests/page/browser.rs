//! The page in a headless browser: its script runs, its policy holds, nothing goes wrong.
//!
//! Where no browser is installed the tests are skipped with a reason; with `FIRSTHIT_REQUIRE_SHARED=1` they fail.

use std::{
    collections::HashSet,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use firsthit_measure::Subject;
use firsthit_measure::bench::{self, BenchOptions};
use firsthit_measure::report::{self, Charts};

use super::sample;

/// A browser that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(60);

fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    std::env::split_paths(&path).flat_map(|dir| names.map(|n| dir.join(n))).find(|p| p.is_file())
}

/// The browser, or `None` where there is none and that is allowed.
fn browser_or_skip() -> Option<PathBuf> {
    let found = browser();
    if found.is_none() {
        let required = std::env::var_os("FIRSTHIT_REQUIRE_SHARED").is_some_and(|v| !v.is_empty() && v != "0");
        assert!(!required, "no browser is installed (chromium, google-chrome), and tests may not be skipped");
        eprintln!("skipped: no browser is installed (chromium, google-chrome)");
    }
    found
}

/// Runs the browser on a file and returns what it prints.
fn open(browser: &Path, dir: &Path, file: &Path, arguments: &[&str]) -> String {
    let out = dir.join("out.txt");
    let mut child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars"])
        .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
        // Whatever would go out ends here.
        .args(["--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND"])
        .arg(format!("--user-data-dir={}", dir.join("profile").display()))
        .args(arguments)
        .arg(format!("file://{}", file.display()))
        .stdout(fs::File::create(&out).unwrap())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if start.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("the browser did not finish in {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    assert!(status.success(), "{status}");
    fs::read_to_string(out).unwrap()
}

/// The value of an attribute of the page's root element.
fn root_attribute<'a>(dom: &'a str, name: &str) -> Option<&'a str> {
    let tag = dom.split("<html").nth(1)?.split('>').next()?;
    tag.split(&format!(" {name}=\"")).nth(1)?.split('"').next()
}

#[test]
fn the_page_runs_in_a_browser() {
    let Some(browser) = browser_or_skip() else { return };
    let dir = tempfile::tempdir().unwrap();
    let page = report::html(&sample::accuracy());
    let file = dir.path().join("page.html");
    fs::write(&file, &page).unwrap();
    let dom = open(&browser, dir.path(), &file, &["--dump-dom"]);

    let points = page.matches("class=\"fh-point").count();
    assert!(points > 300, "{points}");
    assert_eq!(root_attribute(&dom, "data-points"), Some(&*points.to_string()), "the script ran to its end");
    assert_eq!(root_attribute(&dom, "data-errors"), None);
    // Every point got its words, every table its buttons.
    assert_eq!(dom.matches("role=\"img\" aria-label=\"").count(), points);
    assert_eq!(dom.matches("<th scope=\"col\"").count(), dom.matches("<button>").count());
}

#[test]
fn the_policy_of_the_page_stops_scripts_and_requests() {
    let Some(browser) = browser_or_skip() else { return };
    let dir = tempfile::tempdir().unwrap();
    // What would happen if something were not escaped.
    let evil = "<script>document.documentElement.dataset.evil = 1</script><img src=\"http://127.0.0.1:9/x.png\">";
    let page = report::html(&sample::accuracy()).replace("</main>", "</main><!--here-->");
    let (head, tail) = page.split_once("<!--here-->").unwrap();
    let script_end = tail.find("</script>").unwrap() + "</script>".len();
    let page = format!("{head}{}{evil}{}", &tail[..script_end], &tail[script_end..]);
    let file = dir.path().join("page.html");
    fs::write(&file, page).unwrap();
    let dom = open(&browser, dir.path(), &file, &["--dump-dom"]);
    assert_eq!(root_attribute(&dom, "data-evil"), None, "a foreign script must not run");
    let errors = root_attribute(&dom, "data-errors").expect("the page notices what its policy stopped");
    assert!(errors.contains("script-src") && errors.contains("img-src"), "{errors}");
}

#[test]
fn page_and_charts_can_be_seen() {
    let Some(browser) = browser_or_skip() else { return };
    let dir = tempfile::tempdir().unwrap();
    let accuracy = sample::accuracy();
    let mut files = vec![("page.html".to_string(), report::html(&accuracy))];
    files.extend(report::svg(&accuracy, Charts::Sheets).into_iter().take(1).map(|(n, svg)| (n + ".svg", svg)));
    for (name, text) in files {
        let file = dir.path().join(&name);
        fs::write(&file, text).unwrap();
        let shot = dir.path().join("shot.png");
        let arguments = [&format!("--screenshot={}", shot.display()), "--window-size=1120,900"];
        open(&browser, dir.path(), &file, &arguments.map(|a| a as &str));
        let picture = image::open(&shot).unwrap().to_rgb8();
        let colours: HashSet<_> = picture.pixels().map(|p| p.0).collect();
        assert!(colours.len() > 50, "{name} shows {} colours", colours.len());
        fs::remove_file(shot).unwrap();
    }
}

/// The page of a real, small measurement of speed.
#[test]
fn the_page_of_speeds_runs_in_a_browser() {
    let Some(browser) = browser_or_skip() else { return };
    let dir = tempfile::tempdir().unwrap();
    let options = BenchOptions { count: 500, budget: Duration::ZERO, ..BenchOptions::default() };
    let bench = bench::run(&[Subject::builtin()], &options, &()).unwrap();
    let page = report::bench_html(&bench);
    let file = dir.path().join("bench.html");
    fs::write(&file, &page).unwrap();
    let dom = open(&browser, dir.path(), &file, &["--dump-dom"]);
    // A bar and a point in the chart of memory for each row.
    let points = page.matches("class=\"fh-point").count();
    assert_eq!(points, 2 * bench.rows.len());
    assert_eq!(root_attribute(&dom, "data-points"), Some(&*points.to_string()), "the script ran to its end");
    assert_eq!(root_attribute(&dom, "data-errors"), None);

    let shot = dir.path().join("shot.png");
    let arguments = [&format!("--screenshot={}", shot.display()), "--window-size=1120,900"];
    open(&browser, dir.path(), &file, &arguments.map(|a| a as &str));
    let picture = image::open(&shot).unwrap().to_rgb8();
    let colours: HashSet<_> = picture.pixels().map(|p| p.0).collect();
    assert!(colours.len() > 50, "{} colours", colours.len());
}
