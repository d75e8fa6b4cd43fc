//! The engines of a race by name: which tree each asks, and how.

use std::time::Instant;

use firsthit_accel::{BuildOptions, BuildQuality, Level};
use firsthit_geometry::Precision;
use firsthit_measure::mesh::Mesh;
use rayon::ThreadPool;

use crate::memory;
use crate::peer::{CwBvh, Embree, Firsthit, FlatBvh, ObvhsBvh2, Parry, Peer};

/// What is built over a mesh. Engines that only ask differently share one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tree {
    /// firsthit, at a tier.
    Firsthit(Precision, BuildQuality),
    /// Embree.
    Embree {
        /// With the scene flag of that name.
        robust: bool,
        /// High build quality instead of medium.
        high: bool,
    },
    /// obvhs's binary tree.
    ObvhsBvh2,
    /// obvhs's compressed wide tree.
    ObvhsCwbvh,
    /// The crate parry3d.
    Parry,
    /// The crate bvh.
    Bvh,
    /// tinybvh, through the crate tinybvh-rs.
    Tiny,
}

/// A name in the table.
#[derive(Clone, Copy, Debug)]
pub struct Engine {
    /// As on the command line.
    pub name: &'static str,
    /// What it asks.
    pub tree: Tree,
    /// Asks many rays at once instead of one by one.
    pub batch: bool,
    /// Asks only every so many-th ray: what is slow.
    pub stride: usize,
}

const fn engine(name: &'static str, tree: Tree) -> Engine {
    Engine { name, tree, batch: false, stride: 1 }
}

const fn batch(name: &'static str, tree: Tree) -> Engine {
    Engine { batch: true, ..engine(name, tree) }
}

const fn slow(name: &'static str, tree: Tree, stride: usize) -> Engine {
    Engine { stride, ..engine(name, tree) }
}

const ROBUST: Tree = Tree::Firsthit(Precision::Robust, BuildQuality::Balanced);
const EMBREE: Tree = Tree::Embree { robust: false, high: false };
const EMBREE_HIGH: Tree = Tree::Embree { robust: false, high: true };

/// All engines.
pub const ENGINES: [Engine; 17] = [
    engine("firsthit-fast", Tree::Firsthit(Precision::Fast, BuildQuality::Balanced)),
    engine("firsthit-robust", ROBUST),
    engine("firsthit-double", Tree::Firsthit(Precision::Double, BuildQuality::Balanced)),
    engine("firsthit-exact", Tree::Firsthit(Precision::Exact, BuildQuality::Balanced)),
    batch("firsthit-robust-batch", ROBUST),
    engine("firsthit-fast-high", Tree::Firsthit(Precision::Fast, BuildQuality::High)),
    engine("firsthit-robust-high", Tree::Firsthit(Precision::Robust, BuildQuality::High)),
    engine("embree-fast", EMBREE),
    engine("embree-robust", Tree::Embree { robust: true, high: false }),
    engine("embree-high-fast", EMBREE_HIGH),
    batch("embree-pack16", EMBREE),
    batch("embree-high-pack16", EMBREE_HIGH),
    engine("obvhs-bvh2", Tree::ObvhsBvh2),
    engine("obvhs-cwbvh", Tree::ObvhsCwbvh),
    slow("parry3d", Tree::Parry, 4),
    slow("bvh", Tree::Bvh, 8),
    engine("tinybvh", Tree::Tiny),
];

/// A tree with what it took.
pub struct Built {
    /// To be asked.
    pub peer: Box<dyn Peer>,
    /// Seconds from the mesh in the engine's own form to ready for queries.
    pub seconds: f64,
    /// Bytes that it holds: by Embree's monitor, without the mesh which it shares; for others what was allocated and not
    /// freed, the mesh included where they keep a copy.
    pub bytes: u64,
}

impl Tree {
    /// Builds it on the threads of a pool. `simd`: the level for firsthit, if it is forced.
    ///
    /// # Errors
    /// When the engine is not here, or refuses the mesh.
    pub fn build(self, mesh: &Mesh, pool: &ThreadPool, simd: Option<Level>) -> Result<Built, String> {
        fn rust<T: Peer + 'static>(before: isize, start: Instant, peer: T) -> Built {
            let seconds = start.elapsed().as_secs_f64();
            let bytes = (memory::live() - before).max(0) as u64;
            Built { peer: Box::new(peer), seconds, bytes }
        }
        let before = memory::live();
        let start = Instant::now();
        Ok(match self {
            Self::Firsthit(precision, quality) => {
                let mut options = BuildOptions { precision, quality, ..BuildOptions::default() };
                options.simd = simd.unwrap_or(options.simd);
                // The builder takes the mesh over: a copy is made before the clock starts.
                let builder = Firsthit::prepare(mesh, options);
                let start = Instant::now();
                let built = pool.install(|| Firsthit::build(builder))?;
                rust(before, start, built)
            }
            Self::Embree { robust, high } => {
                let (embree, seconds) = Embree::new(mesh, robust, high, pool.current_num_threads())?;
                let bytes = embree.own_bytes().unwrap_or(0);
                Built { peer: Box::new(embree), seconds, bytes }
            }
            Self::ObvhsBvh2 => rust(before, start, pool.install(|| ObvhsBvh2::new(mesh))),
            Self::ObvhsCwbvh => rust(before, start, pool.install(|| CwBvh::new(mesh))),
            Self::Parry => rust(before, start, pool.install(|| Parry::new(mesh)).ok_or("parry3d refuses the mesh")?),
            Self::Bvh => rust(before, start, pool.install(|| FlatBvh::new(mesh))),
            Self::Tiny => return tiny(mesh),
        })
    }
}

#[cfg(feature = "tinybvh")]
fn tiny(mesh: &Mesh) -> Result<Built, String> {
    let (peer, seconds, bytes) = crate::peer::Tiny::new(mesh)?;
    Ok(Built { peer: Box::new(peer), seconds, bytes })
}

#[cfg(not(feature = "tinybvh"))]
fn tiny(_: &Mesh) -> Result<Built, String> {
    Err("not compiled in: --features tinybvh, which needs a C++ compiler".into())
}

/// The engines of a list of names; all for none.
///
/// # Errors
/// When there is no engine of a name.
pub fn named(names: &[String]) -> Result<Vec<Engine>, String> {
    let unknown = names.iter().find(|n| !ENGINES.iter().any(|e| e.name == **n));
    if let Some(name) = unknown {
        let known = ENGINES.map(|e| e.name).join(", ");
        return Err(format!("unknown engine '{name}' ({known})"));
    }
    Ok(ENGINES.into_iter().filter(|e| names.is_empty() || names.iter().any(|n| n == e.name)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_once() {
        assert_eq!(named(&[]).unwrap().len(), ENGINES.len());
        assert_eq!(named(&["bvh".into(), "embree-fast".into()]).unwrap().len(), 2);
        assert!(named(&["embree".into()]).unwrap_err().contains("embree-pack16"));
        for (i, a) in ENGINES.iter().enumerate() {
            assert!(ENGINES[..i].iter().all(|b| a.name != b.name));
        }
    }
}
