//! The transfer function of sRGB (IEC 61966-2-1) and its notation in hexadecimal digits.

/// From sRGB to linear light, 0 to 1.
///
/// ```
/// use firsthit_import::srgb;
///
/// assert_eq!((srgb::to_linear(0.0), srgb::to_linear(1.0)), (0.0, 1.0));
/// assert!((srgb::to_linear(0.5) - 0.21404).abs() < 1e-5);
/// ```
#[must_use]
pub fn to_linear(x: f64) -> f64 {
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// The three channels of `#rrggbb`, 0 to 1, still sRGB; `None` if it is no such thing.
///
/// ```
/// use firsthit_import::srgb;
///
/// assert_eq!(srgb::from_hex("#ff0033"), Some([1.0, 0.0, 0.2]));
/// assert_eq!(srgb::from_hex("#f03"), None);
/// ```
#[must_use]
pub fn from_hex(text: &str) -> Option<[f64; 3]> {
    let digits = text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()))?;
    let rgb = u32::from_str_radix(digits, 16).ok()?;
    Some([16, 8, 0].map(|shift| f64::from((rgb >> shift) & 0xff) / 255.0))
}
