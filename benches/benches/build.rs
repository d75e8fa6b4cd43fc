//! Builds by preset, on one thread and on all.
//!
//! `cargo bench -p firsthit-benches --bench build`

use std::time::Duration;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use firsthit_accel::{BuildOptions, BuildQuality};
use firsthit_benches::peer::Firsthit;
use firsthit_benches::small::ball;

fn builds(c: &mut Criterion) {
    let mesh = ball();
    let mut group = c.benchmark_group("build");
    group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(2));
    group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
    let presets = [("fast", BuildQuality::Fast), ("balanced", BuildQuality::Balanced), ("high", BuildQuality::High)];
    for (name, quality) in presets {
        for threads in [1, 0] {
            // 0 is as many as there are processors.
            let Ok(pool) = rayon::ThreadPoolBuilder::new().num_threads(threads).build() else { continue };
            let options = BuildOptions { quality, ..BuildOptions::default() };
            group.bench_function(format!("{name}/{} threads", pool.current_num_threads()), |b| {
                let prepare = || Firsthit::prepare(&mesh, options);
                b.iter_batched(prepare, |builder| pool.install(|| Firsthit::build(builder)), BatchSize::LargeInput);
            });
        }
    }
    group.finish();
}

criterion_group!(benches, builds);
criterion_main!(benches);
