//! The table as a page of Markdown.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::verdict::{Verdict, known_difference, verdict};
use super::{End, Row};
use crate::record::Record;

const HEAD: &str = "\
# Every file of the public models, and what comes of it

Generated: `cargo run --release -p firsthit-benches --bin files -- FOLDER --markdown docs/files.md`. Each file is loaded by a
`firsthit inspect` of its own (which also builds its tree), watched from outside: how it ends, how long it takes, and the most
memory that it ever has. Triangles are those of all scenes, instances counted, beside those that two inventories list, which
other programs made. *Valid* is what Khronos's glTF validator says. The folder is not part of the project: only
[some of its models](../assets/README.md) may be passed on.
";

/// The page.
#[must_use]
pub fn page(record: &Record<Row>) -> String {
    let rows = &record.rows;
    let mut text = format!("{HEAD}\n{}, {}\n", record.date, record.circumstances().trim_end());
    text += &summary(rows);
    text += &verdicts(rows);
    text += &refusals(rows);
    text += &pictures(rows);
    text += &all(rows);
    text
}

/// What must not be: each with a list of files, which is empty if all is well.
#[must_use]
pub fn faults(rows: &[Row]) -> [(&'static str, Vec<&str>); 6] {
    let of = |fault: fn(&Row) -> bool| rows.iter().filter(|r| fault(r)).map(|r| r.file.as_str()).collect();
    let lost = |r: &Row| r.picture.as_ref().is_some_and(|p| p.end != End::Loaded && r.triangles != Some(0));
    [
        ("panics", of(|r| r.end == End::Panicked)),
        ("hangs", of(|r| r.end == End::Hung)),
        ("wrong counts", of(Row::is_count_wrong)),
        (
            "verdicts that differ for no known reason",
            of(|r| matches!(verdict(r), Some(Verdict::Lenient(None) | Verdict::Strict(None)))),
        ),
        ("files that take more than 64 times their size and 256 MiB", of(|r| r.peak_bytes > r.allowed_bytes())),
        ("pictures that could not be made of files with triangles", of(lost)),
    ]
}

fn summary(rows: &[Row]) -> String {
    let count = |end| rows.iter().filter(|r| r.end == end).count();
    let there = rows.len() - count(End::Absent);
    let mut text = String::from("\n## Summary\n| | files |\n|---|---|\n");
    let mut line = |what: &str, files: usize| _ = writeln!(text, "| {what} | {files} |");
    line("that are there", there);
    line("listed, but not there", count(End::Absent));
    line("loaded", count(End::Loaded));
    line("refused with an error", count(End::Refused));
    for (what, files) in &faults(rows)[..5] {
        line(what, files.len());
    }
    let counted = rows.iter().filter(|r| r.triangles.is_some() && r.triangles == r.known.triangles).count();
    line("with as many triangles as the inventory says", counted);
    for row in rows {
        if let Some(why) = known_difference(row) {
            _ = writeln!(
                text,
                "\n`{}`: {} triangles where the inventory has {}: {why}.",
                row.file,
                shown(row.triangles),
                shown(row.known.triangles)
            );
        }
    }
    text += "\n| slowest | seconds | of the processor |\n|---|---|---|\n";
    for row in most(rows, |r| r.seconds) {
        _ = writeln!(text, "| {} | {:.2} | {:.2} |", row.file, row.seconds, row.processor_seconds);
    }
    text += "\n| most memory | MiB | allowed: 64 times its size and 256 MiB |\n|---|---|---|\n";
    for row in most(rows, |r| r.peak_bytes as f64) {
        _ = writeln!(text, "| {} | {} | {} |", row.file, mebibytes(row.peak_bytes), mebibytes(row.allowed_bytes()));
    }
    text
}

/// The five rows with the most of something.
fn most(rows: &[Row], of: fn(&Row) -> f64) -> Vec<&Row> {
    let mut rows: Vec<&Row> = rows.iter().collect();
    rows.sort_by(|a, b| of(b).total_cmp(&of(a)));
    rows.truncate(5);
    rows
}

fn verdicts(rows: &[Row]) -> String {
    let mut lenient: BTreeMap<&str, Vec<&Row>> = BTreeMap::new();
    let mut strict = lenient.clone();
    let (mut read, mut refused) = (0, 0);
    for row in rows {
        match verdict(row) {
            Some(Verdict::Agrees) if row.end == End::Loaded => read += 1,
            Some(Verdict::Agrees) => refused += 1,
            Some(Verdict::Lenient(why)) => lenient.entry(why.unwrap_or("not known")).or_default().push(row),
            Some(Verdict::Strict(why)) => strict.entry(why.unwrap_or("not known")).or_default().push(row),
            None => {}
        }
    }
    let sum = |groups: &BTreeMap<&str, Vec<&Row>>| groups.values().map(Vec::len).sum::<usize>();
    let mut text = format!(
        "\n## Our verdict beside the validator's\n| | files |\n|---|---|\n| agrees: valid and read | {read} |\n\
         | agrees: broken and refused | {refused} |\n| more lenient: broken, but read | {} |\n\
         | stricter: valid, but refused | {} |\n",
        sum(&lenient),
        sum(&strict)
    );
    for (title, groups) in [("More lenient", &lenient), ("Stricter", &strict)] {
        _ = writeln!(text, "\n| {title}, because | files | the validator's first error | which |\n|---|---|---|---|");
        for (why, rows) in groups {
            let mut errors: Vec<&str> = rows.iter().map(|r| r.known.first_error.as_str()).collect();
            errors.sort_unstable();
            errors.dedup();
            let files: Vec<&str> = rows.iter().map(|r| short(&r.file)).collect();
            _ = writeln!(text, "| {why} | {} | {} | {} |", rows.len(), errors.join(", "), files.join(", "));
        }
    }
    text
}

/// The end of a path, its folder and its name, which is enough to find it in the table below.
fn short(file: &str) -> &str {
    file.rmatch_indices('/').nth(1).map_or(file, |(at, _)| &file[at + 1..])
}

fn refusals(rows: &[Row]) -> String {
    let mut text = String::from(
        "\n## What refused files are told\nAfter the file's name.\n\n| folder | file | the validator's first error | ours |\n|---|---|---|---|\n",
    );
    let mut last = "";
    for row in rows.iter().filter(|r| r.end == End::Refused) {
        let (folder, name) = placed(&row.file, &mut last);
        _ = writeln!(text, "| {folder} | {name} | {} | {} |", row.known.first_error, cell(&row.error));
    }
    text
}

fn pictures(rows: &[Row]) -> String {
    let pictures: Vec<_> = rows.iter().filter_map(|r| Some((r, r.picture.as_ref()?))).collect();
    if pictures.is_empty() {
        return String::new();
    }
    let made = pictures.iter().filter(|(_, p)| p.end == End::Loaded).count();
    let mut text = format!(
        "\n## Pictures\nEvery file that loads is rendered: 256 x 256, 16 samples, at most 20 seconds, one thread. {made} pictures of \
         {} files.\n",
        pictures.len()
    );
    for (row, picture) in pictures.iter().filter(|(_, p)| p.end != End::Loaded) {
        _ = writeln!(text, "- `{}`: {}: {}", row.file, picture.end.name(), cell(&picture.error));
    }
    text
}

fn all(rows: &[Row]) -> String {
    let mut text = String::from(
        "\n## All files\n| folder | file | valid | | triangles | inventory | warnings | seconds | MiB |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut last = "";
    for row in rows {
        let (folder, name) = placed(&row.file, &mut last);
        let valid = row.known.valid.map_or("", |valid| if valid { "yes" } else { "no" });
        _ = writeln!(
            text,
            "| {folder} | {name} | {valid} | {} | {} | {} | {} | {:.2} | {} |",
            row.end.name(),
            shown(row.triangles),
            shown(row.known.triangles),
            row.warnings,
            row.seconds,
            mebibytes(row.peak_bytes)
        );
    }
    text
}

/// The folder of a file, where it is another than the `last` one, and its name.
fn placed<'a>(file: &'a str, last: &mut &'a str) -> (&'a str, &'a str) {
    let (folder, name) = file.rsplit_once('/').unwrap_or(("", file));
    let changed = *last != folder;
    *last = folder;
    (if changed { folder } else { "" }, name)
}

fn shown(count: Option<u64>) -> String {
    count.map_or_else(String::new, |n| n.to_string())
}

fn mebibytes(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

/// Text that stays inside its cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "&lt;")
}

#[cfg(test)]
mod tests {
    use super::super::verdict::tests::row;
    use super::*;

    fn rows() -> Vec<Row> {
        let mut refused = row("b/broken.gltf", End::Refused, false, "INVALID_JSON");
        refused.error = "line 1 column 2: not JSON: a | b".into();
        vec![
            row("a/good.gltf", End::Loaded, true, ""),
            refused,
            row("b/empty.gltf", End::Loaded, false, "EMPTY_ENTITY"),
        ]
    }

    #[test]
    fn the_page_has_every_file_and_every_verdict() {
        let text = page(&Record::new(1, 1, Vec::new(), rows()));
        for wanted in [
            "| loaded | 2 |",
            "| refused with an error | 1 |",
            "| panics | 0 |",
            "| agrees: valid and read | 1 |",
            "| agrees: broken and refused | 1 |",
            "| more lenient: broken, but read | 1 |",
            "| b | broken.gltf | INVALID_JSON | line 1 column 2: not JSON: a \\| b |",
            "| a | good.gltf | yes | loaded | 12 | 12 | 0 | 0.01 | 20 |\n| b | broken.gltf | no | refused |  | 12 |",
            "|  | empty.gltf | no | loaded | 12 |",
        ] {
            assert!(text.contains(wanted), "{wanted} in\n{text}");
        }
    }

    #[test]
    fn what_must_not_be_is_named() {
        let mut rows = rows();
        assert!(faults(&rows).iter().all(|(_, files)| files.is_empty()));
        rows[0].peak_bytes = 300 << 20;
        rows[1].end = End::Hung;
        rows[2].triangles = Some(13);
        let found: Vec<_> = faults(&rows).into_iter().filter(|(_, files)| !files.is_empty()).collect();
        assert_eq!(found.len(), 3);
        assert!(found.contains(&("hangs", vec!["b/broken.gltf"])));
    }
}
