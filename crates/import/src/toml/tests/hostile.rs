//! Whatever a file holds: an answer or an error, never a panic.

use proptest::prelude::*;

use super::{folder, read};
use crate::{Options, open};

const GOOD: &str = include_str!("../../../../../assets/scenes/shapes.toml");

#[test]
fn deep_nesting_is_refused() {
    for n in [200, 100_000] {
        assert!(read("a.json", &("{\"note\":".to_owned() + &"[".repeat(n))).is_err());
        assert!(read("a.json", &("{\"objects\":".to_owned() + &"{\"a\":".repeat(n))).is_err());
        assert!(read("a.toml", &("note = ".to_owned() + &"[".repeat(n))).is_err());
        assert!(read("a.toml", &("note = ".to_owned() + &"{a=".repeat(n))).is_err());
        assert!(read("a.toml", &("note".to_owned() + &".a".repeat(n) + " = 1\n[note]")).is_err());
    }
}

#[test]
fn what_is_no_text_is_refused() {
    let (_dir, path) = folder("a.toml", "");
    std::fs::write(&path, b"\nname = \"\xff\"").expect("file");
    let e = open(&path, &Options::default()).expect_err("no UTF-8");
    assert!(e.to_string().ends_with("line 2: is not UTF-8 text"), "{e}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn mutated_scenes_never_panic(
        cuts in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..30, any::<prop::sample::Index>()), 1..4)
    ) {
        const TOKENS: [&str; 18] = [
            "", "nan", "-inf", "1e308", "-1e308", "1e-320", "9223372036854775807", "0", "-1", "'x'", "[]", "{}",
            "[[1]]", "true", "\n", "=", "]", "\u{0}",
        ];
        let mut text: Vec<char> = GOOD.chars().collect();
        for (at, length, token) in cuts {
            let start = at.index(text.len());
            let end = (start + length).min(text.len());
            text.splice(start..end, TOKENS[token.index(TOKENS.len())].chars());
        }
        let _ = read("a.toml", &text.into_iter().collect::<String>());
    }

    #[test]
    fn any_numbers_make_a_scene_or_an_error(n in prop::collection::vec(any::<f64>(), 13)) {
        let n: Vec<String> = n.iter().map(|x| format!("{x:?}").replace("NaN", "nan")).collect();
        let text = format!(
            "camera = {{ origin = [{0}, {1}, {2}], target = [{3}, {4}, {5}], up = [{6}, {7}, {8}] }}
             objects = [
                {{ shape = 'cylinder', from = [{0}, {1}, {2}], to = [{3}, {4}, {5}], radius = {6} }},
                {{ shape = 'cone', from = [{0}, {1}, {2}], to = [{3}, {4}, {5}], radius = {6}, top_radius = {7} }},
                {{ shape = 'hyperboloid-two', from = [{0}, {1}, {2}], to = [{3}, {4}, {5}], gap = {6}, radius = {7},
                   transform = {{ rotate_deg = [{8}, {9}, {10}], scale = {11}, translate = [{12}, 0, 0] }} }},
             ]",
            n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9], n[10], n[11], n[12]
        );
        if let Ok(imported) = read("a.toml", &text) {
            prop_assert!(imported.scene.instances.iter().all(|i| i.transform.is_finite()));
        }
    }
}
