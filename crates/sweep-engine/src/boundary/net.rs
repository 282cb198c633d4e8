//! Nets: trial places on both sides of an expected change of side. They are so close together that
//! they catch a bracket within tolerance, or so far apart that they catch one for certain.

use super::span::Span;

/// Neighbouring places of the closest net are this far from each other, in tolerances: a little
/// less than one, so that the bracket they make is within tolerance whatever is rounded.
const MESH: f64 = 0.9;
/// A place beside an end of the bracket is this far from it, in tolerances.
const MARGIN: f64 = 0.945;
/// A root this close to an end of the bracket, in tolerances, is caught by one place beyond it.
const CLOSE: f64 = 0.6;
/// A spread of more than this part of the bracket does not say where in it the root is.
const VAGUE: f64 = 0.2;
/// A single place is this far from the expected root, in tolerances: what lies at its limit is
/// the dearest to make sure of.
const ASIDE: f64 = 0.45;
/// A net whose mesh reaches so many times as far as the root is expected to stray needs no more.
const AMPLE: f64 = 4.0;
/// No root is expected to stray less than this, in tolerances.
const LEAST_STRAY: f64 = 0.2;
/// Distances beyond one say which side a value is on, and little more: a ratio saturates.
const SATURATED: f64 = 1.0;

/// A stretch in which the side changes, and where that is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Net {
    /// Lower end of the stretch.
    pub from: f64,
    /// Its upper end.
    pub to: f64,
    /// Where in it the side should change.
    pub root: f64,
    /// How far from there it may be.
    pub spread: f64,
    /// Places that the net needs at least.
    pub least: usize,
}

impl Net {
    /// A net without an expected place in the stretch.
    pub(super) fn even(from: f64, to: f64) -> Self {
        Self { from, to, root: 0.5 * (from + to), spread: 0.5 * (to - from), least: 1 }
    }

    fn width(&self) -> f64 {
        self.to - self.from
    }

    /// Whether more places than these would hardly help: what they catch is within tolerance
    /// already, wherever the root may be.
    pub(super) fn is_ample(&self, places: usize, span: &Span) -> bool {
        let caught = places.saturating_sub(1) as f64 * MESH * span.tolerance;
        let spread = self.spread.max(LEAST_STRAY * span.tolerance);
        (places + 1) as f64 * span.tolerance >= self.width() || caught >= AMPLE * spread
    }

    /// The net with this many places, in order.
    pub(super) fn places(&self, count: usize, span: &Span) -> Vec<f64> {
        let (width, margin) = (self.width(), MARGIN * span.tolerance);
        let gaps = count.saturating_sub(1) as f64;
        // The root is expected in the middle of a mesh, never at a place: of an odd number, one
        // more stands on the side that has more room.
        let is_odd = count % 2 == 1;
        let meshes = if is_odd { gaps - 1.0 } else { gaps };
        let mesh = (2.0 * self.spread / meshes.max(1.0)).max(MESH * span.tolerance);
        let has_room_above = self.to - self.root > self.root - self.from;
        let reach = mesh * gaps;
        let finishes = width <= (count + 1) as f64 * span.tolerance;
        let is_vague = count > 1 && self.spread > VAGUE * width;
        if finishes || is_vague || reach + margin > width {
            let mesh = 1.0 / (count + 1) as f64;
            return (1..=count).map(|k| self.from + width * (k as f64 * mesh)).collect();
        }
        let close = CLOSE * span.tolerance;
        let first = if count > 1 {
            let shift = match (is_odd, has_room_above) {
                (false, _) => 0.0,
                (true, true) => 0.5 * mesh,
                (true, false) => -0.5 * mesh,
            };
            let first = self.root - 0.5 * reach + shift;
            first.min(self.to - margin - reach).max(self.from + margin)
        } else if self.root - self.from <= close {
            self.from + margin
        } else if self.to - self.root <= close {
            self.to - margin
        } else if has_room_above {
            self.root + ASIDE * span.tolerance
        } else {
            self.root - ASIDE * span.tolerance
        };
        (0..count).map(|k| first + mesh * k as f64).collect()
    }
}

/// Where the side should change between two places, by the samples around them (in order), and how
/// far that may be off; `None` if they do not tell.
pub(super) fn estimate(around: &[(f64, f64)], from: f64, to: f64) -> Option<(f64, f64)> {
    let is_inside = |root: &f64| from < *root && *root < to;
    let mut near: Vec<(f64, f64)> =
        around.iter().copied().filter(|(_, distance)| distance.abs() < SATURATED).collect();
    near.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    if let [(x0, y0), (x1, y1), ..] = near[..] {
        let secant = x0 - y0 * (x1 - x0) / (y1 - y0);
        if is_inside(&secant) {
            if let Some(root) = inverse(&near).filter(is_inside) {
                return Some((root, 0.5 * (root - secant).abs()));
            }
            let nearest = (secant - from).min(to - secant).min((secant - x0).abs());
            return Some((secant, 0.5 * nearest));
        }
    }
    // The straight line between the ends, if both were tried.
    let tried = |end: f64| around.iter().find(|(at, _)| *at == end);
    let distance = |end: f64| tried(end).map(|(_, distance)| *distance);
    let [a, b] = [distance(from)?, distance(to)?].map(|d| d.clamp(-SATURATED, SATURATED));
    let root = from + (to - from) * (a / (a - b));
    is_inside(&root).then_some((root, VAGUE * (to - from)))
}

/// The root of the parabola through the three samples nearest to the limit, with the distance as
/// its variable; `None` unless they rise or fall all along.
fn inverse(near: &[(f64, f64)]) -> Option<f64> {
    let &[a, b, c, ..] = near else { return None };
    let mut three = [a, b, c];
    three.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(x0, y0), (x1, y1), (x2, y2)] = three;
    let is_monotone = (y0 < y1 && y1 < y2) || (y0 > y1 && y1 > y2);
    let root = || {
        x0 * (y1 / (y0 - y1)) * (y2 / (y0 - y2))
            + x1 * (y0 / (y1 - y0)) * (y2 / (y1 - y2))
            + x2 * (y0 / (y2 - y0)) * (y1 / (y2 - y1))
    };
    is_monotone.then(root)
}

/// Something that a row wants tried.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Want {
    /// One place.
    At(f64),
    /// The places of a net.
    Net(Net),
}

impl Want {
    /// Places that it needs at least.
    pub(super) fn needed(&self) -> usize {
        match self {
            Self::At(_) => 1,
            Self::Net(net) => net.least,
        }
    }

    /// Its places, so many.
    pub(super) fn places(&self, count: usize, span: &Span) -> Vec<f64> {
        match self {
            Self::At(at) => vec![*at],
            Self::Net(net) => net.places(count, span),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };

    fn net(root: f64, spread: f64) -> Net {
        Net { from: 10.0, to: 50.0, root, spread, least: 2 }
    }

    #[test]
    fn two_places_around_a_sure_root_make_the_bracket() {
        let places = net(30.0, 0.1).places(2, &SPAN);
        assert!(places[0] < 30.0 && 30.0 < places[1] && places[1] - places[0] <= 1.0, "{places:?}");
        assert_eq!(net(10.3, 0.1).places(1, &SPAN), [10.945]);
        assert_eq!(net(49.7, 0.1).places(1, &SPAN), [49.055]);
        // Beside an end, the end is one side of the net.
        let beside = net(10.8, 0.1).places(2, &SPAN);
        assert!(beside[0] - 10.0 <= 1.0 && beside[1] - beside[0] <= 1.0, "{beside:?}");
    }

    #[test]
    fn more_places_reach_as_far_as_the_root_may_stray() {
        assert_eq!(net(30.0, 3.0).places(4, &SPAN), [27.0, 29.0, 31.0, 33.0]);
        assert_eq!(net(29.0, 3.0).places(5, &SPAN), [26.0, 28.0, 30.0, 32.0, 34.0]);
        assert_eq!(net(31.0, 3.0).places(5, &SPAN), [26.0, 28.0, 30.0, 32.0, 34.0]);
        // A vague root is not believed, and a narrow bracket is cut up at once.
        assert_eq!(net(30.0, 20.0).places(3, &SPAN), [20.0, 30.0, 40.0]);
        let narrow = Net { from: 10.0, to: 14.0, root: 13.0, spread: 0.5, least: 1 };
        assert_eq!(narrow.places(3, &SPAN), [11.0, 12.0, 13.0]);
    }

    #[test]
    fn no_place_is_where_the_root_is_expected() {
        for count in 1..=7 {
            let places = net(30.0, 0.4).places(count, &SPAN);
            let nearest = places.iter().map(|at| (at - 30.0).abs()).fold(f64::INFINITY, f64::min);
            assert!((nearest - 0.45).abs() < 1e-9, "{places:?}");
        }
    }

    #[test]
    fn every_net_lies_inside_its_stretch_in_order() {
        for count in 1..=16 {
            for k in 0..=40 {
                for spread in [0.0, 0.3, 2.0, 7.0, 30.0] {
                    let net = net(10.0 + f64::from(k), spread);
                    let places = net.places(count, &SPAN);
                    assert_eq!(places.len(), count);
                    let all: Vec<f64> = [10.0].into_iter().chain(places).chain([50.0]).collect();
                    assert!(all.is_sorted_by(|a, b| a < b), "{net:?} of {count}: {all:?}");
                }
            }
        }
    }

    #[test]
    fn the_estimate_is_exact_on_lines_and_parabolas_of_the_distance() {
        let line = [(0.0, 0.6), (1.0, 0.4), (4.0, -0.2), (5.0, -0.4)];
        let (root, spread) = estimate(&line, 1.0, 4.0).unwrap();
        assert!((root - 3.0).abs() < 1e-12 && spread < 1e-12);
        // x = 2 + d + d^2.
        let curved = [0.5, 0.2, -0.3].map(|d: f64| (2.0 + d + d * d, d));
        let curved = [curved[2], curved[1], curved[0]];
        let (root, spread) = estimate(&curved, curved[0].0, curved[1].0).unwrap();
        assert!((root - 2.0).abs() < 1e-12 && spread > 0.0);
        // Saturated ends only say where the middle is.
        let (root, spread) = estimate(&[(0.0, 30.0), (10.0, -1.0)], 0.0, 10.0).unwrap();
        assert_eq!((root, spread), (5.0, 2.0));
        assert_eq!(estimate(&[(0.0, 0.5)], 0.0, 10.0), None);
    }
}
