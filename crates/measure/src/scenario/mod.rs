//! Scenarios on whole meshes, S1 to S15: what must hold, whatever the input. Each runs in any size, says how many rays
//! or builds it took, and how to repeat it.

mod bounce;
mod input;
mod instance;
mod leak;
mod overlap;
mod place;
mod refit;
mod repeat;
mod tree;

use std::cell::Cell;
use std::fmt;
use std::time::Instant;

use firsthit_accel::{BuildOptions, Geometry, Scene, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_render::Monitor;
use glam::DAffine3;
use serde::Serialize;

use crate::mesh::Mesh;
use crate::subject::Subject;

/// A scenario.
#[derive(Clone, Copy)]
pub struct Scenario {
    /// `S1` to `S15`.
    pub id: &'static str,
    /// What must hold.
    pub title: &'static str,
    /// Rays (or what else it counts) in a small run; other sizes multiply it.
    pub base: u64,
    run: fn(&mut Check<'_>),
}

impl fmt::Debug for Scenario {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.id)
    }
}

/// All of them.
pub const ALL: [Scenario; 15] = [
    Scenario { id: "S1", title: "rays from inside a closed mesh hit it", base: 200_000, run: leak::from_inside },
    Scenario { id: "S2", title: "a line enters a closed mesh as often as it leaves", base: 50_000, run: leak::parity },
    Scenario { id: "S3", title: "scale and place change no answer", base: 4_000, run: place::run },
    Scenario { id: "S4", title: "bounced rays do not meet what they left", base: 20_000, run: bounce::run },
    Scenario { id: "S5", title: "needles leave no gaps", base: 20_000, run: tree::needles },
    Scenario { id: "S6", title: "coincident and concentric triangles build fast", base: 20_000, run: tree::coincident },
    Scenario { id: "S7", title: "deep trees do not overflow", base: 20_000, run: tree::deep },
    Scenario { id: "S8", title: "few, flat and degenerate triangles", base: 1_000, run: tree::few },
    Scenario { id: "S9", title: "bad numbers and indices are refused by name", base: 200, run: input::bad_meshes },
    Scenario { id: "S10", title: "indices out of range are refused before use", base: 3, run: input::huge_indices },
    Scenario { id: "S11", title: "instances answer as the flattened mesh", base: 2_000, run: instance::run },
    Scenario { id: "S12", title: "what moves answers as if built anew", base: 20_000, run: refit::run },
    Scenario { id: "S13", title: "threads and builds change no bit", base: 20_000, run: repeat::run },
    Scenario { id: "S14", title: "invalid rays hit nothing and disturb nobody", base: 20_000, run: input::bad_rays },
    Scenario { id: "S15", title: "of overlapping faces every hit is reported once", base: 2_000, run: overlap::run },
];

/// Scenarios that there is nothing to run for, and why.
pub const MISSING: [(&str, &str); 0] = [];

/// How large a run is, and who watches it.
pub struct Settings<'a> {
    /// Times the scenario's base.
    pub factor: u64,
    /// Instead of base and factor.
    pub count: Option<u64>,
    /// Continues a run: so many rays of scenario S1 are taken as done.
    pub from: u64,
    /// Of all random numbers.
    pub seed: u64,
    /// Tiers to run; the fast one has no promise to keep and is left out.
    pub tiers: Vec<Precision>,
    /// Closed models to run scenario S1 and S2 with, instead of meshes made by rule.
    pub subjects: Vec<Subject>,
    /// Told how far it is, and asked whether to stop.
    pub monitor: &'a dyn Monitor,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self {
            factor: 1,
            count: None,
            from: 0,
            seed: 1,
            tiers: Precision::ALL.to_vec(),
            subjects: Vec::new(),
            monitor: &(),
        }
    }
}

/// What a scenario came to.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Outcome {
    /// `S1` to `S15`.
    pub id: &'static str,
    /// What must hold.
    pub title: &'static str,
    /// Rays, or what else is counted, of this run and those it continues.
    pub count: u64,
    /// What did not hold.
    pub failures: u64,
    /// The first few of them.
    pub examples: Vec<String>,
    /// How the rays were made: with the seed enough to repeat the run.
    pub recipe: String,
    /// The seed.
    pub seed: u64,
    /// Numbers worth knowing.
    pub measured: Vec<String>,
    /// Whether it was stopped before its end.
    pub interrupted: bool,
    /// Wall-clock time.
    pub seconds: f64,
}

impl Outcome {
    /// Whether everything held.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.failures == 0
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match (self.passed(), self.interrupted) {
            (false, _) => "FAILED",
            (true, true) => "stopped",
            (true, false) => "passed",
        };
        write!(f, "{:4} {verdict:7} {}: {} of {}", self.id, self.title, self.failures, self.count)?;
        writeln!(f, " failed; seed {}, {:.1} s", self.seed, self.seconds)?;
        writeln!(f, "       {}", self.recipe)?;
        for line in self.measured.iter().chain(&self.examples) {
            writeln!(f, "       {line}")?;
        }
        Ok(())
    }
}

/// Examples that are kept.
const EXAMPLES: usize = 5;

/// A running scenario: what it is to do and what it found.
pub(crate) struct Check<'a> {
    settings: &'a Settings<'a>,
    base: u64,
    /// Thousandths of the whole list that are done before this scenario, and of how many.
    position: (u64, u64),
    reported: Cell<u64>,
    outcome: Outcome,
}

impl Check<'_> {
    /// How many rays, or what else is counted, are wanted.
    fn wanted(&self) -> u64 {
        self.settings.count.unwrap_or(self.base * self.settings.factor)
    }

    /// The tiers that promise something.
    fn tiers(&self) -> Vec<Precision> {
        self.settings.tiers.iter().copied().filter(|p| *p != Precision::Fast).collect()
    }

    fn recipe(&mut self, text: impl Into<String>) {
        self.outcome.recipe = text.into();
    }

    fn measured(&mut self, text: impl Into<String>) {
        self.outcome.measured.push(text.into());
    }

    /// Counts something that must hold.
    fn expect(&mut self, holds: bool, what: impl FnOnce() -> String) {
        self.outcome.count += 1;
        if !holds {
            self.fail(1, what);
        }
    }

    fn fail(&mut self, count: u64, what: impl FnOnce() -> String) {
        self.outcome.failures += count;
        if self.outcome.examples.len() < EXAMPLES {
            self.outcome.examples.push(what());
        }
    }

    /// Tells how far the scenario is, in [0, 1]; true if it shall stop.
    fn stop(&mut self, part: f64) -> bool {
        let (before, total) = self.position;
        let now = before + (part * 1000.0) as u64;
        if now > self.reported.get() {
            self.reported.set(now);
            let rays = self.outcome.count.saturating_sub(self.settings.from);
            self.settings.monitor.progress(now, total, rays);
        }
        let stop = self.settings.monitor.cancelled();
        self.outcome.interrupted |= stop;
        stop
    }
}

/// Runs scenarios one after the other; the rest is left out once `monitor` cancels.
#[must_use]
pub fn run(scenarios: &[Scenario], settings: &Settings<'_>) -> Vec<Outcome> {
    let mut outcomes = Vec::new();
    for (i, scenario) in scenarios.iter().enumerate() {
        if settings.monitor.cancelled() {
            break;
        }
        let started = Instant::now();
        let mut check = Check {
            settings,
            base: scenario.base,
            position: (1000 * i as u64, 1000 * scenarios.len() as u64),
            reported: Cell::new(0),
            outcome: Outcome { id: scenario.id, title: scenario.title, seed: settings.seed, ..Outcome::default() },
        };
        (scenario.run)(&mut check);
        check.stop(1.0);
        check.outcome.seconds = started.elapsed().as_secs_f64();
        outcomes.push(check.outcome);
    }
    outcomes
}

/// One mesh, placed once. `None`, and a failure, where it cannot be built.
fn scene_of(check: &mut Check<'_>, mesh: &Mesh, place: DAffine3, precision: Precision) -> Option<Scene> {
    let mut builder = SceneBuilder::new(BuildOptions { precision, ..BuildOptions::default() });
    let m = builder.add_mesh(vec![triangles(mesh)]);
    builder.add_instance(m, place);
    builder.build().map_err(|e| check.fail(1, || format!("a good mesh was refused: {e}"))).ok()
}

fn triangles(mesh: &Mesh) -> Geometry {
    Geometry::Triangles { positions: mesh.positions.clone(), triangles: mesh.triangles.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn every_scenario_passes_in_small_size() {
        for outcome in run(&ALL, &Settings::default()) {
            assert!(outcome.passed() && outcome.count > 0 && !outcome.interrupted, "{outcome}");
            assert!(!outcome.recipe.is_empty(), "{outcome}");
        }
    }

    #[test]
    fn a_run_can_be_stopped() {
        let stop = AtomicBool::new(true);
        assert!(run(&ALL, &Settings { monitor: &stop, ..Settings::default() }).is_empty());
    }

    #[test]
    fn scenarios_are_numbered_and_none_is_forgotten() {
        let known: Vec<&str> = ALL.iter().map(|s| s.id).chain(MISSING.map(|m| m.0)).collect();
        assert!((1..=15).all(|n| known.contains(&format!("S{n}").as_str())), "{known:?}");
    }
}
