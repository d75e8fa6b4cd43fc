//! Texture statements of MTL: options, then a file name that may hold spaces.

use glam::{Affine2, Vec2};

use crate::scene::{Channel, TextureRef, Wrap};

/// A texture statement such as `-s 2 2 -bm 0.5 Brick wall.png`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Texture {
    /// The file's name as written.
    pub(super) name: String,
    /// `-s`: repetitions over the unit square, and `-o`: offset, both in OBJ's coordinates.
    scale: Vec2,
    offset: Vec2,
    /// `-clamp on`.
    clamp: bool,
    /// `-bm`: multiplies a height or normal map.
    pub(super) strength: f32,
    /// `-mm base gain`: a value becomes base + gain * value.
    base: f32,
    gain: f32,
    /// `-imfchan`.
    pub(super) channel: Option<Channel>,
    /// Options that change the picture and are not honoured.
    pub(super) ignored: Vec<&'static str>,
}

impl Texture {
    /// Reads what follows the keyword. Options may also follow the name, as some exporters write them.
    pub(super) fn parse(statement: &str) -> Self {
        let mut texture = Self {
            name: String::new(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamp: false,
            strength: 1.0,
            base: 0.0,
            gain: 1.0,
            channel: None,
            ignored: Vec::new(),
        };
        let mut rest = statement.trim();
        while let Some(after) = texture.option(rest) {
            rest = after;
        }
        // From the first word that reads as an option on there are only options.
        let mut name = rest;
        for (at, _) in rest.match_indices(" -") {
            let mut tail = &rest[at + 1..];
            let mut with_tail = texture.clone();
            while let Some(after) = with_tail.option(tail) {
                tail = after;
            }
            if tail.is_empty() {
                (texture, name) = (with_tail, &rest[..at]);
                break;
            }
        }
        texture.name = name.trim().to_owned();
        texture
    }

    /// Takes the option at the start, if there is one, and returns what follows it.
    fn option<'a>(&mut self, text: &'a str) -> Option<&'a str> {
        let (word, rest) = split(text);
        match word {
            "-s" => {
                let mut s = [1.0; 3];
                let rest = numbers(rest, 1, &mut s)?;
                self.scale = Vec2::new(s[0], s[1]);
                Some(rest)
            }
            "-o" => {
                let mut o = [0.0; 3];
                let rest = numbers(rest, 1, &mut o)?;
                self.offset = Vec2::new(o[0], o[1]);
                Some(rest)
            }
            "-t" => {
                self.ignored.push("-t (turbulence)");
                numbers(rest, 1, &mut [0.0; 3])
            }
            "-mm" => {
                let mut mm = [0.0, 1.0];
                let rest = numbers(rest, 2, &mut mm)?;
                [self.base, self.gain] = mm;
                Some(rest)
            }
            "-bm" => numbers(rest, 1, std::slice::from_mut(&mut self.strength)),
            "-boost" | "-texres" => numbers(rest, 1, &mut [0.0]),
            "-clamp" | "-blendu" | "-blendv" | "-cc" => {
                let (value, rest) = split(rest);
                if word == "-clamp" {
                    self.clamp = value == "on";
                }
                matches!(value, "on" | "off").then_some(rest)
            }
            "-imfchan" => {
                let (value, rest) = split(rest);
                self.channel = match value {
                    "r" => Some(Channel::Red),
                    "g" => Some(Channel::Green),
                    "b" => Some(Channel::Blue),
                    "m" => Some(Channel::Alpha),
                    "l" => Some(Channel::Luminance),
                    _ => return None,
                };
                Some(rest)
            }
            "-type" => {
                self.ignored.push("-type (sphere and cube maps)");
                Some(split(rest).1)
            }
            "-colorspace" => Some(split(rest).1),
            _ => None,
        }
    }

    /// How the image is put on the surface.
    pub(super) fn reference(&self, image: usize) -> TextureRef {
        // OBJ: u' = s u + o from the lower left. With v counted from the top: v' = 1 - (s (1 - v) + o).
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        let wrap = if self.clamp { Wrap::Clamp } else { Wrap::Repeat };
        TextureRef {
            transform: Affine2::from_scale_angle_translation(self.scale, 0.0, offset),
            wrap_u: wrap,
            wrap_v: wrap,
            channel: self.channel.unwrap_or_default(),
            value_scale: self.gain,
            value_offset: self.base,
            ..TextureRef::new(image)
        }
    }
}

/// Takes at least `least` numbers, and as many as there are values; the other values keep what they were.
fn numbers<'a>(mut text: &'a str, least: usize, values: &mut [f32]) -> Option<&'a str> {
    let mut count = 0;
    for value in values {
        let (word, rest) = split(text);
        let Some(x) = word.parse::<f32>().ok().filter(|x| x.is_finite()) else { break };
        (*value, text) = (x, rest);
        count += 1;
    }
    (count >= least).then_some(text)
}

/// The first word and the rest.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    let (word, rest) = text.split_at(text.find(char::is_whitespace).unwrap_or(text.len()));
    (word, rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_spaces_follow_the_options() {
        let t = Texture::parse("-s 2 3 1 -o 0.5 -bm 0.25 -clamp on -imfchan m Brick wall -o.png");
        assert_eq!(t.name, "Brick wall -o.png");
        assert_eq!((t.scale, t.offset, t.strength), (Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0), 0.25));
        assert!(t.clamp);
        assert_eq!(t.channel, Some(Channel::Alpha));
    }

    #[test]
    fn options_may_follow_the_name() {
        let t = Texture::parse("-imfchan r bump map2.jpg -bm 1.5 -s 2 2");
        assert_eq!((t.name.as_str(), t.strength, t.scale), ("bump map2.jpg", 1.5, Vec2::splat(2.0)));
        assert_eq!(Texture::parse("a -bm.png").name, "a -bm.png");
        assert_eq!(Texture::parse("-unknown 3 a.png").name, "-unknown 3 a.png");
        assert_eq!(Texture::parse("").name, "");
    }

    #[test]
    fn scale_and_offset_count_from_the_lower_left() {
        let r = Texture::parse("-s 2 4 -o 0.25 0.125 a.png").reference(0);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.3, 0.7)] {
            let (want_u, want_v) = (2.0 * u + 0.25, 4.0 * v + 0.125);
            let got = r.transform.transform_point2(Vec2::new(u, 1.0 - v));
            // A few units in the last place of numbers up to 4.
            assert!((got - Vec2::new(want_u, 1.0 - want_v)).abs().max_element() < 1e-6);
        }
    }
}
