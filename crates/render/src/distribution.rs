//! Piecewise constant distributions, sampled by inverting their sums.
//!
//! The probability that is reported is the one that is sampled: it is read back from the rounded sums.

/// Chooses one of several cells in proportion to their weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution1D {
    /// Probability of all cells before the i-th; `cells + 1` entries from 0 to 1.
    sums: Vec<f32>,
}

impl Distribution1D {
    /// `None` where there is no positive finite total. Negative and NaN weights count as 0.
    #[must_use]
    pub fn new(weights: &[f32]) -> Option<Self> {
        let mut sums = vec![0.0; weights.len() + 1];
        (accumulate(weights, &mut sums) > 0.0).then_some(Self { sums })
    }

    /// How many cells there are.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.sums.len() - 1
    }

    /// The cell that `u` in [0, 1) falls into (never one of probability 0), and where in the cell, in [0, 1).
    #[inline]
    #[must_use]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        find(&self.sums, u)
    }

    /// The probability of a cell.
    #[inline]
    #[must_use]
    pub fn probability(&self, cell: usize) -> f32 {
        self.sums[cell + 1] - self.sums[cell]
    }
}

/// Chooses a cell of a table of rows in proportion to its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Distribution2D {
    rows: Distribution1D,
    /// The sums of each row, one after another.
    columns: Vec<f32>,
    width: usize,
}

impl Distribution2D {
    /// `None` where there is no positive finite total, or `weights` is not whole rows of `width` cells.
    #[must_use]
    pub fn new(weights: &[f32], width: usize) -> Option<Self> {
        if width == 0 || !weights.len().is_multiple_of(width) {
            return None;
        }
        let height = weights.len() / width;
        let mut columns = vec![0.0; height * (width + 1)];
        let totals: Vec<f32> = weights
            .chunks_exact(width)
            .zip(columns.chunks_exact_mut(width + 1))
            .map(|(row, sums)| accumulate(row, sums) as f32)
            .collect();
        Some(Self { rows: Distribution1D::new(&totals)?, columns, width })
    }

    /// The cell (column, row) that a point falls into, and where in the cell, in [0, 1)^2.
    #[inline]
    #[must_use]
    pub fn sample(&self, u: [f32; 2]) -> ((usize, usize), [f32; 2]) {
        let (row, y) = self.rows.sample(u[1]);
        let (column, x) = find(self.row(row), u[0]);
        ((column, row), [x, y])
    }

    /// The probability of a cell (column, row).
    #[inline]
    #[must_use]
    pub fn probability(&self, (column, row): (usize, usize)) -> f32 {
        let sums = self.row(row);
        self.rows.probability(row) * (sums[column + 1] - sums[column])
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.columns[row * (self.width + 1)..][..self.width + 1]
    }
}

/// Writes the normalised sums; the answer is the total, 0 if there is none.
fn accumulate(weights: &[f32], sums: &mut [f32]) -> f64 {
    let weight = |w: &f32| if *w > 0.0 { f64::from(*w) } else { 0.0 };
    let total: f64 = weights.iter().map(weight).sum();
    if !(total > 0.0 && total.is_finite()) {
        return 0.0;
    }
    let mut sum = 0.0;
    for (w, s) in weights.iter().zip(&mut sums[1..]) {
        sum += weight(w);
        // Where the rest is zero, `sum` is `total` bit by bit, and the quotient is 1.
        *s = (sum / total) as f32;
    }
    total
}

/// The last cell whose sum is not above `u`: where sums repeat, the one of positive probability.
fn find(sums: &[f32], u: f32) -> (usize, f32) {
    let u = u.clamp(0.0, 1.0 - f32::EPSILON / 2.0);
    let cell = sums.partition_point(|s| *s <= u) - 1;
    let (from, to) = (sums[cell], sums[cell + 1]);
    (cell, ((u - from) / (to - from)).min(1.0 - f32::EPSILON / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_as_often_as_they_weigh() {
        let d = Distribution1D::new(&[0.0, 1.0, 0.0, 3.0, 0.0]).unwrap();
        let n = 4096;
        let mut counts = [0; 5];
        for i in 0..n {
            counts[d.sample((i as f32 + 0.5) / n as f32).0] += 1;
        }
        assert_eq!(counts, [0, n / 4, 0, 3 * n / 4, 0]);
        assert_eq!([0, 1, 2, 3, 4].map(|i| d.probability(i)), [0.0, 0.25, 0.0, 0.75, 0.0]);
        assert_eq!(d.sample(0.125), (1, 0.5));
    }

    #[test]
    fn the_ends_of_the_interval_never_choose_a_cell_of_weight_zero() {
        let d = Distribution1D::new(&[0.0, 0.0, 2.0, 0.0]).unwrap();
        for u in [0.0, 0.5, 1.0 - f32::EPSILON / 2.0, 1.0, -1.0, 7.0] {
            let (cell, x) = d.sample(u);
            assert_eq!(cell, 2);
            assert!((0.0..1.0).contains(&x));
        }
    }

    #[test]
    fn what_cannot_be_sampled_is_refused() {
        assert_eq!(Distribution1D::new(&[]), None);
        assert_eq!(Distribution1D::new(&[0.0, -1.0, f32::NAN]), None);
        assert_eq!(Distribution1D::new(&[f32::INFINITY]), None);
        assert_eq!(Distribution2D::new(&[0.0; 6], 3), None);
        assert_eq!(Distribution2D::new(&[1.0; 7], 3), None);
        assert_eq!(Distribution2D::new(&[], 0), None);
    }

    #[test]
    fn two_dimensions_agree_with_the_weights() {
        let weights = [0.0, 1.0, 2.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 4.0, 0.0];
        let d = Distribution2D::new(&weights, 3).unwrap();
        for (i, w) in weights.iter().enumerate() {
            assert!((d.probability((i % 3, i / 3)) - w / 16.0).abs() < 1e-7);
        }
        for i in 0..32_u32 {
            for j in 0..32_u32 {
                let (cell, inside) = d.sample([(i as f32 + 0.5) / 32.0, (j as f32 + 0.5) / 32.0]);
                assert!(d.probability(cell) > 0.0);
                assert!(inside.iter().all(|x| (0.0..1.0).contains(x)));
            }
        }
    }
}
