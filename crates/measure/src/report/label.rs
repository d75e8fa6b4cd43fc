//! Names beside points, so that none hides another.

/// An upright rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn around(x: f64, y: f64, radius: f64) -> Self {
        Self { x: x - radius, y: y - radius, width: 2.0 * radius, height: 2.0 * radius }
    }

    /// Area of what is common.
    fn overlap(&self, other: &Self) -> f64 {
        let x = (self.x + self.width).min(other.x + other.width) - self.x.max(other.x);
        let y = (self.y + self.height).min(other.y + other.height) - self.y.max(other.y);
        x.max(0.0) * y.max(0.0)
    }

    fn area(&self) -> f64 {
        self.width * self.height
    }
}

/// Finds places for labels one by one: the first come, the nearest served.
#[derive(Debug)]
pub(super) struct Placer {
    frame: Rect,
    taken: Vec<Rect>,
}

impl Placer {
    /// Labels stay inside `frame` and off what is `taken`.
    pub(super) fn new(frame: Rect, taken: Vec<Rect>) -> Self {
        Self { frame, taken }
    }

    /// The place of a label for the point at (x, y): where it hides least, as near as can be.
    pub(super) fn place(&mut self, (x, y): (f64, f64), width: f64, height: f64) -> Rect {
        // Right first, as one reads; then above, below, left, the corners.
        const SIDES: [(f64, f64); 8] =
            [(1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (0.7, -0.8), (0.7, 0.8), (-0.7, -0.8), (-0.7, 0.8)];
        let mut best: Option<(f64, Rect)> = None;
        for distance in [8.0, 14.0, 22.0, 32.0, 44.0] {
            for (order, (sx, sy)) in SIDES.into_iter().enumerate() {
                let (cx, cy) = (x + sx * (distance + 0.5 * width), y + sy * (distance + 0.5 * height));
                let rect = Rect { x: cx - 0.5 * width, y: cy - 0.5 * height, width, height };
                let outside = rect.area() - rect.overlap(&self.frame);
                let hidden: f64 = self.taken.iter().map(|t| t.overlap(&rect)).sum();
                let cost = 10.0 * outside + hidden + 0.05 * distance + 0.01 * order as f64;
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, rect));
                }
            }
        }
        let rect = best.map_or(Rect { x, y, width, height }, |(_, rect)| rect);
        self.taken.push(rect);
        rect
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_with_room_stands_to_the_right() {
        let frame = Rect { x: 0.1, y: 0.1, width: 400.0, height: 300.0 };
        for i in 1..100 {
            let (x, y) = (3.37 * f64::from(i), 40.0 + 2.13 * f64::from(i));
            let label = Placer::new(frame, vec![Rect::around(x, y, 6.0)]).place((x, y), 33.4, 12.0);
            assert!(label.x > x, "{label:?}");
        }
    }

    #[test]
    fn labels_of_crowded_points_do_not_overlap() {
        let frame = Rect { x: 0.0, y: 0.0, width: 400.0, height: 300.0 };
        let points: Vec<_> = (0..10).map(|i| (200.0 + 3.0 * f64::from(i), 150.0)).collect();
        let marks: Vec<_> = points.iter().map(|&(x, y)| Rect::around(x, y, 4.0)).collect();
        let mut placer = Placer::new(frame, marks.clone());
        let labels: Vec<_> = points.iter().map(|&p| placer.place(p, 10.0, 12.0)).collect();
        for (i, a) in labels.iter().enumerate() {
            assert_eq!(a.overlap(&frame), a.area(), "{i} is inside");
            assert!(labels[..i].iter().chain(&marks).all(|b| a.overlap(b) == 0.0), "{i} hides nothing");
        }
    }
}
