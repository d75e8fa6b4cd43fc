//! Which parts of a model are wanted: those of certain names.

use std::path::Path;

use crate::ImportError;
use crate::scene::SceneDesc;

/// Chooses things by their names, and remembers which of the wishes came true.
pub(crate) struct Choice<'a> {
    wishes: &'a [String],
    met: Vec<bool>,
    /// Names that there are, for the error.
    names: Vec<String>,
}

/// So many names are looked through for near ones.
const MOST_NAMES: usize = 4096;

impl<'a> Choice<'a> {
    /// `None` if everything is wanted.
    pub(crate) fn new(wishes: &'a [String]) -> Option<Self> {
        (!wishes.is_empty()).then(|| Self { wishes, met: vec![false; wishes.len()], names: Vec::new() })
    }

    /// Whether something is wanted that goes by any of these names.
    pub(crate) fn takes<'n>(&mut self, names: impl IntoIterator<Item = &'n str>) -> bool {
        let mut taken = false;
        for name in names.into_iter().filter(|name| !name.is_empty()) {
            for (wish, met) in self.wishes.iter().zip(&mut self.met) {
                if fits(wish, name) {
                    (*met, taken) = (true, true);
                }
            }
            // Of a name that comes again and again, once is enough.
            if self.names.len() < MOST_NAMES && self.names.last().is_none_or(|last| last != name) {
                self.names.push(name.to_owned());
            }
        }
        taken
    }

    /// Whether every wish came true.
    ///
    /// # Errors
    /// The first that did not, with the names that are nearest to it.
    pub(crate) fn finish(mut self, file: &Path) -> Result<(), ImportError> {
        let Some(at) = self.met.iter().position(|met| !met) else { return Ok(()) };
        let wish = &self.wishes[at];
        self.names.sort_unstable();
        self.names.dedup();
        let count = self.names.len();
        // Those of the same distance stay in their order.
        self.names.sort_by_cached_key(|name| distance(wish, name));
        const SHOWN: usize = 8;
        let near: Vec<String> = self.names.iter().take(SHOWN).map(|name| format!("'{}'", shortened(name))).collect();
        let there = match count {
            0 => "nothing in the file has a name".to_owned(),
            1 => format!("there is {}", near[0]),
            n if n <= SHOWN => format!("there are {}", near.join(", ")),
            n => format!("the nearest of {n} names are {}", near.join(", ")),
        };
        let cause = format!("no object, group, node or mesh is called '{wish}': {there}");
        Err(ImportError::invalid(file, "", cause))
    }
}

/// Names are shown, and compared, up to so many characters.
const LONGEST: usize = 64;

fn shortened(name: &str) -> String {
    name.chars().take(LONGEST).collect()
}

/// Whether a name is the wish, in which `*` stands for any characters.
fn fits(wish: &str, name: &str) -> bool {
    if wish == name {
        return true;
    }
    let Some((head, rest)) = wish.split_once('*') else { return false };
    let Some(mut left) = name.strip_prefix(head) else { return false };
    let mut pieces = rest.split('*').collect::<Vec<_>>();
    // The last piece has to be at the end, the others anywhere one after the other.
    let tail = pieces.pop().unwrap_or_default();
    for piece in pieces {
        match left.find(piece) {
            Some(at) => left = &left[at + piece.len()..],
            None => return false,
        }
    }
    left.ends_with(tail)
}

/// How many characters have to be changed, put in or taken out to make one name of the other, whatever their case
/// (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let lower = |s: &str| s.chars().take(LONGEST).flat_map(char::to_lowercase).collect::<Vec<_>>();
    let (a, b) = (lower(a), lower(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut corner = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let changed = corner + usize::from(x != y);
            corner = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(corner + 1);
        }
    }
    row[b.len()]
}

impl SceneDesc {
    /// Keeps only what is called so: instances by their own name or that of their mesh, geometries by theirs. Nothing
    /// else changes.
    ///
    /// # Errors
    /// If a name is nowhere.
    pub(crate) fn keep_only(&mut self, wishes: &[String], file: &Path) -> Result<(), ImportError> {
        let Some(mut choice) = Choice::new(wishes) else { return Ok(()) };
        let mut whole = vec![false; self.meshes.len()];
        let mut parts: Vec<Vec<bool>> = Vec::new();
        for (whole, mesh) in whole.iter_mut().zip(&self.meshes) {
            *whole = choice.takes([mesh.name.as_str()]);
            parts.push(mesh.geometries.iter().map(|g| choice.takes([g.name.as_str()])).collect());
        }
        // A mesh that one instance shows as a whole keeps its parts, also where another is not asked for by name.
        let (mut entire, mut kept) = (whole.clone(), vec![false; self.meshes.len()]);
        self.instances.retain(|instance| {
            let named = choice.takes([instance.name.as_str()]);
            entire[instance.mesh] |= named;
            let some = named || whole[instance.mesh] || parts[instance.mesh].contains(&true);
            kept[instance.mesh] |= some;
            some
        });
        for (m, mesh) in self.meshes.iter_mut().enumerate().filter(|(m, _)| kept[*m] && !entire[*m]) {
            let mut wanted = parts[m].iter();
            mesh.geometries.retain(|_| wanted.next().copied().unwrap_or(false));
        }
        choice.finish(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_characters() {
        for (wish, name) in [
            ("a", "a"),
            ("a*", "a"),
            ("a*", "abc"),
            ("*c", "abc"),
            ("a*c", "abc"),
            ("*", "x"),
            ("a*b*c", "axbxc"),
            ("*b*", "abc"),
        ] {
            assert!(fits(wish, name), "{wish} {name}");
        }
        for (wish, name) in [("a", "A"), ("a", "ab"), ("a*b", "a"), ("ab*ba", "aba"), ("*x*", "abc"), ("a*b*c", "acb")]
        {
            assert!(!fits(wish, name), "{wish} {name}");
        }
    }

    #[test]
    fn a_wish_that_does_not_come_true_names_what_is_near() {
        let wishes = ["wheel_front".to_owned()];
        let mut choice = Choice::new(&wishes).unwrap();
        assert!(!choice.takes(["body", "Wheel.Front", "wheel_rear"]));
        let error = choice.finish(Path::new("a.obj")).unwrap_err().to_string();
        let expected = "a.obj: no object, group, node or mesh is called 'wheel_front': there are 'Wheel.Front', \
                        'wheel_rear', 'body'";
        assert_eq!(error, expected);
        assert!(Choice::new(&[]).is_none());
    }
}
