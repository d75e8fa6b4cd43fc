//! Kernels by tier, through public queries on scenes that hold nothing else: one node of eight boxes that are all missed,
//! one leaf of eight triangles that are all hit, and the tests of one box and one triangle of the geometry crate.
//!
//! `cargo bench -p firsthit-benches --bench kernel`

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use firsthit_accel::BuildQuality;
use firsthit_benches::small::{around, block, node, past_boxes, scene, through_block};
use firsthit_geometry::{Aabb, Precision, slab, triangle};
use glam::DVec3;

const RAYS: usize = 4096;

fn kernels(c: &mut Criterion) {
    let mut group = c.benchmark_group("kernel");
    group.sample_size(20).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    group.throughput(Throughput::Elements(RAYS as u64));
    for precision in Precision::ALL {
        let cases = [("eight boxes", node(), past_boxes(RAYS)), ("eight triangles", block(), through_block(RAYS))];
        for (name, mesh, rays) in cases {
            let scene = scene(&mesh, precision, BuildQuality::Balanced);
            let mut hits = vec![None; RAYS];
            group.bench_function(format!("{name}/{precision}"), |b| {
                b.iter(|| scene.closest_hits(black_box(&rays), black_box(&mut hits)));
            });
        }
        let corners = [DVec3::new(-0.5, -0.5, 0.0), DVec3::new(0.5, -0.4, 0.1), DVec3::new(0.1, 0.6, -0.1)];
        let rays = around(RAYS);
        group.bench_function(format!("one triangle/{precision}"), |b| {
            let hit = |r| triangle::intersect(precision, black_box(corners), r).is_some();
            b.iter(|| black_box(&rays).iter().filter(|r| hit(r)).count());
        });
    }
    let aabb = Aabb::new(DVec3::splat(-0.5), DVec3::splat(0.5));
    let rays = around(RAYS);
    group.bench_function("one box/plain", |b| {
        b.iter(|| black_box(&rays).iter().filter(|r| slab::plain(black_box(&aabb), r).is_some()).count());
    });
    group.bench_function("one box/padded", |b| {
        b.iter(|| black_box(&rays).iter().filter(|r| slab::padded(black_box(&aabb), r).is_some()).count());
    });
    group.finish();
}

criterion_group!(benches, kernels);
criterion_main!(benches);
