//! Numbers and names as readers see them.

/// Text that may stand anywhere in HTML or SVG: in an element or in a quoted attribute.
///
/// Characters that XML forbids become U+FFFD, so that a strange file name does not break a picture.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\n' | '\t' => out.push(c),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A name that every file system takes: small letters, digits and single hyphens; `chart` if nothing is left.
pub(super) fn slug(text: &str) -> String {
    let lower = text.to_lowercase();
    let words: Vec<_> = lower.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    if words.is_empty() { "chart".into() } else { words.join("-") }
}

/// A whole number with its thousands set apart: `1,234,567`.
pub(super) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

/// A count with its noun: `1 triangle`, `2 triangles`.
pub(super) fn counted(n: u64, noun: &str) -> String {
    format!("{} {noun}{}", count(n), if n == 1 { "" } else { "s" })
}

/// Three digits that count: `0.0123`, `12.3`, `1,230`, `1.23×10⁻⁵`; `–` for what is no number.
pub(super) fn number(x: f64) -> String {
    if x.is_nan() {
        return "–".into();
    }
    if x.is_infinite() {
        return if x > 0.0 { "∞" } else { "−∞" }.into();
    }
    if x == 0.0 {
        return "0".into();
    }
    if x < 0.0 {
        return format!("−{}", number(-x));
    }
    // Rounded first: 0.9999 has the exponent of 1.00.
    let rounded = format!("{x:.2e}");
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    match exponent {
        -3..=2 => {
            let fixed = format!("{x:.*}", (2 - exponent).max(0) as usize);
            trimmed(&fixed).into()
        }
        3..=5 => count(x.round() as u64),
        _ => format!("{}×{}", trimmed(mantissa), power_of_ten(exponent)),
    }
}

/// Without zeros at its end that say nothing.
fn trimmed(fixed: &str) -> &str {
    if fixed.contains('.') { fixed.trim_end_matches('0').trim_end_matches('.') } else { fixed }
}

/// `10⁻⁶`.
pub(super) fn power_of_ten(exponent: i32) -> String {
    let digits = exponent.to_string();
    let raised = digits.chars().map(|c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => char::from_u32('⁰' as u32 + (c as u32 - '0' as u32)).unwrap_or(c),
    });
    format!("10{}", raised.collect::<String>())
}

/// A label of a logarithmic axis at a power of ten.
pub(super) fn decade(exponent: i32) -> String {
    match exponent {
        -2..=-1 => format!("{:.*}", -exponent as usize, 10_f64.powi(exponent)),
        0..=3 => count(10_u64.pow(exponent as u32)),
        _ => power_of_ten(exponent),
    }
}

/// How often something was seen; nothing seen in `n` trials bounds the rate by 3/n at 95 % ("rule of three").
pub(super) fn seen(hits: u64, n: u64) -> String {
    match (hits, n) {
        (_, 0) => "not measured".into(),
        (0, n) => format!("none seen in {} (< {})", count(n), number(3.0 / n as f64)),
        (hits, n) => format!("{} of {} ({})", count(hits), count(n), number(hits as f64 / n as f64)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_for_elements_and_attributes() {
        assert_eq!(escape("<b a=\"1\" c='2'>&"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;");
        assert_eq!(escape("a\u{0}\u{1b}b\n"), "a\u{fffd}\u{fffd}b\n");
    }

    #[test]
    fn numbers_keep_three_digits() {
        for (x, text) in [
            (0.0, "0"),
            (1.0, "1"),
            (0.5, "0.5"),
            (0.012345, "0.0123"),
            (0.9999, "1"),
            (12.345, "12.3"),
            (123.45, "123"),
            (999.9, "1,000"),
            (123_456.0, "123,456"),
            (1.2345e-5, "1.23×10⁻⁵"),
            (3e-6, "3×10⁻⁶"),
            (1.5e12, "1.5×10¹²"),
            (-2.5, "−2.5"),
            (f64::NAN, "–"),
            (f64::INFINITY, "∞"),
        ] {
            assert_eq!(number(x), text);
        }
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(counted(1, "ray"), "1 ray");
        assert_eq!(decade(-2), "0.01");
        assert_eq!(decade(-6), "10⁻⁶");
    }

    #[test]
    fn a_zero_says_how_many_were_looked_at() {
        assert_eq!(seen(0, 1_000_000), "none seen in 1,000,000 (< 3×10⁻⁶)");
        assert_eq!(seen(5, 1000), "5 of 1,000 (0.005)");
        assert_eq!(seen(0, 0), "not measured");
    }

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(slug("../My Model (2).OBJ"), "my-model-2-obj");
        assert_eq!(slug("ドラゴン"), "chart");
    }
}
