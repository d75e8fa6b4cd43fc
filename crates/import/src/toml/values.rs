//! The small values of a scene file: numbers that are finite, colours, lists of named things.

use std::fmt;
use std::marker::PhantomData;

use glam::{DVec2, DVec3, Vec3};
use serde::de::{self, Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::srgb;

/// A finite number.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, serde::Deserialize)]
#[serde(try_from = "f64")]
pub(super) struct Number(pub(super) f64);

impl TryFrom<f64> for Number {
    type Error = String;

    fn try_from(x: f64) -> Result<Self, String> {
        if x.is_finite() { Ok(Self(x)) } else { Err(format!("numbers must be finite, but here is {x}")) }
    }
}

/// Two finite numbers.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(from = "[Number; 2]")]
pub(super) struct Pair(pub(super) DVec2);

impl From<[Number; 2]> for Pair {
    fn from([x, y]: [Number; 2]) -> Self {
        Self(DVec2::new(x.0, y.0))
    }
}

/// A point or direction: three finite numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(from = "[Number; 3]")]
pub(super) struct Triple(pub(super) DVec3);

impl From<[Number; 3]> for Triple {
    fn from(xyz: [Number; 3]) -> Self {
        Self(DVec3::from(xyz.map(|x| x.0)))
    }
}

/// One number for all three axes, or one for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale(pub(super) DVec3);

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Scales;
        impl<'de> Visitor<'de> for Scales {
            type Value = Scale;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or [x, y, z]")
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<Scale, E> {
                Ok(Scale(DVec3::splat(Number::try_from(x).map_err(E::custom)?.0)))
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<Scale, E> {
                self.visit_f64(x as f64)
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<Scale, E> {
                self.visit_f64(x as f64)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Scale, A::Error> {
                Triple::deserialize(de::value::SeqAccessDeserializer::new(seq)).map(|t| Scale(t.0))
            }
        }
        d.deserialize_any(Scales)
    }
}

/// A colour or amount of light: linear `[r, g, b]`, one number for grey, or `"#rrggbb"` in sRGB. Never negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Color(pub(super) Vec3);

impl Color {
    pub(super) const WHITE: Self = Self(Vec3::ONE);
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Colors;
        impl<'de> Visitor<'de> for Colors {
            type Value = Color;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a colour: linear [r, g, b], a number, or \"#rrggbb\"")
            }
            fn visit_f64<E: de::Error>(self, x: f64) -> Result<Color, E> {
                channel(x).map(|x| Color(Vec3::splat(x))).map_err(E::custom)
            }
            fn visit_i64<E: de::Error>(self, x: i64) -> Result<Color, E> {
                self.visit_f64(x as f64)
            }
            fn visit_u64<E: de::Error>(self, x: u64) -> Result<Color, E> {
                self.visit_f64(x as f64)
            }
            fn visit_str<E: de::Error>(self, s: &str) -> Result<Color, E> {
                let rgb = srgb::from_hex(s).map(|rgb| rgb.map(|x| srgb::to_linear(x) as f32));
                rgb.map(|rgb| Color(rgb.into())).ok_or_else(|| E::invalid_value(de::Unexpected::Str(s), &self))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Color, A::Error> {
                let rgb = <[f64; 3]>::deserialize(de::value::SeqAccessDeserializer::new(seq))?;
                let [r, g, b] = rgb.map(channel);
                let color = || Ok(Color(Vec3::new(r?, g?, b?)));
                color().map_err(|e: String| de::Error::custom(e))
            }
        }
        d.deserialize_any(Colors)
    }
}

fn channel(x: f64) -> Result<f32, String> {
    let narrow = x as f32;
    if narrow >= 0.0 && narrow.is_finite() {
        Ok(narrow)
    } else {
        Err(format!("a colour must be finite and not negative, but here is {x}"))
    }
}

/// A table of named things, in the order of the file; a name may stand there once.
#[derive(Clone, Debug)]
pub(super) struct Named<T>(pub(super) Vec<(String, T)>);

impl<T> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Entries<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
            type Value = Named<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of names")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Named<T>, A::Error> {
                let mut seen = std::collections::HashSet::new();
                let mut entries = Vec::new();
                while let Some((name, value)) = map.next_entry::<String, T>()? {
                    if !seen.insert(name.clone()) {
                        return Err(de::Error::custom(format!("'{name}' is given twice")));
                    }
                    entries.push((name, value));
                }
                Ok(Named(entries))
            }
        }
        d.deserialize_map(Entries(PhantomData))
    }
}

/// A number in a range, or its default.
pub(super) fn within(what: &str, x: Option<Number>, default: f32, least: f64, most: f64) -> Result<f32, String> {
    match x {
        None => Ok(default),
        Some(Number(x)) if (least..=most).contains(&x) => Ok(x as f32),
        Some(Number(x)) => Err(format!("'{what}' must be between {least} and {most}, but is {x}")),
    }
}

/// A number that fits, or its default.
pub(super) fn not_negative(what: &str, x: Option<Number>, default: f32) -> Result<f32, String> {
    within(what, x, default, 0.0, f64::from(f32::MAX))
}

/// A number above 0 that fits.
pub(super) fn positive(what: &str, x: Number) -> Result<f64, String> {
    if x.0 > 0.0 { Ok(x.0) } else { Err(format!("'{what}' must be above 0, but is {}", x.0)) }
}
