//! One picture of a model at each tier: its time, and its difference from the most exact one.

use std::sync::Arc;

use firsthit_accel::{BuildOptions, SceneBuilder};
use firsthit_geometry::Precision;
use firsthit_import::SceneDesc;
use firsthit_render::{IntegratorChoice, Monitor, RenderOptions, Stage, StageOptions, View, film::Picture, render};

use super::{PIXELS_PER_DEGREE, PictureError, different_pixels, flip, rmse};
use crate::result::PictureRow;

/// Which pictures to make of a model.
#[derive(Clone, Debug)]
pub struct PictureOptions {
    /// Tiers to report, each once. The most exact one is rendered in any case.
    pub tiers: Vec<Precision>,
    /// How each picture is rendered.
    pub render: RenderOptions,
    /// Environment, camera, effects. Its `aspect` is set to that of the picture.
    pub stage: StageOptions,
    /// How the picture is shown, for FLIP.
    pub view: View,
    /// For FLIP.
    pub pixels_per_degree: f64,
    /// Times are medians of so many renders; at least 1.
    pub repetitions: u32,
    /// How trees are built; `precision` is that of each tier.
    pub build: BuildOptions,
}

impl Default for PictureOptions {
    fn default() -> Self {
        Self {
            tiers: Precision::ALL.to_vec(),
            // Whitted's method: tiers are to differ by what rays meet, not by noise.
            render: RenderOptions {
                width: 640,
                height: 360,
                spp: 4,
                max_depth: 8,
                integrator: IntegratorChoice::Whitted,
                ..RenderOptions::default()
            },
            stage: StageOptions::default(),
            view: View::default(),
            pixels_per_degree: PIXELS_PER_DEGREE,
            repetitions: 3,
            build: BuildOptions::default(),
        }
    }
}

/// What was rendered at a tier.
struct Rendering {
    tier: Precision,
    stage: Stage,
    seconds: Vec<f64>,
    picture: Option<Picture>,
}

/// Renders a scene at each tier, in turns, on the caller's rayon pool, and compares with the most exact tier's picture.
///
/// The rows are in the order of the tiers asked for, `name` is their model. `ratio_to_fast` is the median of the ratios
/// within a turn; NaN where the fast tier was not asked for. `monitor` sees each render from 0 to its end.
///
/// ```
/// use std::sync::Arc;
/// use firsthit_import::SceneDesc;
/// use firsthit_measure::picture::{PictureOptions, measure};
/// use firsthit_render::RenderOptions;
///
/// let render = RenderOptions { width: 8, height: 8, spp: 1, ..RenderOptions::default() };
/// let options = PictureOptions { render, ..PictureOptions::default() };
/// let rows = measure("nothing", &Arc::new(SceneDesc::default()), &options, &())?;
/// assert_eq!(rows[0].tier, "fast");
/// assert_eq!(rows[0].different_pixels, 0);
/// # Ok::<(), firsthit_measure::picture::PictureError>(())
/// ```
///
/// # Errors
/// When the scene cannot be built or rendered, or `monitor` cancels.
pub fn measure<M: Monitor + ?Sized>(
    name: &str,
    scene: &Arc<SceneDesc>,
    options: &PictureOptions,
    monitor: &M,
) -> Result<Vec<PictureRow>, PictureError> {
    let truth = Precision::ALL[Precision::ALL.len() - 1];
    let mut renderings = Vec::new();
    for tier in options.tiers.iter().copied().chain((!options.tiers.contains(&truth)).then_some(truth)) {
        if monitor.cancelled() {
            return Err(PictureError::Cancelled);
        }
        let stage = stage(scene, tier, options)?;
        renderings.push(Rendering { tier, stage, seconds: Vec::new(), picture: None });
    }
    for _ in 0..options.repetitions.max(1) {
        for rendering in &mut renderings {
            let rendered = render(&rendering.stage, &options.render, monitor)?;
            if rendered.interrupted {
                return Err(PictureError::Cancelled);
            }
            rendering.seconds.push(rendered.stats.seconds);
            // The same bits in every turn: see `render`.
            rendering.picture.get_or_insert_with(|| rendered.film.color());
        }
    }
    let find = |tier| renderings.iter().find(|r| r.tier == tier);
    let Some(reference) = find(truth).and_then(|r| r.picture.as_ref()) else { return Ok(Vec::new()) };
    let fast = find(Precision::Fast).map_or(&[][..], |r| &r.seconds);
    let row = |r: &Rendering| {
        let picture = r.picture.as_ref().unwrap_or(reference);
        let ratios = r.seconds.iter().zip(fast).map(|(s, f)| s / f);
        Ok(PictureRow {
            model: name.into(),
            tier: r.tier.name().into(),
            seconds: median(r.seconds.iter().copied()),
            ratio_to_fast: median(ratios),
            rmse: rmse(reference, picture)?,
            flip: flip(reference, picture, &options.view, options.pixels_per_degree)?,
            different_pixels: different_pixels(reference, picture)?,
            pixels: reference.pixels.len() as u64,
        })
    };
    renderings.iter().filter(|r| options.tiers.contains(&r.tier)).map(row).collect()
}

fn stage(scene: &Arc<SceneDesc>, precision: Precision, options: &PictureOptions) -> Result<Stage, PictureError> {
    let build = BuildOptions { precision, ..options.build };
    let accel = SceneBuilder::from_desc(scene, build).build()?;
    let aspect = f64::from(options.render.width) / f64::from(options.render.height.max(1));
    Ok(Stage::new(scene.clone(), accel, &StageOptions { aspect, ..options.stage.clone() })?)
}

/// The middle value; between the two middle ones of an even number. NaN of none.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use firsthit_import::scene::{GeometryDesc, InstanceDesc, MeshDesc, SurfaceDesc, TriangleMesh};
    use glam::DAffine3;

    use super::*;
    use crate::mesh;

    fn ball() -> Arc<SceneDesc> {
        let mesh::Mesh { positions, triangles } = mesh::icosphere(3);
        let surface = SurfaceDesc::Triangles(TriangleMesh { positions, triangles, ..TriangleMesh::default() });
        let geometries = vec![GeometryDesc { name: String::new(), surface, material: None }];
        Arc::new(SceneDesc {
            meshes: vec![MeshDesc { name: String::new(), geometries }],
            instances: vec![InstanceDesc {
                name: String::new(),
                mesh: 0,
                transform: DAffine3::IDENTITY,
                moves_to: None,
            }],
            ..SceneDesc::default()
        })
    }

    fn options() -> PictureOptions {
        let render = RenderOptions { width: 48, height: 32, spp: 2, ..RenderOptions::default() };
        PictureOptions { render, repetitions: 2, ..PictureOptions::default() }
    }

    #[test]
    fn every_tier_is_compared_with_the_most_exact_one() {
        let rows = measure("ball", &ball(), &options(), &()).unwrap();
        assert_eq!(rows.iter().map(|r| &r.tier[..]).collect::<Vec<_>>(), Precision::ALL.map(Precision::name));
        assert_eq!(rows[0].ratio_to_fast, 1.0);
        let last = &rows[rows.len() - 1];
        assert_eq!((last.rmse, last.flip, last.different_pixels), (0.0, 0.0, 0));
        for row in &rows {
            assert!(row.model == "ball" && row.pixels == 48 * 32 && row.seconds > 0.0 && row.ratio_to_fast > 0.0);
            assert_eq!(row.rmse == 0.0, row.different_pixels == 0, "{row:?}");
            // A ball in the studio has no hard case: tiers may differ by roundings, not to the eye.
            assert!(row.flip < 1e-3, "{row:?}");
        }
    }

    #[test]
    fn the_most_exact_tier_is_rendered_even_where_it_is_not_asked_for() {
        let tiers = vec![Precision::Robust];
        let rows = measure("ball", &ball(), &PictureOptions { tiers, ..options() }, &()).unwrap();
        assert_eq!(rows.len(), 1);
        assert!(rows[0].tier == "robust" && rows[0].ratio_to_fast.is_nan() && rows[0].rmse.is_finite());
    }

    #[test]
    fn it_can_be_cancelled() {
        let cancelled = measure("ball", &ball(), &options(), &AtomicBool::new(true));
        assert!(matches!(cancelled, Err(PictureError::Cancelled)));
    }

    #[test]
    fn the_median_is_the_middle() {
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), 2.0);
        assert_eq!(median([4.0, 1.0].into_iter()), 2.5);
        assert!(median(std::iter::empty()).is_nan());
    }
}
