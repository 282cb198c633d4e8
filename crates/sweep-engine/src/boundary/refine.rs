//! Looks between samples of one side, where their distances hint at a change of side between them.

use super::{Net, Span, Tried, Want};

/// Distances below this are near the limit: neighbouring samples there should not differ by more
/// than [`STRIDE`].
const NEAR: f64 = 0.5;
/// A factor of 2 in a ratio.
const STRIDE: f64 = 0.693;
/// An extremum expected this close to the limit, or beyond it, is looked at.
const TOUCH: f64 = 0.05;

/// A place, and the distance there.
type Point = (f64, f64);

/// Where to look between and beyond these samples: where the distance changes fast near the limit,
/// where three samples make an extremum that may touch it, and beyond samples that point to it.
pub(super) fn around(samples: &[Tried], span: &Span) -> Vec<Want> {
    let points: Vec<Option<Point>> = samples.iter().map(Tried::finite).collect();
    let pairs = points.windows(2).filter_map(|pair| Some((pair[0]?, pair[1]?)));
    let threes = points.windows(3).filter_map(|three| Some((three[0]?, three[1]?, three[2]?)));
    let steep = pairs.filter(|(a, b)| is_steep(*a, *b, span));
    let steep = steep.map(|(a, b)| Want::Net(Net::even(a.0, b.0)));
    let touching = threes.filter_map(|(a, b, c)| extremum(a, b, c, span).map(Want::Net));
    let outermost = |last: usize, before: usize| {
        let last = (*points.get(last)?)?;
        let at = beyond(last, (*points.get(before)?)?, span)?.clamp(span.least, span.greatest);
        (at != last.0).then_some(Want::At(at))
    };
    let count = points.len();
    let upper = count.checked_sub(2).and_then(|before| outermost(count - 1, before));
    steep.chain(touching).chain(outermost(0, 1)).chain(upper).collect()
}

/// Whether the distance changes too fast near the limit to tell what is between.
fn is_steep(a: Point, b: Point, span: &Span) -> bool {
    let is_near = a.1.abs().min(b.1.abs()) < NEAR && (a.1 < 0.0) == (b.1 < 0.0);
    is_near && (a.1 - b.1).abs() > STRIDE && b.0 - a.0 > 4.0 * span.tolerance
}

/// A net for the extremum of the parabola through three samples of one side, if the middle one is
/// the closest to the limit and the parabola comes as close as [`TOUCH`].
fn extremum(a: Point, b: Point, c: Point, span: &Span) -> Option<Net> {
    let sign = b.1.signum();
    let [fa, fb, fc] = [sign * a.1, sign * b.1, sign * c.1];
    if fa < 0.0 || fc < 0.0 || fb > fa || fb > fc || fb >= NEAR {
        return None;
    }
    let (left, right) = ((fb - fa) / (b.0 - a.0), (fc - fb) / (c.0 - b.0));
    let curvature = (right - left) / (c.0 - a.0);
    if curvature <= 0.0 {
        return None;
    }
    let slope = (left * (c.0 - b.0) + right * (b.0 - a.0)) / (c.0 - a.0);
    let step = -0.5 * slope / curvature;
    if fb + 0.5 * slope * step >= TOUCH {
        return None;
    }
    // An extremum on top of a sample may be a kink in the wider gap beside it.
    let gap = if b.0 - a.0 > c.0 - b.0 { (a.0, b.0) } else { (b.0, c.0) };
    let apart = 0.5 * span.tolerance;
    let is_new = |at: &f64| [a, b, c].iter().all(|(other, _)| (other - at).abs() > apart);
    let deepest = (b.0 + step).clamp(a.0, c.0);
    let root = [deepest, 0.5 * (gap.0 + gap.1)].into_iter().find(is_new)?;
    Some(Net { from: a.0, to: c.0, root, spread: 0.25 * (c.0 - a.0), least: 1 })
}

/// A place beyond the outermost sample, if that and the one before it point to the limit.
fn beyond(last: Point, before: Point, span: &Span) -> Option<f64> {
    let (near, far) = (last.1.abs(), before.1.abs());
    let points = (last.1 < 0.0) == (before.1 < 0.0) && near < far && near < NEAR;
    let step = last.0 - before.0;
    let stride = 2.0 * step.abs().max(span.tolerance);
    (points && 2.0 * near - far < TOUCH).then_some(last.0 + stride.copysign(step))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };

    fn wants(samples: &[Point]) -> Vec<Want> {
        let sample = |&(at, distance): &Point| Tried { at, distance: Some(distance) };
        around(&samples.iter().map(sample).collect::<Vec<_>>(), &SPAN)
    }

    #[test]
    fn a_steep_fall_to_the_limit_is_cut() {
        let steep = wants(&[(10.0, 2.0), (20.0, 0.3)]);
        assert_eq!(steep[0], Want::Net(Net::even(10.0, 20.0)));
        // Far from the limit, or slowly, or within a few tolerances: nothing hides there.
        let calm = [(10.0, [2.6, 0.6]), (10.0, [0.6, 0.35]), (3.0, [2.0, 0.3])];
        for calm in calm.map(|(gap, [a, b])| [(10.0, a), (10.0 + gap, b)]) {
            let wants = wants(&calm);
            assert!(wants.iter().all(|want| matches!(want, Want::At(_))), "{calm:?}: {wants:?}");
        }
    }

    #[test]
    fn a_dip_towards_the_limit_is_sounded_where_it_should_be_deepest() {
        let dip = |at: f64| (at, 0.02 + 0.001 * (at - 31.0) * (at - 31.0));
        let sounded = wants(&[dip(20.0), dip(30.0), dip(40.0)]);
        let [Want::Net(net)] = sounded[..] else { panic!("{sounded:?}") };
        assert!((net.root - 31.0).abs() < 1e-9, "{net:?}");
        let shallow = |at: f64| (at, 0.2 + dip(at).1);
        assert_eq!(wants(&[shallow(20.0), shallow(30.0), shallow(40.0)]), []);
    }

    #[test]
    fn samples_that_point_to_the_limit_are_followed_in_growing_strides_to_the_end_of_the_range() {
        assert_eq!(wants(&[(40.0, 0.1), (41.0, 0.2)]), [Want::At(38.0)]);
        assert_eq!(wants(&[(80.0, 0.3), (90.0, 0.1)]), [Want::At(100.0)]);
        assert_eq!(wants(&[(90.0, 0.3), (100.0, 0.1)]), []);
    }
}
