//! Comma-separated values: the fields of JSON's `tiers`, by the same names.

use firsthit_measure::result::Accuracy;
use serde_json::Value;

/// A head line, and a line for each row. Lists are spread over columns, NaN is empty.
pub(crate) fn text(accuracy: &Accuracy) -> String {
    let mut out = String::new();
    for row in &accuracy.tiers {
        let Ok(Value::Object(fields)) = serde_json::to_value(row) else { continue };
        let cells: Vec<(String, String)> = fields.iter().flat_map(|(name, value)| cells(name, value)).collect();
        if out.is_empty() {
            line(&mut out, cells.iter().map(|c| c.0.as_str()));
        }
        line(&mut out, cells.iter().map(|c| c.1.as_str()));
    }
    out
}

fn cells(name: &str, value: &Value) -> Vec<(String, String)> {
    match value {
        Value::Array(levels) => {
            let names = ["f32", "f64", "exact"].map(|level| format!("{name}_{level}"));
            names.into_iter().zip(levels.iter().map(Value::to_string)).collect()
        }
        Value::Null => vec![(name.into(), String::new())],
        Value::String(text) => vec![(name.into(), text.clone())],
        other => vec![(name.into(), other.to_string())],
    }
}

fn line<'a>(out: &mut String, cells: impl Iterator<Item = &'a str>) {
    let quoted = |cell: &str| {
        if cell.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.into() }
    };
    *out += &cells.map(quoted).collect::<Vec<_>>().join(",");
    out.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::result::TierRow;

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        let row = TierRow { model: "a, \"b\".obj".into(), t_ulp_max: f64::NAN, ..TierRow::default() };
        let text = text(&Accuracy { tiers: vec![row], ..Accuracy::default() });
        let (head, line) = text.trim_end().split_once('\n').unwrap();
        assert!(head.contains("model,") && head.contains("false_hits_by_level_f32,false_hits_by_level_f64,"), "{head}");
        assert!(line.contains("\"a, \"\"b\"\".obj\""), "{line}");
        assert_eq!(head.matches(',').count(), line.matches(',').count() - 1, "one comma is inside quotes");
    }
}
