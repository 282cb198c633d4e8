//! A batch of trials and what it costs: a lane group takes as long with one trial in it as with all
//! its lanes full.

use super::{Span, Want};

/// Trials that cost as much as one. Fixed, so that which trials are made depends neither on the
/// instruction set nor on the number of threads.
pub(super) const LANES: usize = 8;

/// What a batch costs.
pub(super) const fn lane_groups(trials: usize) -> usize {
    trials.div_ceil(LANES)
}

/// How many places each of these wants gets: what it needs, and of the places that fill up the last
/// lane group most go to the widest nets.
pub(super) fn deal(wants: &[&Want], span: &Span) -> Vec<usize> {
    let mut counts: Vec<usize> = wants.iter().map(|want| want.needed()).collect();
    let needed: usize = counts.iter().sum();
    for _ in needed..lane_groups(needed) * LANES {
        let width = |k: usize| match wants[k] {
            Want::Net(net) if !net.is_ample(counts[k], span) => Some(net.spread / counts[k] as f64),
            _ => None,
        };
        let widths = (0..wants.len()).filter_map(|k| Some((k, width(k)?)));
        let widest = widths.reduce(|most, next| if next.1 > most.1 { next } else { most });
        let Some((k, _)) = widest else { break };
        counts[k] += 1;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::super::net::Net;
    use super::*;

    const SPAN: Span = Span { least: 0.0, greatest: 100.0, tolerance: 1.0 };

    #[test]
    fn what_fills_the_last_group_goes_to_the_widest_net() {
        let wide = Want::Net(Net::even(0.0, 100.0));
        let half = Want::Net(Net::even(0.0, 50.0));
        let sure = Want::Net(Net { from: 0.0, to: 50.0, root: 25.0, spread: 0.1, least: 2 });
        let counts = deal(&[&half, &Want::At(3.0), &wide, &sure], &SPAN);
        assert_eq!((counts.iter().sum::<usize>(), counts[1], counts[3]), (LANES, 1, 2));
        assert_eq!((counts[0], counts[2]), (2, 3), "a net twice as wide gets twice as many");
    }

    #[test]
    fn no_group_is_begun_for_its_own_sake() {
        let places = vec![Want::At(1.0); LANES];
        assert_eq!(deal(&places.iter().collect::<Vec<_>>(), &SPAN), vec![1; LANES]);
        // Nothing to widen: the lanes stay empty.
        assert_eq!(deal(&[&Want::At(1.0)], &SPAN), [1]);
        assert_eq!(deal(&[], &SPAN), [0; 0]);
    }
}
