//! A made-up measurement, for these tests only. None of its numbers was measured: they are such as could be, and
//! such as are hard to show: three models, many guards at nearly the same time, zeros, and numbers that are none.

use firsthit_measure::result::{Accuracy, Machine, Model, PictureRow, ShapeRow, TierRow};

/// Guard, its factor on time, and the share of fast's errors that it leaves.
const GUARDS: [(&str, f64, f64); 9] = [
    ("none", 1.002, 1.0),
    ("only padding", 1.021, 0.8),
    ("only watertight", 1.043, 0.13),
    ("only f64 fallback", 1.006, 0.97),
    ("only bounded offset", 1.003, 1.0),
    ("all but padding", 1.055, 0.12),
    ("all but watertight", 1.026, 0.78),
    ("all but f64 fallback", 1.068, 1e-9),
    ("all but bounded offset", 1.071, 0.0),
];

/// Where this many rays were compared.
const RAYS: u64 = 200_000;

/// Such a measurement; all names and words say that they are made up.
pub(crate) fn accuracy() -> Accuracy {
    let models = [
        (
            "made-up-dragon.obj",
            871_414,
            true,
            1.0,
            "Use robust: it leaked none of 300,000 rays and took 1.07 times the time of fast, which leaked 412. Exact answers cost 1.62 times.",
        ),
        (
            "made-up sponza & <b>friends</b>.gltf",
            262_267,
            false,
            1.9,
            "Use robust: no wrong hit beyond the rounding of its input, at 1.05 times the time of fast.",
        ),
        (
            "a-name-that-is-much-longer-than-anyone-would-like-it-to-be-but-there-it-is.glb",
            1,
            true,
            0.02,
            "Any tier will do: the model has a single triangle.",
        ),
    ];
    let mut accuracy = Accuracy {
        version: "0.1.0".into(),
        machine: Machine { cpu: "Made-up CPU @ 3.0 GHz".into(), cores: 2, os: "linux x86_64".into(), noise: 0.031 },
        seed: 7,
        effort: "default".into(),
        seconds: 48.2,
        notes: vec![
            "All numbers of this page are made up.".into(),
            "The machine was busy: repeated timings of the same work differ by 3.1 %.".into(),
        ],
        ..Accuracy::default()
    };
    for (name, triangles, closed, scale, verdict) in models {
        let verdict = verdict.into();
        accuracy.models.push(Model { name: name.into(), triangles, closed, verdict });
        for (rays, ns) in [("aimed", 310.0), ("primary", 140.0), ("shadow", 118.0), ("incoherent", 655.0)] {
            for (tier, factor, errors) in
                [("fast", 1.0, 1.0), ("robust", 1.07, 0.0), ("double", 1.31, 0.0), ("exact", 1.62, 0.0)]
            {
                accuracy.tiers.push(row((name, tier, "", rays), (ns * scale, factor, errors), closed));
            }
            if scale < 1.5 {
                accuracy
                    .tiers
                    .extend(GUARDS.map(|(guard, f, e)| row((name, "robust", guard, rays), (ns * scale, f, e), closed)));
            }
        }
        for (tier, seconds, rmse, flip, different_pixels) in [
            ("fast", 1.91, 2.1e-4, 3.4e-5, 61),
            ("robust", 1.98, 8.0e-7, 1.1e-8, 2),
            ("double", 2.2, 0.0, 0.0, 0),
            ("exact", 2.61, 0.0, 0.0, 0),
        ] {
            let ratio_to_fast = seconds / 1.91;
            accuracy.pictures.push(PictureRow {
                model: name.into(),
                tier: tier.into(),
                seconds,
                ratio_to_fast,
                rmse,
                flip,
                different_pixels,
                pixels: 640 * 360,
            });
        }
    }
    for (i, shape) in ["sphere", "plane", "disk", "box", "quadric", "polygon", "triangle"].into_iter().enumerate() {
        for (rays, hard) in [("easy", 0.0), ("hard", 1.0)] {
            for (form, ns, ulp) in
                [("textbook f32", 4.1, 3e5), ("stable f32", 5.6, 40.0), ("stable f64", 7.9, 0.5), ("exact", 61.0, 0.0)]
            {
                let wrong = if form == "textbook f32" { (812.0 * hard) as u64 } else { 0 };
                let p99 = if ulp > 1.0 { 1.0 + hard * ulp } else { ulp };
                accuracy.shapes.push(ShapeRow {
                    shape: shape.into(),
                    form: form.into(),
                    rays: rays.into(),
                    count: 100_000,
                    ns_per_ray: ns * (1.0 + 0.2 * i as f64),
                    false_hits: wrong / 2,
                    false_misses: wrong,
                    t_ulp_p50: 0.0,
                    t_ulp_p99: p99,
                    // The textbook's t is sometimes no number at all.
                    t_ulp_max: if form == "textbook f32" { f64::INFINITY } else { 2.5 * p99 },
                });
            }
        }
    }
    accuracy
}

fn row(
    (model, tier, guard, rays): (&str, &str, &str, &str),
    (ns, factor, errors): (f64, f64, f64),
    closed: bool,
) -> TierRow {
    let aimed = rays == "aimed";
    let exact = tier == "exact";
    let compared = if rays == "shadow" { 0 } else { RAYS };
    let wide = if guard.is_empty() { 0.012 } else { 0.02 };
    let wrong = (errors * if aimed { 960.0 } else { 3.0 }) as u64;
    let ulps = if exact {
        0.0
    } else if tier == "double" {
        0.5
    } else {
        1.6 + 0.5 * errors
    };
    TierRow {
        model: model.into(),
        tier: tier.into(),
        guard: guard.into(),
        rays: rays.into(),
        count: RAYS,
        ns_per_ray: ns * factor,
        ns_low: ns * factor * (1.0 - wide),
        ns_high: ns * factor * (1.0 + 1.6 * wide),
        ratio_to_fast: factor,
        leaks: (aimed && closed).then_some((412.0 * errors) as u64),
        aimed_rays: if aimed { 300_000 } else { 0 },
        compared,
        false_hits: wrong / 3,
        false_misses: wrong,
        false_hits_by_level: [0, wrong / 3, 0],
        false_misses_by_level: [wrong / 2, wrong - wrong / 2, 0],
        wrong_ids: 2 * wrong,
        slipped: wrong / 2,
        t_ulp_p50: 0.0,
        // Without a single hit to compare there is no percentile.
        t_ulp_p99: if guard == "none" && rays == "primary" { f64::NAN } else { ulps },
        t_ulp_max: if tier == "fast" { 9.1e5 } else { 40.0 * ulps },
        t_ulp_kappa_max: 2.0 * ulps,
        surface_ulp_p99: 0.8 * ulps,
        surface_ulp_max: 3.0 * ulps,
        self_hits: (17_000.0 * if guard.contains("only bounded offset") { 0.0 } else { errors }) as u64,
        bounces: if aimed { 0 } else { 1_000_000 },
        normal_p99: if exact { 0.0 } else { 1e-7 },
        normal_max: if exact { 0.0 } else { 3e-6 + 1e-3 * errors },
        fallback_rate: exact.then_some(1.7e-4),
    }
}
