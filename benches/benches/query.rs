//! Queries by tier on a mesh that fits into a cache: the closest hit, any hit, all hits, their number, and batches.
//!
//! `cargo bench -p firsthit-benches --bench query`

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use firsthit_accel::{BuildQuality, Crossings};
use firsthit_benches::small::{around, ball, scene};
use firsthit_geometry::Precision;

const RAYS: usize = 4096;

fn queries(c: &mut Criterion) {
    let mesh = ball();
    let rays = around(RAYS);
    let mut group = c.benchmark_group("query");
    group.sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    group.throughput(Throughput::Elements(RAYS as u64));
    for precision in Precision::ALL {
        let scene = scene(&mesh, precision, BuildQuality::Balanced);
        group.bench_function(format!("closest/{precision}"), |b| {
            b.iter(|| black_box(&rays).iter().filter(|r| scene.closest_hit(r).is_some()).count());
        });
        group.bench_function(format!("any/{precision}"), |b| {
            b.iter(|| black_box(&rays).iter().filter(|r| scene.any_hit(r)).count());
        });
        let mut all = Vec::new();
        group.bench_function(format!("all/{precision}"), |b| {
            b.iter(|| {
                for ray in black_box(&rays) {
                    all.clear();
                    scene.all_hits_into(ray, Crossings::Triangles, black_box(&mut all));
                }
            });
        });
        group.bench_function(format!("count/{precision}"), |b| {
            b.iter(|| black_box(&rays).iter().map(|r| scene.count_hits(r, Crossings::Surfaces)).sum::<u32>());
        });
        let mut hits = vec![None; RAYS];
        group.bench_function(format!("closest batch/{precision}"), |b| {
            b.iter(|| scene.closest_hits(black_box(&rays), black_box(&mut hits)));
        });
        let mut any = vec![false; RAYS];
        group.bench_function(format!("any batch/{precision}"), |b| {
            b.iter(|| scene.any_hits(black_box(&rays), black_box(&mut any)));
        });
    }
    group.finish();
}

criterion_group!(benches, queries);
criterion_main!(benches);
