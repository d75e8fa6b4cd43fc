//! A plain sentence from the numbers: which tier to use for a model, and what it costs.

use crate::result::TierRow;

/// What one tier came to over all kinds of rays.
struct Sum<'a> {
    tier: &'a str,
    /// Geometric mean over the kinds of rays.
    ratio: f64,
    leaks: u64,
    aimed: u64,
    slipped: u64,
    /// Wrong hits and misses that the rounding of f32 does not excuse.
    wrong: u64,
    /// All wrong hits and misses.
    any_wrong: u64,
    compared: u64,
    self_hits: u64,
    bounces: u64,
    t_ulp: f64,
}

impl<'a> Sum<'a> {
    fn new(tier: &'a str, rows: &[&'a TierRow]) -> Self {
        let logs: Vec<f64> = rows.iter().map(|r| r.ratio_to_fast.ln()).filter(|x| x.is_finite()).collect();
        let total = |f: fn(&TierRow) -> u64| rows.iter().map(|r| f(r)).sum();
        Self {
            tier,
            ratio: (logs.iter().sum::<f64>() / logs.len() as f64).exp(),
            leaks: total(|r| r.leaks.unwrap_or(0)),
            aimed: total(|r| r.aimed_rays),
            slipped: total(|r| r.slipped),
            wrong: total(|r| r.false_hits_by_level[0] + r.false_misses_by_level[0]),
            any_wrong: total(|r| r.false_hits + r.false_misses),
            compared: total(|r| r.compared),
            self_hits: total(|r| r.self_hits),
            bounces: total(|r| r.bounces),
            t_ulp: rows.iter().map(|r| r.t_ulp_max).fold(0.0, f64::max),
        }
    }

    fn is_clean(&self) -> bool {
        self.leaks == 0 && self.slipped == 0 && self.wrong == 0 && self.self_hits == 0
    }

    fn faults(&self) -> String {
        let mut faults = Vec::new();
        if self.leaks > 0 {
            faults.push(format!("{} of {} aimed rays leak", self.leaks, self.aimed));
        }
        if self.slipped > self.leaks {
            faults.push(format!("{} of {} rays slip through a surface", self.slipped, self.compared));
        }
        if self.wrong > 0 {
            faults.push(format!("{} hit or miss wrongly by more than rounding", self.wrong));
        }
        if self.self_hits > 0 {
            faults.push(format!("{} of {} bounced rays hit what they left", self.self_hits, self.bounces));
        }
        faults.join(", ")
    }

    /// What its ratio means.
    fn cost(&self) -> String {
        match (self.ratio - 1.0) * 100.0 {
            p if !p.is_finite() => "its cost was not measured".into(),
            p if p.round() == 0.0 => "as fast as fast".into(),
            p if p > 0.0 => format!("{p:.0} % more time than fast"),
            p => format!("{:.0} % less time than fast", -p),
        }
    }
}

/// The verdict on a model from its rows. The tier to use is the cheapest one without a leak, a ray slipped through, a
/// self-hit, or a wrong decision that rounding does not excuse.
#[must_use]
pub fn verdict(rows: &[TierRow], model: &str) -> String {
    let rows: Vec<&TierRow> = rows.iter().filter(|r| r.model == model && r.guard.is_empty()).collect();
    let mut sums: Vec<Sum<'_>> = Vec::new();
    for row in &rows {
        if !sums.iter().any(|s| s.tier == row.tier) {
            let same: Vec<&TierRow> = rows.iter().copied().filter(|r| r.tier == row.tier).collect();
            sums.push(Sum::new(&row.tier, &same));
        }
    }
    let Some(cheapest) = sums.first() else { return "Nothing was measured.".into() };
    let Some(best) = sums.iter().find(|s| s.is_clean()) else {
        let last = sums.last().unwrap_or(cheapest);
        return format!("No measured tier is without error: at {}, {}.", last.tier, last.faults());
    };
    let mut text = format!("Use {}", best.tier);
    if best.tier != "fast" {
        text += &format!(" ({})", best.cost());
    }
    text +=
        &format!(": none of {} rays slips through a surface (rate below {})", best.compared, rate(0, best.compared));
    if best.aimed > 0 {
        text += &format!(", no leak in {} aimed ones", best.aimed);
    }
    text += &format!(", t within {} ulp.", short(best.t_ulp));
    if best.any_wrong > 0 {
        text += &format!(
            " At silhouettes, rims and cracks rounding decides {} of them otherwise than exactly.",
            best.any_wrong
        );
    }
    if !cheapest.is_clean() {
        text += &format!(" With {}, {}.", cheapest.tier, cheapest.faults());
    }
    for other in sums.iter().skip_while(|s| s.tier != best.tier).skip(1) {
        let name = other.tier[..1].to_uppercase() + &other.tier[1..];
        text += &format!(" {name}: {}.", other.cost());
    }
    text
}

/// The rate of `failures` in `n`: of none, the bound `3/n` (95 %).
#[must_use]
pub fn rate(failures: u64, n: u64) -> String {
    match (failures, n) {
        (_, 0) => "-".into(),
        (0, _) => short(3.0 / n as f64),
        _ => short(failures as f64 / n as f64),
    }
}

/// Two digits.
fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        m if (0.01..100.0).contains(&m) => format!("{x:.2}"),
        m if (100.0..1e4).contains(&m) => format!("{x:.0}"),
        _ => format!("{x:.1e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(tier: &str, ratio: f64, leaks: u64) -> TierRow {
        TierRow {
            model: "m".into(),
            tier: tier.into(),
            rays: "aimed".into(),
            ratio_to_fast: ratio,
            leaks: Some(leaks),
            false_misses: leaks,
            aimed_rays: 1000,
            compared: 1000,
            t_ulp_max: 0.5,
            ..TierRow::default()
        }
    }

    #[test]
    fn the_cheapest_tier_without_error_is_named_with_its_cost() {
        let rows = [row("fast", 1.0, 7), row("robust", 1.08, 0), row("double", 1.4, 0)];
        let text = verdict(&rows, "m");
        assert_eq!(
            text,
            "Use robust (8 % more time than fast): none of 1000 rays slips through a surface (rate below 3.0e-3), no leak in \
             1000 aimed ones, t within 0.50 ulp. With fast, 7 of 1000 aimed rays leak. Double: 40 % more time than fast."
        );
        let guard = TierRow { guard: "only padding".into(), ..row("robust", 1.0, 9) };
        assert_eq!(verdict(&[rows.as_slice(), &[guard]].concat(), "m"), text, "guards are no tiers");
    }

    #[test]
    fn numbers_change_the_verdict() {
        assert!(verdict(&[row("fast", 1.0, 0), row("robust", 0.9, 0)], "m").starts_with("Use fast: none of 1000"));
        assert!(verdict(&[row("fast", 1.0, 1)], "m").starts_with("No measured tier is without error: at fast, 1 of"));
        let through = TierRow { slipped: 3, ..row("fast", 1.0, 0) };
        let text = verdict(&[through, row("robust", 1.0, 0)], "m");
        assert!(text.starts_with("Use robust (as fast as fast)") && text.contains("3 of 1000 rays slip"), "{text}");
        let silhouette = TierRow { false_misses: 5, false_misses_by_level: [0, 5, 0], ..row("fast", 1.0, 0) };
        let text = verdict(&[silhouette], "m");
        assert!(text.starts_with("Use fast") && text.contains("rounding decides 5"), "{text}");
        assert_eq!(verdict(&[], "m"), "Nothing was measured.");
    }
}
