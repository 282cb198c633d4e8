//! Level lines of values on a grid by marching squares. No line crosses an unknown value.

use std::collections::BTreeMap;

/// A node of the grid: its index along x and along y.
type GridNode = (usize, usize);

/// An edge of the grid that a line can cross: a side of a square or its diagonal. The first node
/// lies farther left, or below at the same x. The second is kept as (y, x), so that the edges of a
/// node are ordered: along x, along y, up to the right.
type GridEdge = (GridNode, (usize, usize));

/// Returns the edge between two nodes.
fn edge_between(a: GridNode, b: GridNode) -> GridEdge {
    let (first, (x, y)) = (a.min(b), a.max(b));
    (first, (y, x))
}

/// Returns the lines on which `value` is zero, as points `[x, y]`; a closed line ends at its first
/// point.
///
/// `value(i, j)` is taken at `xs[i]`, `ys[j]`; it is linear between nodes. At a node that is not
/// finite the four squares around it are reduced to the triangle of their other corners; a square
/// with two unknown corners or more has no line. A value of exactly zero counts as positive.
pub fn zero_lines(
    xs: &[f64],
    ys: &[f64],
    value: impl Fn(usize, usize) -> f64,
) -> Vec<Vec<[f64; 2]>> {
    let mut crossings: BTreeMap<GridEdge, [f64; 2]> = BTreeMap::new();
    let mut linked_edges: BTreeMap<GridEdge, Vec<GridEdge>> = BTreeMap::new();
    for i in 0..xs.len().saturating_sub(1) {
        for j in 0..ys.len().saturating_sub(1) {
            for (from, to) in segments_in_square(i, j, &value) {
                for edge in [from, to] {
                    crossings.entry(edge).or_insert_with(|| find_crossing(edge, xs, ys, &value));
                }
                linked_edges.entry(from).or_default().push(to);
                linked_edges.entry(to).or_default().push(from);
            }
        }
    }
    let to_line = |edges: Vec<GridEdge>| edges.iter().map(|edge| crossings[edge]).collect();
    join_segments(&mut linked_edges).into_iter().map(to_line).collect()
}

/// Returns the line segments within a square, each from edge to edge.
fn segments_in_square(
    i: usize,
    j: usize,
    value_at: &impl Fn(usize, usize) -> f64,
) -> Vec<(GridEdge, GridEdge)> {
    // The corners run counter-clockwise from the lower left.
    let nodes = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
    let corner_values = nodes.map(|(i, j)| value_at(i, j));
    let is_above = corner_values.map(|corner| corner >= 0.0);
    let known_corners: Vec<usize> = (0..4).filter(|&k| corner_values[k].is_finite()).collect();
    if known_corners.len() < 3 {
        return Vec::new();
    }
    let square_sides = (0..known_corners.len())
        .map(|k| (known_corners[k], known_corners[(k + 1) % known_corners.len()]));
    let crossed_sides = square_sides.filter(|&(from, to)| is_above[from] != is_above[to]);
    let crossed_sides: Vec<GridEdge> =
        crossed_sides.map(|(from, to)| edge_between(nodes[from], nodes[to])).collect();
    match crossed_sides[..] {
        [from, to] => vec![(from, to)],
        [a, b, c, d] => {
            // At a saddle the mean of the corners decides which pair of opposite corners is
            // connected; the other corners are cut off.
            let is_middle_above = corner_values.iter().sum::<f64>() >= 0.0;
            if is_above[0] == is_middle_above { vec![(a, b), (c, d)] } else { vec![(d, a), (b, c)] }
        }
        _ => Vec::new(),
    }
}

fn find_crossing(
    (from, (y, x)): GridEdge,
    xs: &[f64],
    ys: &[f64],
    value_at: &impl Fn(usize, usize) -> f64,
) -> [f64; 2] {
    let start_value = value_at(from.0, from.1);
    let end_value = value_at(x, y);
    let fraction = start_value / (start_value - end_value);
    [xs[from.0] + fraction * (xs[x] - xs[from.0]), ys[from.1] + fraction * (ys[y] - ys[from.1])]
}

/// Joins segments into lines; open lines come first, from one of their ends.
fn join_segments(linked_edges: &mut BTreeMap<GridEdge, Vec<GridEdge>>) -> Vec<Vec<GridEdge>> {
    let line_ends: Vec<GridEdge> =
        linked_edges.iter().filter(|(_, next)| next.len() == 1).map(|(&edge, _)| edge).collect();
    let edges: Vec<GridEdge> = linked_edges.keys().copied().collect();
    let mut lines = Vec::new();
    for start in line_ends.into_iter().chain(edges) {
        let mut line = vec![start];
        let mut current_edge = start;
        while let Some(next) = linked_edges.get_mut(&current_edge).and_then(Vec::pop) {
            if let Some(links_back) = linked_edges.get_mut(&next)
                && let Some(index) = links_back.iter().position(|&edge| edge == current_edge)
            {
                links_back.remove(index);
            }
            line.push(next);
            current_edge = next;
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

/// Maximum number of points of level lines in a figure. Basis: a figure of a few megabytes.
/// Doubling it doubles the size of figures with ragged boundaries.
pub(crate) const MAX_LINE_POINTS: usize = 100_000;

/// Removes the shortest lines of all cuts until at most `max_points` points are left.
pub(crate) fn remove_shortest_lines(lines: &mut [Vec<Vec<[f64; 2]>>], max_points: usize) {
    let mut lengths: Vec<usize> = lines.iter().flatten().map(Vec::len).collect();
    lengths.sort_unstable_by(|a, b| b.cmp(a));
    let mut points = 0;
    let kept_count = lengths.iter().take_while(|length| {
        points += **length;
        points <= max_points
    });
    let kept_count = kept_count.count();
    if let Some(longest_left_out) = lengths.get(kept_count) {
        for cut in lines {
            cut.retain(|line| line.len() > *longest_left_out);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers_below(count: usize) -> Vec<f64> {
        (0..count).map(|k| k as f64).collect()
    }

    #[test]
    fn the_level_line_of_a_plane_is_straight() {
        let found_lines = zero_lines(&numbers_below(6), &numbers_below(5), |i, j| {
            2.0 * i as f64 + j as f64 - 5.5
        });
        assert_eq!(found_lines.len(), 1);
        assert!(found_lines[0].iter().all(|[x, y]| (2.0 * x + y - 5.5).abs() < 1e-12));
        let is_on_border = |[x, y]: [f64; 2]| x == 0.0 || x == 5.0 || y == 0.0 || y == 4.0;
        assert!(is_on_border(found_lines[0][0]) && is_on_border(*found_lines[0].last().unwrap()));
    }

    #[test]
    fn a_line_around_one_node_is_closed() {
        let found_lines = zero_lines(&numbers_below(5), &numbers_below(5), |i, j| {
            if (i, j) == (2, 2) { 1.0 } else { -1.0 }
        });
        assert_eq!(found_lines.len(), 1);
        assert_eq!(found_lines[0].len(), 5);
        assert_eq!(found_lines[0].first(), found_lines[0].last());
    }

    #[test]
    fn the_two_lines_of_a_saddle_do_not_meet() {
        let saddle_corners = [[1.0, -1.0], [-1.0, 3.0]];
        let found_lines =
            zero_lines(&numbers_below(2), &numbers_below(2), |i, j| saddle_corners[i][j]);
        // The mean of the corners is positive, so that the positive corners are connected and the
        // negative ones cut off.
        assert_eq!(found_lines.len(), 2);
        for line in found_lines {
            let cut_off = if line[0][0] + line[1][0] > line[0][1] + line[1][1] {
                [1.0, 0.0]
            } else {
                [0.0, 1.0]
            };
            for [x, y] in line {
                assert!(x == cut_off[0] || y == cut_off[1]);
            }
        }
    }

    #[test]
    fn no_line_is_drawn_beside_unknown_values() {
        let is_unknown = |i: usize, j: usize| (i, j) == (2, 1) || (i, j) == (2, 2);
        let value_at =
            |i: usize, j: usize| if is_unknown(i, j) { f64::NAN } else { i as f64 - 1.5 };
        let found_lines = zero_lines(&numbers_below(5), &numbers_below(6), value_at);
        assert!(found_lines.iter().flatten().all(|point| point.iter().all(|c| c.is_finite())));
        assert!(found_lines.iter().flatten().all(|[_, y]| *y <= 0.5 || *y >= 3.0 - 0.5));
        let total_extent: f64 =
            found_lines.iter().map(|line| (line[0][1] - line[line.len() - 1][1]).abs()).sum();
        assert!(
            total_extent > 1.9,
            "the line runs on where all corners are known: {found_lines:?}"
        );
    }

    #[test]
    fn a_value_at_the_level_belongs_to_the_upper_side() {
        let found_lines = zero_lines(&numbers_below(3), &numbers_below(2), |i, _| i as f64 - 1.0);
        assert_eq!(found_lines, [[[1.0, 0.0], [1.0, 1.0]]]);
    }

    #[test]
    fn the_shortest_lines_are_removed_first() {
        let line_with_points = |points: usize| vec![[0.0, 0.0]; points];
        let mut cuts = [
            vec![line_with_points(2), line_with_points(7)],
            vec![line_with_points(4), line_with_points(2)],
        ];
        remove_shortest_lines(&mut cuts, 12);
        assert_eq!(cuts, [vec![line_with_points(7)], vec![line_with_points(4)]]);
        remove_shortest_lines(&mut cuts, 11);
        assert_eq!(cuts.iter().flatten().count(), 2);
        remove_shortest_lines(&mut cuts, 3);
        assert_eq!(cuts.iter().flatten().count(), 0);
    }
}
