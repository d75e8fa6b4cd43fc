//! How many answers were looked at, and how many were wrong.

use serde::Serialize;

/// Where queries come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// In and around the box of the mesh.
    Random,
    /// At what is hard: corners, edges, planes.
    Aimed,
}

/// Queries of one kind from one source.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The model's name.
    pub model: String,
    /// Its triangles.
    pub triangles: usize,
    /// What was asked.
    pub query: &'static str,
    /// Where from.
    pub source: Source,
    /// Power of two by which the mesh was scaled; 0: judged by brute force. Others: compared with that.
    pub exponent: i32,
    /// Answers that were looked at.
    pub asked: u64,
    /// Answers that were wrong.
    pub wrong: u64,
    /// Left out, since the question has no certain answer there: inside or outside on the surface itself.
    pub left_out: u64,
}

/// Numbers of one model.
#[derive(Debug)]
pub struct Tally {
    model: String,
    triangles: usize,
    /// In the order in which they were first met.
    pub rows: Vec<Row>,
    /// The first few wrong answers, in words.
    pub failures: Vec<String>,
}

/// Wrong answers that are told.
const TOLD: usize = 12;

impl Tally {
    /// Nothing yet.
    #[must_use]
    pub fn new(model: &str, triangles: usize) -> Self {
        Self { model: model.into(), triangles, rows: Vec::new(), failures: Vec::new() }
    }

    fn row(&mut self, query: &'static str, source: Source, exponent: i32) -> &mut Row {
        let known = |r: &Row| r.query == query && r.source == source && r.exponent == exponent;
        let at = self.rows.iter().position(known).unwrap_or_else(|| {
            let (model, triangles) = (self.model.clone(), self.triangles);
            self.rows.push(Row { model, triangles, query, source, exponent, asked: 0, wrong: 0, left_out: 0 });
            self.rows.len() - 1
        });
        &mut self.rows[at]
    }

    /// Adds an answer; `tell` says what was wrong with it.
    pub fn add(&mut self, query: &'static str, of: (Source, i32), right: bool, tell: impl FnOnce() -> String) {
        let row = self.row(query, of.0, of.1);
        row.asked += 1;
        row.wrong += u64::from(!right);
        if !right && self.failures.len() < TOLD {
            self.failures.push(format!("{} {query} {of:?}: {}", self.model, tell()));
        }
    }

    /// Adds a question without a certain answer.
    pub fn leave_out(&mut self, query: &'static str, of: (Source, i32)) {
        self.row(query, of.0, of.1).left_out += 1;
    }

    /// All wrong answers.
    #[must_use]
    pub fn wrong(&self) -> u64 {
        self.rows.iter().map(|r| r.wrong).sum()
    }
}

/// The rows as a Markdown table: answers of all kinds, wrong ones in brackets where there are any.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut out =
        String::from("| model | query | random | aimed | scaled | wrong | left out |\n|---|---|---|---|---|---|---|\n");
    let mut done: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        if done.contains(&(&row.model, row.query)) {
            continue;
        }
        done.push((&row.model, row.query));
        let same = || rows.iter().filter(|r| r.model == row.model && r.query == row.query);
        let asked = |keep: &dyn Fn(&Row) -> bool| -> u64 { same().filter(|r| keep(r)).map(|r| r.asked).sum() };
        let random = asked(&|r| r.exponent == 0 && r.source == Source::Random);
        let aimed = asked(&|r| r.exponent == 0 && r.source == Source::Aimed);
        let scaled = asked(&|r| r.exponent != 0);
        let (wrong, left): (u64, u64) = (same().map(|r| r.wrong).sum(), same().map(|r| r.left_out).sum());
        out += &format!("| {} | {} | {random} | {aimed} | {scaled} | {wrong} | {left} |\n", row.model, row.query);
    }
    out
}
