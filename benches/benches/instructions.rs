//! Instructions that kernels, queries and a build take, counted by valgrind: numbers that hardly change from run to run, so
//! that a regression of a percent is seen on any machine.
//!
//! ```sh
//! cargo install gungraun-runner --version 0.20.0      # once; and valgrind
//! cargo bench -p firsthit-benches --features instructions --bench instructions
//! ```
//!
//! Each count is compared with the last run's. Valgrind knows no AVX-512: firsthit then takes AVX2, and the feature `tinybvh`,
//! which is compiled for the processor at hand, must be off.

#![allow(unused_qualifications, missing_docs, reason = "what the macros write")]

use std::hint::black_box;

use firsthit_accel::{BuildQuality, Crossings, Scene};
use firsthit_benches::small::{around, ball, block, node, past_boxes, scene, through_block};
use firsthit_geometry::{Precision, Ray};
use firsthit_measure::mesh::Mesh;
use gungraun::{library_benchmark, library_benchmark_group, main};

const RAYS: usize = 1000;

type Asked = (Scene, Vec<Ray<f64>>);

fn boxes(precision: Precision) -> Asked {
    (scene(&node(), precision, BuildQuality::Balanced), past_boxes(RAYS))
}

fn triangles(precision: Precision) -> Asked {
    (scene(&block(), precision, BuildQuality::Balanced), through_block(RAYS))
}

fn whole(precision: Precision) -> Asked {
    (scene(&ball(), precision, BuildQuality::Balanced), around(RAYS))
}

fn sum(asked: Asked, ask: impl Fn(&Scene, &Ray<f64>) -> usize) -> (Asked, usize) {
    let sum = black_box(&asked.1).iter().map(|r| ask(&asked.0, r)).sum();
    // Given back, so that freeing the scene is not counted.
    (asked, sum)
}

#[library_benchmark]
#[bench::boxes_fast(args = (Precision::Fast), setup = boxes)]
#[bench::boxes_robust(args = (Precision::Robust), setup = boxes)]
#[bench::triangles_fast(args = (Precision::Fast), setup = triangles)]
#[bench::triangles_robust(args = (Precision::Robust), setup = triangles)]
#[bench::triangles_double(args = (Precision::Double), setup = triangles)]
#[bench::triangles_exact(args = (Precision::Exact), setup = triangles)]
#[bench::whole_fast(args = (Precision::Fast), setup = whole)]
#[bench::whole_robust(args = (Precision::Robust), setup = whole)]
#[bench::whole_double(args = (Precision::Double), setup = whole)]
#[bench::whole_exact(args = (Precision::Exact), setup = whole)]
fn closest(asked: Asked) -> (Asked, usize) {
    sum(asked, |scene, ray| usize::from(scene.closest_hit(ray).is_some()))
}

#[library_benchmark]
#[bench::whole_fast(args = (Precision::Fast), setup = whole)]
#[bench::whole_robust(args = (Precision::Robust), setup = whole)]
fn any(asked: Asked) -> (Asked, usize) {
    sum(asked, |scene, ray| usize::from(scene.any_hit(ray)))
}

#[library_benchmark]
#[bench::whole_robust(args = (Precision::Robust), setup = whole)]
fn count(asked: Asked) -> (Asked, usize) {
    sum(asked, |scene, ray| scene.count_hits(ray, Crossings::Surfaces) as usize)
}

// Room for the answers of a batch.
fn batched(precision: Precision) -> (Asked, Vec<Option<firsthit_accel::Hit>>) {
    (whole(precision), vec![None; RAYS])
}

#[library_benchmark]
#[bench::whole_robust(args = (Precision::Robust), setup = batched)]
fn batch((asked, mut hits): (Asked, Vec<Option<firsthit_accel::Hit>>)) -> (Asked, Vec<Option<firsthit_accel::Hit>>) {
    asked.0.closest_hits(black_box(&asked.1), &mut hits);
    (asked, hits)
}

// Built on the thread that is counted.
#[library_benchmark]
#[bench::balanced(ball())]
fn build(mesh: Mesh) -> (Mesh, Option<Scene>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    let built = pool.ok().map(|pool| pool.install(|| scene(&mesh, Precision::Robust, BuildQuality::Balanced)));
    (mesh, built)
}

library_benchmark_group!(name = all, benchmarks = [closest, any, count, batch, build]);
main!(library_benchmark_groups = all);
