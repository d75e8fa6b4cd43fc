//! Whether a mesh is closed: looked at here apart from the library.

use std::collections::HashMap;

use firsthit_measure::mesh::Mesh;

/// How the triangles meet at edges; vertices are one where their positions are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Edges.
    pub all: usize,
    /// Edges of an odd number of triangles: there the surface ends.
    pub ends: usize,
    /// Edges through which not as many triangles run one way as the other.
    pub turned: usize,
    /// Edges of more than two triangles.
    pub crowded: usize,
    /// Triangles of which two corners coincide: they are left out.
    pub collapsed: usize,
}

impl Edges {
    /// Counts them.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        let mut ids = HashMap::new();
        // -0 is 0.
        let key = |i: u32| mesh.positions[i as usize].to_array().map(|x| (x + 0.0).to_bits());
        let mut id = |i: u32| {
            let next = ids.len();
            *ids.entry(key(i)).or_insert(next)
        };
        let mut edges = Self::default();
        let mut runs: HashMap<[usize; 2], [usize; 2]> = HashMap::new();
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(&mut id);
            if a == b || b == c || c == a {
                edges.collapsed += 1;
                continue;
            }
            for (from, to) in [(a, b), (b, c), (c, a)] {
                runs.entry([from.min(to), from.max(to)]).or_default()[usize::from(from < to)] += 1;
            }
        }
        edges.all = runs.len();
        for [down, up] in runs.into_values() {
            edges.ends += (down + up) % 2;
            edges.turned += usize::from(down != up && (down + up).is_multiple_of(2));
            edges.crowded += usize::from(down + up > 2);
        }
        edges
    }

    /// Whether the surface ends nowhere and its triangles agree about what is outside.
    #[must_use]
    pub fn closed(&self) -> bool {
        self.ends == 0 && self.turned == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use firsthit_measure::mesh::icosphere;

    #[test]
    fn edges_are_counted() {
        let mut ball = icosphere(2);
        assert!(Edges::new(&ball).closed() && Edges::new(&ball).all == 480);
        ball.triangles[7].swap(0, 1);
        assert_eq!((Edges::new(&ball).ends, Edges::new(&ball).turned), (0, 3));
        ball.triangles.remove(7);
        assert_eq!((Edges::new(&ball).ends, Edges::new(&ball).turned), (3, 0));
    }
}
