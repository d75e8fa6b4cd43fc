//! Runs an engine over the cases and sums up.

use std::collections::BTreeMap;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};

use firsthit_geometry::Precision;

use super::judge::required;
use super::{Case, Engine, Verdict, judge};

/// How one engine at one tier did, group by group.
#[derive(Clone, Debug)]
pub struct Summary {
    precision: Precision,
    groups: BTreeMap<String, Counts>,
    /// What had to be right and was not: case and complaint.
    pub failures: Vec<String>,
    /// What was wrong where it may be.
    pub excused: Vec<String>,
}

/// Counts of one group.
#[derive(Clone, Debug, Default)]
struct Counts {
    cases: usize,
    passed: usize,
    required: usize,
    required_passed: usize,
    skipped: BTreeMap<&'static str, usize>,
}

/// Puts all cases to an engine. A panic is a failure of its case.
#[must_use]
pub fn run(cases: &[Case], precision: Precision, engine: Engine) -> Summary {
    let mut summary = Summary { precision, groups: BTreeMap::new(), failures: Vec::new(), excused: Vec::new() };
    for case in cases {
        let verdict = catch_unwind(AssertUnwindSafe(|| judge(case, precision, &engine(case, precision))))
            .unwrap_or_else(|_| Verdict::Failed("panicked".into()));
        let counts = summary.groups.entry(case.group.clone()).or_default();
        counts.cases += 1;
        if let Verdict::Skipped(reason) = verdict {
            *counts.skipped.entry(reason).or_default() += 1;
            continue;
        }
        let (passed, required) = (verdict == Verdict::Passed, required(case, precision));
        counts.passed += usize::from(passed);
        counts.required += usize::from(required);
        counts.required_passed += usize::from(required && passed);
        match verdict {
            Verdict::Failed(why) => summary.failures.push(format!("{} at {precision}: {why}", case.id)),
            Verdict::Excused(why) => summary.excused.push(format!("{} at {precision}: {why}", case.id)),
            Verdict::Passed | Verdict::Skipped(_) => {}
        }
    }
    summary
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (group, c) in &self.groups {
            let asked = c.cases - c.skipped.values().sum::<usize>();
            if asked > 0 {
                let (tier, Counts { passed, required, required_passed, .. }) = (self.precision.name(), c);
                #[allow(clippy::cast_precision_loss, reason = "a percentage")]
                let rate = 100.0 * *passed as f64 / asked as f64;
                write!(f, "{group:12} {tier:7} {required_passed:4} of {required:4} required, ")?;
                write!(f, "{passed:4} of {asked:4} in all ({rate:5.1} %)")?;
                for (reason, n) in &c.skipped {
                    write!(f, "; {n} skipped: {reason}")?;
                }
                writeln!(f)?;
            }
        }
        Ok(())
    }
}
