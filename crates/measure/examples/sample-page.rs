//! Writes the page and the charts of a made-up measurement into a folder, to look at them while changing them.

use std::{env, fs, io, path::PathBuf};

use firsthit_measure::report::{self, Charts};

#[path = "../tests/page/sample.rs"]
mod sample;

fn main() -> io::Result<()> {
    let dir = PathBuf::from(env::args_os().nth(1).unwrap_or_else(|| ".".into()));
    let accuracy = sample::accuracy();
    fs::create_dir_all(&dir)?;
    fs::write(dir.join("page.html"), report::html(&accuracy))?;
    let each = report::svg(&accuracy, Charts::Each);
    for (name, svg) in report::svg(&accuracy, Charts::Sheets).into_iter().chain(each) {
        fs::write(dir.join(name + ".svg"), svg)?;
    }
    Ok(())
}
