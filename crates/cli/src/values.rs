//! The values of options, from text. Every error says what was expected.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use firsthit_accel::{BuildQuality, Layout};
use firsthit_import::{AnimationChoice, srgb};
use firsthit_measure::scenario::{self, Scenario};
use firsthit_render::sampler::SamplerChoice;
use firsthit_render::{
    Aov, CameraChoice, Crop, EffectOverrides, EffectSet, FilterChoice, IntegratorChoice, TextureFilter, ViewTransform,
};
use glam::{DVec3, Vec3};

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Resolution {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

/// What lights the scene from around.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Hdri {
    Studio,
    White,
    Black,
    File(PathBuf),
}

/// A half space: where `normal . p <= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) normal: DVec3,
    pub(crate) offset: f64,
}

/// A colour as a display shows it: sRGB, from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Color(pub(crate) Vec3);

impl Color {
    pub(crate) fn linear(self) -> Vec3 {
        self.0.map(|c| srgb::to_linear(c.into()) as f32)
    }
}

/// Pictures beside the colour, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct AovList(pub(crate) Vec<Aov>);

pub(crate) fn resolution(s: &str) -> Result<Resolution, String> {
    let parsed = s.split_once(['x', 'X', ',']).and_then(|(w, h)| Some((whole(w)?, whole(h)?)));
    let Some((width, height)) = parsed else { return Err("expected WIDTHxHEIGHT, as in 1280x720".into()) };
    if width == 0 || height == 0 {
        return Err("width and height must be at least 1".into());
    }
    Ok(Resolution { width, height })
}

/// A number of bytes, by powers of 1000 (`MB`) or of 1024 (`MiB`, `M`).
pub(crate) fn size(s: &str) -> Result<u64, String> {
    let s = s.trim();
    let end = s.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(s.len());
    let (number, unit) = s.split_at(end);
    let factor: f64 = match unit.trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1024_f64.powi(2),
        "g" | "gib" => 1024_f64.powi(3),
        "t" | "tib" => 1024_f64.powi(4),
        _ => return Err("expected a size as 500MB or 2GiB".into()),
    };
    let bytes = number.parse::<f64>().map_err(|_| "expected a size as 500MB or 2GiB")? * factor;
    if bytes < 1.0 { Err("a size must be at least 1 byte".into()) } else { Ok(bytes as u64) }
}

pub(crate) fn crop(s: &str) -> Result<Crop, String> {
    let parts: Option<Vec<u32>> = s.split(',').map(whole).collect();
    match parts.as_deref() {
        Some(&[_, _, 0, _] | &[_, _, _, 0]) => Err("width and height must be at least 1".into()),
        Some(&[x, y, width, height]) => Ok(Crop { x, y, width, height }),
        _ => Err("expected X,Y,WIDTH,HEIGHT in whole pixels".into()),
    }
}

pub(crate) fn number(s: &str) -> Result<f64, String> {
    finite(s).ok_or_else(|| "expected a number".into())
}

pub(crate) fn positive(s: &str) -> Result<f64, String> {
    finite(s).filter(|&x| x > 0.0).ok_or_else(|| "expected a number above 0".into())
}

/// A number of seconds, minutes or hours.
pub(crate) fn time(s: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("s", 1.0), ("m", 60.0), ("min", 60.0), ("h", 3600.0), ("", 1.0)];
    let split = s.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(s.len());
    let (number, unit) = s.split_at(split);
    let seconds = units.iter().find(|(name, _)| *name == unit).and_then(|(_, size)| Some(finite(number)? * size));
    seconds
        .filter(|s| *s > 0.0)
        .and_then(|s| Duration::try_from_secs_f64(s).ok())
        .ok_or_else(|| "expected a time above 0, as in 30s, 5m or 1h".into())
}

/// A moment in seconds, also before the beginning.
pub(crate) fn moment(s: &str) -> Result<f64, String> {
    let number = |text: &str, unit: f64| finite(text).map(|x| x * unit);
    let seconds = match (s.strip_suffix("ms"), s.strip_suffix('s')) {
        (Some(text), _) => number(text, 1e-3),
        (None, Some(text)) => number(text, 1.0),
        (None, None) => number(s, 1.0),
    };
    seconds.ok_or_else(|| "expected a time, as in 1.25s, 1.25 or 40ms".into())
}

/// The first frame, and the one after the last.
pub(crate) fn frames(s: &str) -> Result<(u32, u32), String> {
    let range = s.split_once("..").and_then(|(a, b)| Some((whole(a)?, whole(b)?)));
    range.filter(|(a, b)| a < b).ok_or_else(|| "expected A..B with A below B, as in 0..48".into())
}

/// An animation by name or number, or all of them.
pub(crate) fn animation(s: &str) -> Result<AnimationChoice, String> {
    Ok(if s == "all" { AnimationChoice::All } else { AnimationChoice::Named(s.to_owned()) })
}

pub(crate) fn sampler(s: &str) -> Result<SamplerChoice, String> {
    let found = SamplerChoice::ALL.into_iter().find(|c| c.name() == s);
    found.ok_or_else(|| format!("expected one of: {}", SamplerChoice::ALL.map(SamplerChoice::name).join(", ")))
}

/// The first sample, and the one after the last.
pub(crate) fn samples(s: &str) -> Result<(u32, u32), String> {
    let range = s.split_once("..").and_then(|(a, b)| Some((whole(a)?, whole(b)?)));
    range
        .filter(|(a, b)| a < b && a.is_multiple_of(16))
        .ok_or_else(|| "expected A..B with A below B and a multiple of 16, as in 64..128".into())
}

pub(crate) fn filter(s: &str) -> Result<FilterChoice, String> {
    Ok(match s {
        "auto" => FilterChoice::Auto,
        "box" => FilterChoice::Box,
        "blackman-harris" => FilterChoice::BlackmanHarris,
        _ => return Err("expected auto, box or blackman-harris".into()),
    })
}

pub(crate) fn view_angle(s: &str) -> Result<f64, String> {
    finite(s).filter(|&x| x > 0.0 && x < 180.0).ok_or_else(|| "expected degrees between 0 and 180".into())
}

pub(crate) fn bit_depth(s: &str) -> Result<u8, String> {
    match s {
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("expected 8 or 16".into()),
    }
}

pub(crate) fn vector(s: &str) -> Result<DVec3, String> {
    let [x, y, z] = numbers(s).ok_or("expected three numbers, as in 1,-2.5,3")?;
    Ok(DVec3::new(x, y, z))
}

pub(crate) fn direction(s: &str) -> Result<DVec3, String> {
    vector(s)?.try_normalize().ok_or_else(|| "expected a direction that is not zero".into())
}

pub(crate) fn clip_box(s: &str) -> Result<(DVec3, DVec3), String> {
    let [x0, y0, z0, x1, y1, z1] = numbers(s).ok_or("expected six numbers: X0,Y0,Z0,X1,Y1,Z1")?;
    let (a, b) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
    Ok((a.min(b), a.max(b)))
}

pub(crate) fn plane(s: &str) -> Result<Plane, String> {
    let [x, y, z, offset] = numbers(s).ok_or("expected four numbers: NX,NY,NZ,D")?;
    let normal = DVec3::new(x, y, z);
    if normal == DVec3::ZERO {
        return Err("expected a normal that is not zero".into());
    }
    Ok(Plane { normal, offset })
}

pub(crate) fn color(s: &str) -> Result<Color, String> {
    let rgb = srgb::from_hex(s).or_else(|| numbers(s));
    rgb.filter(|rgb| rgb.iter().all(|c| (0.0..=1.0).contains(c)))
        .map(|rgb| Color(Vec3::from_array(rgb.map(|c| c as f32))))
        .ok_or_else(|| "expected three numbers from 0 to 1, or #rrggbb".into())
}

pub(crate) fn tone_mapping(s: &str) -> Result<ViewTransform, String> {
    let found = ViewTransform::ALL.into_iter().find(|v| v.name() == s);
    found.ok_or_else(|| format!("expected one of: {}", ViewTransform::ALL.map(ViewTransform::name).join(", ")))
}

/// Whether something is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    On,
    Off,
}

/// What is explained of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Explain {
    Nothing,
    /// What was chosen, and what each effect cost.
    Costs,
    /// And what the image would be without each effect.
    Ablations,
}

/// `costs`, `ablate`, or `nothing`.
pub(crate) fn explain(s: &str) -> Result<Explain, String> {
    match s {
        "nothing" => Ok(Explain::Nothing),
        "costs" => Ok(Explain::Costs),
        "ablate" => Ok(Explain::Ablations),
        _ => Err("expected costs or ablate".into()),
    }
}

pub(crate) fn switch(s: &str) -> Result<Switch, String> {
    match s {
        "on" => Ok(Switch::On),
        "off" => Ok(Switch::Off),
        _ => Err("expected on or off".into()),
    }
}

pub(crate) fn texture_filter(s: &str) -> Result<TextureFilter, String> {
    match s {
        "trilinear" => Ok(TextureFilter::Trilinear),
        "bilinear" => Ok(TextureFilter::Bilinear),
        _ => Err("expected trilinear or bilinear".into()),
    }
}

pub(crate) fn camera(s: &str) -> Result<CameraChoice, String> {
    Ok(if s == "auto" { CameraChoice::Auto } else { CameraChoice::Named(s.to_owned()) })
}

pub(crate) fn hdri(s: &str) -> Result<Hdri, String> {
    Ok(match s {
        "studio" => Hdri::Studio,
        "white" => Hdri::White,
        "black" => Hdri::Black,
        "" => return Err("expected a file, or studio, white or black".into()),
        file => Hdri::File(file.into()),
    })
}

pub(crate) fn integrator(s: &str) -> Result<IntegratorChoice, String> {
    Ok(match s {
        "auto" => IntegratorChoice::Auto,
        "path" => IntegratorChoice::Path,
        "light" => IntegratorChoice::Light,
        "whitted" => IntegratorChoice::Whitted,
        "direct" => IntegratorChoice::Direct,
        "ao" | "ambient-occlusion" => IntegratorChoice::AmbientOcclusion,
        other => {
            let aov = Aov::from_str(other).ok().filter(|a| a.is_sampled());
            let aov = aov.ok_or_else(|| {
                format!("expected auto, path, light, whitted, direct, ao, or one of: {}", aov_names())
            })?;
            IntegratorChoice::Aov(aov)
        }
    })
}

pub(crate) fn aovs(s: &str) -> Result<AovList, String> {
    let mut list = Vec::new();
    for name in s.split(',') {
        let aov = Aov::from_str(name.trim()).map_err(|_| format!("unknown '{name}'; there are: {}", aov_names()))?;
        if !list.contains(&aov) {
            list.push(aov);
        }
    }
    Ok(AovList(list))
}

/// A scenario by its id, as `S1`.
pub(crate) fn scenario(s: &str) -> Result<Scenario, String> {
    let known = || scenario::ALL.map(|s| s.id).join(", ");
    let found = scenario::ALL.into_iter().find(|known| known.id.eq_ignore_ascii_case(s.trim()));
    found.ok_or_else(|| format!("unknown scenario; there are: {}", known()))
}

pub(crate) fn layout(s: &str) -> Result<Layout, String> {
    let known = || Layout::ALL.map(Layout::name).join(" or ");
    Layout::ALL.into_iter().find(|l| l.name() == s).ok_or_else(|| format!("unknown layout '{s}' ({})", known()))
}

pub(crate) fn build(s: &str) -> Result<BuildQuality, String> {
    match s {
        "fast" => Ok(BuildQuality::Fast),
        "balanced" => Ok(BuildQuality::Balanced),
        "high" => Ok(BuildQuality::High),
        _ => Err(format!("unknown build '{s}' (fast, balanced or high)")),
    }
}

/// A whole number, also as `1e9`.
pub(crate) fn count(s: &str) -> Result<u64, String> {
    let wrong = || "expected a whole number from 0, as 1000000 or 1e6".to_owned();
    if let Ok(n) = s.parse() {
        return Ok(n);
    }
    let n: f64 = s.parse().map_err(|_| wrong())?;
    // Up to here f64 has every whole number.
    if (0.0..=9e15).contains(&n) && n.fract() == 0.0 { Ok(n as u64) } else { Err(wrong()) }
}

/// `auto`, `auto,-shadows,+ao`, `shadows,textures`, `none`.
pub(crate) fn effects(s: &str) -> Result<EffectOverrides, String> {
    let mut overrides = EffectOverrides::default();
    let mut auto = false;
    for item in s.split(',').map(str::trim) {
        if let Some(name) = item.strip_prefix('+') {
            overrides.add |= effect(name)?;
        } else if let Some(name) = item.strip_prefix('-') {
            overrides.remove |= effect(name)?;
        } else if item == "auto" {
            auto = true;
        } else {
            let named = if item == "none" { EffectSet::empty() } else { effect(item)? };
            overrides.only = Some(overrides.only.unwrap_or_default() | named);
        }
    }
    if auto && overrides.only.is_some() {
        return Err("beside auto, write +NAME or -NAME".into());
    }
    Ok(overrides)
}

fn effect(name: &str) -> Result<EffectSet, String> {
    EffectSet::by_name(name).ok_or_else(|| {
        let names = EffectSet::NAMES.map(|(_, name)| name).join(", ");
        format!("unknown effect '{name}'; there are: auto, none, {names}")
    })
}

fn aov_names() -> String {
    Aov::ALL.map(Aov::name).join(", ")
}

fn whole(s: &str) -> Option<u32> {
    s.trim().parse().ok()
}

fn finite(s: &str) -> Option<f64> {
    s.trim().parse().ok().filter(|x: &f64| x.is_finite())
}

fn numbers<const N: usize>(s: &str) -> Option<[f64; N]> {
    let list: Option<Vec<f64>> = s.split(',').map(finite).collect();
    list?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolution_takes_x_and_comma() {
        let hd = Resolution { width: 1280, height: 720 };
        for s in ["1280x720", "1280,720", "1280X720", "1280, 720"] {
            assert_eq!(resolution(s), Ok(hd), "{s}");
        }
        for s in ["", "1280", "1280x", "x720", "0x720", "1280x0", "-1x5", "1.5x2", "1x2x3", "99999999999x1"] {
            assert!(resolution(s).is_err(), "{s}");
        }
    }

    #[test]
    fn sizes_have_units() {
        for (text, bytes) in [("1", 1), ("2kB", 2000), ("2 KiB", 2048), ("1.5GiB", 3 << 29), ("500MB", 500_000_000)] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        for text in ["", "0", "-1", "GiB", "1x", "1.2.3", "nan"] {
            assert!(size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn vectors_may_be_negative_but_not_nan() {
        assert_eq!(vector("-1,2.5,-3e2"), Ok(DVec3::new(-1.0, 2.5, -300.0)));
        for s in ["", "1,2", "1,2,3,4", "1,2,nan", "inf,0,0", "a,b,c"] {
            assert!(vector(s).is_err(), "{s}");
        }
        assert!(direction("0,0,0").is_err());
        assert_eq!(direction("0,-2,0"), Ok(DVec3::NEG_Y));
    }

    #[test]
    fn a_clip_box_may_be_given_by_any_two_corners() {
        assert_eq!(clip_box("1,-1,0,-1,1,2"), Ok((DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 2.0))));
        assert!(clip_box("1,2,3").is_err());
        assert!(plane("0,0,0,1").is_err());
    }

    #[test]
    fn crops_are_whole_and_not_empty() {
        assert_eq!(crop("1,2,3,4"), Ok(Crop { x: 1, y: 2, width: 3, height: 4 }));
        for s in ["1,2,0,4", "1,2,3,0", "1,2,3", "-1,2,3,4", "1,2,3,4,5"] {
            assert!(crop(s).is_err(), "{s}");
        }
    }

    #[test]
    fn colors_are_srgb() {
        assert_eq!(color("0,0.5,1").map(|c| c.0.x), Ok(0.0));
        assert_eq!(color("#ffffff"), Ok(Color(Vec3::ONE)));
        assert!((color("#808080").unwrap().linear().y - 0.215_861).abs() < 1e-6);
        for s in ["", "1,1", "2,0,0", "-0.1,0,0", "#fff", "#gggggg", "#+12345"] {
            assert!(color(s).is_err(), "{s}");
        }
    }

    #[test]
    fn effects_change_or_replace_what_the_scene_calls_for() {
        assert_eq!(effects("auto"), Ok(EffectOverrides::default()));
        assert_eq!(
            effects("auto,-shadows,+ao"),
            Ok(EffectOverrides { only: None, add: EffectSet::AMBIENT_OCCLUSION, remove: EffectSet::SHADOWS })
        );
        assert_eq!(effects("-shadows").map(|e| (e.only, e.remove)), Ok((None, EffectSet::SHADOWS)));
        assert_eq!(effects("shadows,alpha-mask").map(|e| e.only), Ok(Some(EffectSet::SHADOWS | EffectSet::ALPHA_MASK)));
        assert_eq!(effects("none").map(|e| e.only), Ok(Some(EffectSet::empty())));
        assert!(effects("auto,shadows").unwrap_err().contains("+NAME"));
        assert!(effects("sparkles").unwrap_err().contains("punctual-lights"));
    }

    #[test]
    fn counts_are_whole() {
        assert_eq!(["1e9", "25", "18446744073709551615"].map(count), [Ok(1_000_000_000), Ok(25), Ok(u64::MAX)]);
        assert!(["-1", "1.5", "1e20", "many", "nan"].iter().all(|s| count(s).is_err()));
        assert_eq!(scenario("s15").map(|s| s.id), Ok("S15"));
        assert!(scenario("S99").is_err_and(|e| e.contains("S1, S2")));
    }

    #[test]
    fn shares_begin_at_blocks() {
        assert_eq!(samples("64..100"), Ok((64, 100)));
        assert!(["1..2", "16..16", "32..16", "16", "..", "a..b"].iter().all(|s| samples(s).is_err()));
    }

    #[test]
    fn moments_and_frames_are_read() {
        assert_eq!(["1.25s", "-1", "40ms", "0"].map(moment), [1.25, -1.0, 0.04, 0.0].map(Ok));
        assert!(["", "s", "1m", "nan", "1 hour"].iter().all(|s| moment(s).is_err()));
        assert_eq!(frames("0..48"), Ok((0, 48)));
        assert!(["3..3", "4..3", "3", "-1..2", ".."].iter().all(|s| frames(s).is_err()));
        assert_eq!(animation("all"), Ok(AnimationChoice::All));
    }

    #[test]
    fn times_have_units() {
        let seconds = |s: &str| time(s).map(|t| t.as_secs_f64());
        assert_eq!(["30s", "1.5", "2m", "1h", "250ms"].map(seconds), [30.0, 1.5, 120.0, 3600.0, 0.25].map(Ok));
        assert!(["0s", "-1s", "", "s", "5 days", "nan", "1e400"].iter().all(|s| time(s).is_err()));
    }

    #[test]
    fn every_aov_is_an_integrator_too() {
        for aov in Aov::ALL.into_iter().filter(|a| a.is_sampled()) {
            assert_eq!(integrator(aov.name()), Ok(IntegratorChoice::Aov(aov)));
        }
        assert!(integrator("samples").is_err(), "known of a pixel as a whole");
        assert_eq!(integrator("ao"), Ok(IntegratorChoice::AmbientOcclusion));
        assert!(integrator("path-of-least-resistance").is_err());
        assert_eq!(aovs("depth,normal,depth"), Ok(AovList(vec![Aov::Depth, Aov::Normal])));
        assert!(aovs("depth,,normal").is_err());
    }
}
