use std::sync::Arc;

use firsthit_import::scene::{Channel, Filter, TextureRef};
use glam::{Affine2, Vec3, Vec4Swizzles};
use proptest::prelude::*;

use super::level::{SRGB_8, srgb_byte};
use super::*;
use crate::view::linear_to_srgb;

fn image(width: u32, height: u32, pixels: Pixels) -> ImageDesc {
    ImageDesc { name: "test".into(), width, height, pixels }
}

fn rgba8(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> ImageDesc {
    let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
    image(width, height, Pixels::Rgba8(pixels))
}

fn lookup(image: &ImageDesc, space: ColorSpace, change: impl Fn(&mut TextureRef)) -> TextureLookup {
    let mut reference = TextureRef::new(0);
    change(&mut reference);
    TextureLookup::new(Arc::new(Texture::new(image, space).unwrap()), &reference, true)
}

/// Texel (x, y) of this image has the value 10 x + y.
fn numbered() -> ImageDesc {
    rgba8(4, 2, |x, y| [(10 * x + y) as u8, 0, 0, 255])
}

fn value(l: &TextureLookup, u: f32, v: f32) -> f32 {
    l.scalar(Vec2::new(u, v), 0.0) * 255.0
}

#[test]
fn texel_middles_are_exact_and_row_0_is_at_v_0() {
    let l = lookup(&numbered(), ColorSpace::Linear, |_| {});
    for x in 0..4_u8 {
        for y in 0..2_u8 {
            let (u, v) = ((f32::from(x) + 0.5) / 4.0, (f32::from(y) + 0.5) / 2.0);
            assert!((value(&l, u, v) - f32::from(10 * x + y)).abs() < 1e-4);
        }
    }
    // Half way between two middles.
    assert!((value(&l, 0.25, 0.25) - 5.0).abs() < 1e-4);
    assert!((value(&l, 0.125, 0.5) - 0.5).abs() < 1e-4);
}

#[test]
fn wrap_modes_continue_the_image_as_they_say() {
    let with = |wrap| lookup(&numbered(), ColorSpace::Linear, |r| (r.wrap_u, r.wrap_v) = (wrap, wrap));
    let (repeat, mirror, clamp) = (with(Wrap::Repeat), with(Wrap::Mirror), with(Wrap::Clamp));
    let v = 0.25;
    for k in [-3.0, -1.0, 2.0] {
        for x in 0..4 {
            let u = (x as f32 + 0.5) / 4.0;
            assert!((value(&repeat, u + k, v) - value(&repeat, u, v)).abs() < 1e-3);
            let mirrored = if k == 2.0 { u } else { 1.0 - u };
            assert!((value(&mirror, u + k, v) - value(&mirror, mirrored, v)).abs() < 1e-3);
            assert_eq!(value(&clamp, u + k, v), if k < 0.0 { 0.0 } else { 30.0 });
        }
    }
    // At the border: half of each side, only the own side, only the own side.
    assert!((value(&repeat, 0.0, v) - 15.0).abs() < 1e-3);
    assert!(value(&mirror, 0.0, v).abs() < 1e-3 && (value(&mirror, 1.0, v) - 30.0).abs() < 1e-3);
    assert!(value(&clamp, 0.0, v).abs() < 1e-3);
}

#[test]
fn nearest_takes_whole_texels() {
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let l = lookup(&numbered(), ColorSpace::Linear, |r| {
            r.filter = Filter::Nearest;
            (r.wrap_u, r.wrap_v) = (wrap, wrap);
        });
        for (u, expected) in [(0.0, 0.0), (0.249, 0.0), (0.251, 10.0), (0.999, 30.0)] {
            assert!((value(&l, u, 0.1) - expected).abs() < 1e-4, "{wrap:?} {u}");
        }
    }
}

#[test]
fn srgb_is_decoded_before_filtering() {
    let l = lookup(&rgba8(2, 1, |x, _| [255 * x as u8, 0, 0, 255]), ColorSpace::Srgb, |r| r.wrap_u = Wrap::Clamp);
    assert!((l.scalar(Vec2::new(0.5, 0.5), 0.0) - 0.5).abs() < 1e-6);
    let grey = lookup(&rgba8(1, 1, |_, _| [128, 128, 128, 128]), ColorSpace::Srgb, |_| {});
    let c = grey.color(Vec2::ZERO, 0.0);
    assert!((c.x - 0.215_861).abs() < 1e-5 && (c.w - 128.0 / 255.0).abs() < 1e-6);
}

/// Every level, of whatever size, has the mean of the whole image in linear, but for rounding to its bits.
#[test]
fn one_channel_is_that_of_all() {
    let image = rgba8(8, 4, |x, y| [x as u8 * 30, y as u8 * 60, 200 - x as u8 * 20, 255 - y as u8 * 50]);
    for space in [ColorSpace::Linear, ColorSpace::Srgb] {
        for (i, channel) in [Channel::Red, Channel::Green, Channel::Blue, Channel::Alpha].into_iter().enumerate() {
            let l = lookup(&image, space, |r| r.channel = channel);
            for (u, v, footprint) in [(0.1, 0.2, 0.0), (0.93, -0.4, 0.3), (7.5, 0.01, 0.11), (0.5, 0.5, 2.0)] {
                let uv = Vec2::new(u, v);
                assert_eq!(l.scalar(uv, footprint), l.color(uv, footprint)[i], "{channel:?} {uv}");
            }
        }
    }
}

#[test]
fn what_is_black_over_a_triangle_never_shows_light() {
    // Light in one texel of 64 x 32.
    let image = rgba8(64, 32, |x, y| if (x, y) == (40, 20) { [0, 9, 0, 255] } else { [0, 0, 0, 255] });
    for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        let l = lookup(&image, ColorSpace::Srgb, |r| (r.wrap_u, r.wrap_v) = (wrap, wrap));
        let mut black = 0;
        for k in 0..4000 {
            let number =
                |i: u32| crate::sampler::PixelSampler::new(k, (0, 0), i).get2(crate::sampler::Dimension::Pixel);
            let corner = Vec2::from(number(0)) * 4.0 - 2.0;
            let [a, b, c] = [0, 1, 2].map(|i| corner + Vec2::from(number(1 + i)) * 0.3);
            if l.is_black_over([a, b, c]) {
                black += 1;
                for i in 0..64 {
                    let (x, y) = ((i % 8) as f32 / 7.0, (i / 8) as f32 / 7.0);
                    let uv = a + (b - a) * (x * (1.0 - y)) + (c - a) * y;
                    assert_eq!(l.color(uv, 0.0).xyz(), Vec3::ZERO, "{wrap:?} {uv}");
                }
            }
        }
        assert!((500..4000).contains(&black), "{wrap:?}: {black}");
        assert!(!l.is_black_over([Vec2::new(0.6, 0.6), Vec2::new(0.65, 0.6), Vec2::new(0.6, 0.7)]));
    }
}

#[test]
fn bytes_of_the_srgb_curve_are_rounded() {
    for i in 0..=4096 {
        let x = i as f32 / 4096.0;
        assert_eq!(srgb_byte(x), (linear_to_srgb(x) * 255.0 + 0.5) as u8, "{x}");
    }
    for byte in 0..=255 {
        assert_eq!(srgb_byte(SRGB_8[usize::from(byte)]), byte);
    }
}

#[test]
fn whole_numbers_below_are_those_of_the_library() {
    for t in [0.0, -0.0, 0.5, -0.5, -1.0, 1.0, 7.99, -7.01, 8_388_607.5, -8_388_607.5, 1e9, -3e12, f32::MAX] {
        assert_eq!(floor(t), t.floor(), "{t}");
    }
}

#[test]
fn smaller_copies_keep_the_mean() {
    for (width, height) in [(8, 8), (7, 5), (13, 1), (1, 9), (6, 3)] {
        let noise = |x: u32, y: u32| ((x * 7919 + y * 104_729 + x * y * 31) % 256) as u8;
        let pixels: Vec<[u16; 4]> =
            (0..width * height).map(|i| [noise(i % width, i / width), 0, 0, 255].map(|v| u16::from(v) * 257)).collect();
        let image = image(width, height, Pixels::Rgba16(pixels.into()));
        for space in [ColorSpace::Linear, ColorSpace::Srgb] {
            let texture = Texture::new(&image, space).unwrap();
            let mean = |level: &Level| {
                let texels = (0..level.width * level.height)
                    .map(|i| f64::from(level.texel(space, i % level.width, i / level.width).x));
                texels.sum::<f64>() / f64::from(level.width * level.height)
            };
            let whole = mean(&texture.levels[0]);
            for level in &texture.levels {
                assert!((mean(level) - whole).abs() < 1e-4, "{width}x{height} {space:?} {}", level.width);
            }
            let last = texture.levels.last().unwrap();
            assert_eq!((last.width, last.height), (1, 1));
        }
    }
}

#[test]
fn wide_footprints_see_the_mean_and_narrow_ones_the_texel() {
    let checker = rgba8(64, 64, |x, y| [255 * ((x + y) % 2) as u8, 0, 0, 255]);
    let l = lookup(&checker, ColorSpace::Linear, |_| {});
    let uv = Vec2::new(0.5 / 64.0, 0.5 / 64.0);
    assert_eq!(l.scalar(uv, 0.0), 0.0);
    assert_eq!(l.scalar(uv, 1.0 / 64.0), 0.0);
    for footprint in [2.0 / 64.0, 0.5, 1.0, 1e6, f32::INFINITY] {
        assert!((l.scalar(uv, footprint) - 0.5).abs() < 3e-3, "{footprint}");
    }
    // A texture repeated twice as often shows twice as many texels in the same footprint.
    let twice = lookup(&checker, ColorSpace::Linear, |r| r.transform = Affine2::from_scale(Vec2::splat(2.0)));
    assert!((twice.scalar(uv * 0.5, 1.0 / 64.0) - 0.5).abs() < 3e-3);
    let reference = TextureRef::new(0);
    let plain = TextureLookup::new(Arc::new(Texture::new(&checker, ColorSpace::Linear).unwrap()), &reference, false);
    assert_eq!(plain.scalar(uv, 1.0), 0.0, "without mips there is only the whole image");
}

#[test]
fn what_is_cut_out_does_not_tint_smaller_copies() {
    let leaf = rgba8(2, 2, |x, _| if x == 0 { [0, 255, 0, 255] } else { [255, 0, 255, 0] });
    let coverage = lookup(&leaf, ColorSpace::SrgbCoverage, |_| {}).color(Vec2::splat(0.5), 10.0);
    assert_eq!((coverage.xyz(), coverage.w), (Vec3::Y, 128.0 / 255.0));
    let plain = lookup(&leaf, ColorSpace::Srgb, |_| {}).color(Vec2::splat(0.5), 10.0);
    assert!((plain.xyz() - Vec3::splat(0.5)).length() < 0.01);
}

#[test]
fn scale_offset_and_channel_are_applied() {
    let image = rgba8(1, 1, |_, _| [51, 102, 153, 204]);
    for (channel, expected) in [
        (Channel::Red, 0.2),
        (Channel::Green, 0.4),
        (Channel::Blue, 0.6),
        (Channel::Alpha, 0.8),
        (Channel::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.6),
    ] {
        let l = lookup(&image, ColorSpace::Linear, |r| {
            (r.channel, r.value_scale, r.value_offset) = (channel, 2.0, 0.5);
        });
        assert!((l.scalar(Vec2::ZERO, 0.0) - (2.0 * expected + 0.5)).abs() < 1e-6, "{channel:?}");
        let c = l.color(Vec2::ZERO, 0.0);
        assert!((c - Vec4::new(0.9, 1.3, 1.7, 0.8)).length() < 1e-6);
    }
}

#[test]
fn an_image_without_its_pixels_is_refused() {
    let error = Texture::new(&image(2, 2, Pixels::Rgba8(Arc::new([[0; 4]; 3]))), ColorSpace::Srgb).unwrap_err();
    assert_eq!(error.to_string(), "image 'test' should have 2 x 2 pixels (at least one), but has 3");
    assert!(Texture::new(&image(0, 0, Pixels::Rgb32F(Arc::new([]))), ColorSpace::Linear).is_err());
}

proptest! {
    /// Any coordinates and footprints at all: no panic, and a value between the image's least and greatest.
    #[test]
    fn any_coordinates_give_a_value_of_the_image(
        u in any::<f32>(), v in any::<f32>(), footprint in any::<f32>(),
        wrap in prop::sample::select(vec![Wrap::Repeat, Wrap::Mirror, Wrap::Clamp]),
        filter in prop::sample::select(vec![Filter::Nearest, Filter::Linear]),
        width in 1_u32..9, height in 1_u32..9,
    ) {
        let image = rgba8(width, height, |x, y| [(20 + 20 * x + y) as u8, 0, 0, 255]);
        let l = lookup(&image, ColorSpace::Linear, |r| {
            (r.wrap_u, r.wrap_v, r.filter) = (wrap, wrap, filter);
        });
        let value = l.scalar(Vec2::new(u, v), footprint) * 255.0;
        prop_assert!((19.9..=190.0).contains(&value), "{value}");
    }
}

#[test]
fn a_level_by_chance_is_on_average_the_mix_of_both() {
    let l =
        lookup(&rgba8(16, 8, |x, y| [(16 * x) as u8, (30 * y) as u8, (x * y) as u8, 255]), ColorSpace::Srgb, |_| {});
    let uv = Vec2::new(0.31, 0.77);
    for footprint in [0.0, 0.05, 0.13, 0.17, 0.4, 3.0, f32::NAN] {
        const N: u32 = 4096;
        let chance = |i: u32| (i as f32 + 0.5) / N as f32;
        let mean = (0..N).map(|i| l.color_at(&l.view(uv, footprint, chance(i)))).sum::<Vec4>() / N as f32;
        assert!((mean - l.color(uv, footprint)).abs().max_element() < 1e-3, "{footprint}");
    }
}

#[test]
fn textures_have_one_number_where_they_are_read_at_the_same_places() {
    let image = |width| rgba8(width, 2, |_, _| [0; 4]);
    let mut layouts = Vec::new();
    let mut number = |width, space, change: &dyn Fn(&mut TextureRef)| {
        lookup(&image(width), space, change).numbered(&mut layouts).layout()
    };
    let first = number(4, ColorSpace::Srgb, &|_| {});
    assert_eq!(first, number(4, ColorSpace::Linear, &|r| r.channel = Channel::Green));
    let others: [&dyn Fn(&mut TextureRef); 4] =
        [&|r| r.uv_set = 1, &|r| r.wrap_v = Wrap::Clamp, &|r| r.filter = Filter::Nearest, &|r| {
            r.transform = Affine2::from_scale(Vec2::splat(2.0))
        }];
    for other in others {
        assert_ne!(first, number(4, ColorSpace::Srgb, other));
    }
    assert_ne!(first, number(8, ColorSpace::Srgb, &|_| {}));
}
