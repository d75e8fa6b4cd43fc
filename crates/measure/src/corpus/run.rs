//! Runs engines over the cases and sums up.

use std::collections::BTreeMap;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use firsthit_geometry::Precision;
use serde::Serialize;

use super::judge::required;
use super::{Case, Engine, Verdict, judge};

/// What engines at tiers made of the cases.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// One row for each group, category and tier, over all engines.
    #[serde(rename = "corpus")]
    pub rows: Vec<Row>,
    /// What had to be right and was not.
    pub failures: Vec<Complaint>,
    /// What was wrong where it may be.
    #[serde(skip)]
    pub excused: Vec<Complaint>,
}

/// How a tier did in a category. A case counts as passed if every engine that has such a question answered it right.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Row {
    /// What the cases are about.
    pub group: String,
    /// What makes them hard.
    pub category: String,
    /// The tier's name.
    pub tier: &'static str,
    /// All cases.
    pub cases: usize,
    /// Cases, of those that were asked, that the tier must have right.
    pub required: usize,
    /// Cases answered right, required or not.
    pub passed: usize,
    /// Required cases answered wrong.
    pub failed: usize,
    /// Cases that no engine has a question for.
    pub skipped: usize,
    /// Why cases were skipped, and how many.
    pub skip_reasons: BTreeMap<&'static str, usize>,
    /// The ids of `failed`.
    pub failed_ids: Vec<String>,
}

/// A wrong answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Complaint {
    /// The case.
    pub id: String,
    /// The tier's name.
    pub tier: &'static str,
    /// Who answered.
    pub engine: String,
    /// What is wrong.
    pub why: String,
}

impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}, {}: {}", self.id, self.tier, self.engine, self.why)
    }
}

/// Puts all cases to each engine at each tier. A panic is a failure of its case.
#[must_use]
pub fn run(cases: &[Case], engines: &[Engine], tiers: &[Precision]) -> Report {
    let mut report = Report::default();
    let mut rows: BTreeMap<(&str, &str, usize), Row> = BTreeMap::new();
    for (order, &tier) in tiers.iter().enumerate() {
        for case in cases {
            let row = rows.entry((&case.group, &case.category, order)).or_insert_with(|| Row {
                group: case.group.clone(),
                category: case.category.clone(),
                tier: tier.name(),
                ..Row::default()
            });
            report.ask(case, engines, tier, row);
        }
    }
    report.rows = rows.into_values().collect();
    report
}

impl Report {
    fn ask(&mut self, case: &Case, engines: &[Engine], tier: Precision, row: &mut Row) {
        let (mut asked, mut required_by_any, mut wrong, mut failed) = (false, false, false, false);
        let mut reason = "no engine";
        for &engine in engines {
            let promises = engine.promises(tier);
            let answer = || judge(case, promises, &engine.answer(case, tier));
            let verdict = catch_unwind(AssertUnwindSafe(answer)).unwrap_or_else(|_| Verdict::Failed("panicked".into()));
            let complaint = |why| Complaint { id: case.id.clone(), tier: tier.name(), engine: engine.to_string(), why };
            match verdict {
                Verdict::Skipped(why) => {
                    reason = why;
                    continue;
                }
                Verdict::Passed => {}
                Verdict::Failed(why) => {
                    failed = true;
                    self.failures.push(complaint(why));
                }
                Verdict::Excused(why) => {
                    wrong = true;
                    self.excused.push(complaint(why));
                }
            }
            asked = true;
            required_by_any |= required(case, promises);
        }
        row.cases += 1;
        if !asked {
            row.skipped += 1;
            *row.skip_reasons.entry(reason).or_default() += 1;
            return;
        }
        row.required += usize::from(required_by_any || failed);
        row.passed += usize::from(!wrong && !failed);
        if failed {
            row.failed += 1;
            row.failed_ids.push(case.id.clone());
        }
    }

    /// Whether all that had to be right is.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.failures.is_empty()
    }
}

/// The table of groups and tiers.
impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut groups: Vec<Row> = Vec::new();
        for row in &self.rows {
            let same = |g: &&mut Row| g.group == row.group && g.tier == row.tier;
            let Some(group) = groups.iter_mut().find(same) else {
                groups.push(row.clone());
                continue;
            };
            group.cases += row.cases;
            group.required += row.required;
            group.passed += row.passed;
            group.failed += row.failed;
            group.skipped += row.skipped;
            for (reason, n) in &row.skip_reasons {
                *group.skip_reasons.entry(reason).or_default() += n;
            }
        }
        writeln!(
            f,
            "{:12} {:7} {:>6} {:>9} {:>7} {:9} {:>6} {:>8}",
            "group", "tier", "cases", "required", "passed", "", "failed", "skipped"
        )?;
        for g in groups.iter().filter(|g| g.skipped < g.cases) {
            #[allow(clippy::cast_precision_loss, reason = "a percentage")]
            let rate = 100.0 * g.passed as f64 / (g.cases - g.skipped) as f64;
            write!(
                f,
                "{:12} {:7} {:6} {:9} {:7} ({rate:5.1} %) {:6} {:8}",
                g.group, g.tier, g.cases, g.required, g.passed, g.failed, g.skipped
            )?;
            for (reason, n) in &g.skip_reasons {
                write!(f, "  {n}: {reason}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
