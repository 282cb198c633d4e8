//! Matrices that turn with the drum: trigonometric polynomials in theta, only their nonzero terms.

use crate::spin::SpinState;
use lane_ode::{Lane, N, Real};

/// Harmonics 0 to 2: 1, cos, sin, cos 2, sin 2.
pub(crate) const HARMONICS: usize = 5;
/// Each harmonic times 1, theta'^2, theta'' and theta'.
pub(crate) const BASIS: usize = 4 * HARMONICS;

/// What a harmonic is multiplied by.
#[derive(Clone, Copy)]
pub(crate) enum Factor {
    One = 0,
    SpeedSquared = 1,
    Acceleration = 2,
    Speed = 3,
}

/// One term: coefficient times basis function, added to an entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Term {
    /// Entry and basis function; terms are sorted by it.
    pub(crate) key: (u16, u16),
    pub(crate) coefficient: f64,
}

/// Angles at which a polynomial of harmonics 0 to 2 is sampled: cos and sin of 2 pi k / 5.
pub(crate) const SAMPLES: [(f64, f64); HARMONICS] = [
    (1.0, 0.0),
    (0.309_016_994_374_947_45, 0.951_056_516_295_153_5),
    (-0.809_016_994_374_947_5, 0.587_785_252_292_473_1),
    (-0.809_016_994_374_947_5, -0.587_785_252_292_473_1),
    (0.309_016_994_374_947_45, -0.951_056_516_295_153_5),
];

/// Coefficients of 1, cos, sin, cos 2, sin 2 from values at [`SAMPLES`].
pub(crate) fn coefficients(values: [f64; HARMONICS]) -> [f64; HARMONICS] {
    let mut c = [0.0; HARMONICS];
    for (k, value) in values.into_iter().enumerate() {
        let (cos, sin) = SAMPLES[k];
        let (cos_2, sin_2) = SAMPLES[2 * k % HARMONICS];
        for (c, basis) in c.iter_mut().zip([0.5, cos, sin, cos_2, sin_2]) {
            *c = (0.4 * value).mul_add(basis, *c);
        }
    }
    c
}

/// Below this share of the largest coefficient of its kind a term is the sampling's rounding, not physics.
const NOISE: f64 = 1e-13;

/// Adds the terms of a group of entries of one kind, from their values at [`SAMPLES`]; rounding noise is left out.
pub(crate) fn push_terms(
    terms: &mut Vec<Term>,
    first_entry: usize,
    factor: Factor,
    samples: impl Iterator<Item = [f64; HARMONICS]>,
) {
    let start = terms.len();
    for (entry, values) in samples.enumerate() {
        for (harmonic, coefficient) in coefficients(values).into_iter().enumerate() {
            let key = ((first_entry + entry) as u16, (factor as usize * HARMONICS + harmonic) as u16);
            terms.push(Term { key, coefficient });
        }
    }
    let largest = terms[start..].iter().fold(0.0_f64, |m, t| m.max(t.coefficient.abs()));
    let mut index = 0;
    terms.retain(|term| {
        index += 1;
        index <= start || term.coefficient.abs() > NOISE * largest
    });
}

/// Most terms that one entry can have: there are no more functions in any basis.
const MOST_TERMS: usize = 33;

/// The union of all lanes' terms, with zeros where a lane has none: a zero term leaves a sum as it was, so that a lane does not
/// feel its neighbours.
///
/// Entries are kept by their number of terms, so that each loop over terms has a constant length.
#[derive(Clone, Debug)]
pub(crate) struct TermLanes<T> {
    zero: N<T>,
    /// Where the term of each key stands, if it does.
    places: Vec<Option<u16>>,
    /// Entries in the order of their sums, and how many have 0, 1, 2, ... terms.
    entries: Vec<u16>,
    with_terms: [usize; MOST_TERMS + 1],
    /// Basis function and coefficient of each term, in that order.
    functions: Vec<u16>,
    coefficients: Vec<N<T>>,
    lanes: Vec<Vec<Term>>,
}

impl<T: Lane> TermLanes<T> {
    /// The same terms in every lane.
    pub(crate) fn splat(zero: N<T>, terms: &[Term]) -> Self {
        let mut lanes = Self {
            zero,
            places: Vec::new(),
            entries: Vec::new(),
            with_terms: [0; MOST_TERMS + 1],
            functions: Vec::new(),
            coefficients: Vec::new(),
            lanes: vec![terms.to_vec(); T::LANES],
        };
        lanes.rebuild();
        lanes
    }

    /// Puts another set of terms into one lane.
    pub(crate) fn set_lane(&mut self, lane: usize, terms: &[Term]) {
        self.lanes[lane].clear();
        self.lanes[lane].extend_from_slice(terms);
        if terms.iter().all(|term| self.place(term.key).is_some()) {
            self.fill(lane);
        } else {
            self.rebuild();
        }
    }

    /// Where the term of this key stands.
    fn place(&self, key: (u16, u16)) -> Option<usize> {
        self.places.get(flat(key)).copied().flatten().map(usize::from)
    }

    fn rebuild(&mut self) {
        let mut keys: Vec<_> = self.lanes.iter().flatten().map(|term| term.key).collect();
        keys.sort_unstable();
        keys.dedup();
        let mut by_entry: Vec<&[(u16, u16)]> = keys.chunk_by(|a, b| a.0 == b.0).collect();
        by_entry.sort_by_key(|terms| terms.len());
        self.with_terms = [0; MOST_TERMS + 1];
        by_entry.iter().for_each(|terms| self.with_terms[terms.len()] += 1);
        self.entries = by_entry.iter().map(|terms| terms[0].0).collect();
        let ordered = by_entry.concat();
        self.places = vec![None; keys.last().map_or(0, |&(entry, _)| flat((entry + 1, 0)))];
        (0..).zip(&ordered).for_each(|(place, &key)| self.places[flat(key)] = Some(place));
        self.functions = ordered.iter().map(|key| key.1).collect();
        self.coefficients.clear();
        self.coefficients.resize(ordered.len(), self.zero);
        (0..T::LANES).for_each(|lane| self.fill(lane));
    }

    fn fill(&mut self, lane: usize) {
        self.coefficients.iter_mut().for_each(|c| c.0.set(lane, 0.0));
        for i in 0..self.lanes[lane].len() {
            let term = self.lanes[lane][i];
            if let Some(place) = self.place(term.key) {
                self.coefficients[place].0.set(lane, term.coefficient);
            }
        }
    }

    /// For each entry that has terms, the sum of coefficient times basis function, in each of `W` sets of basis functions. Other
    /// entries stay as they are.
    #[inline(always)]
    pub(crate) fn sum<const ENTRIES: usize, const B: usize, const W: usize>(
        &self,
        basis: &[[N<T>; W]; B],
        sums: &mut [[N<T>; W]; ENTRIES],
    ) {
        let mut rest =
            Rest { entries: &self.entries, functions: &self.functions, coefficients: &self.coefficients };
        for terms in 1..=MOST_TERMS {
            let entries = self.with_terms[terms];
            if entries == 0 {
                continue;
            }
            // Lengths known when compiling are unrolled.
            match terms {
                1 => rest.sum(1, entries, basis, sums),
                2 => rest.sum(2, entries, basis, sums),
                3 => rest.sum(3, entries, basis, sums),
                4 => rest.sum(4, entries, basis, sums),
                5 => rest.sum(5, entries, basis, sums),
                6 => rest.sum(6, entries, basis, sums),
                7 => rest.sum(7, entries, basis, sums),
                8 => rest.sum(8, entries, basis, sums),
                _ => rest.sum(terms, entries, basis, sums),
            }
        }
    }
}

/// A key as an index.
fn flat((entry, function): (u16, u16)) -> usize {
    usize::from(entry) * MOST_TERMS + usize::from(function)
}

/// What of the terms is still to be summed.
struct Rest<'a, T> {
    entries: &'a [u16],
    functions: &'a [u16],
    coefficients: &'a [N<T>],
}

impl<T: Lane> Rest<'_, T> {
    /// The next `count` entries, which have `terms` terms each.
    #[inline(always)]
    fn sum<const ENTRIES: usize, const B: usize, const W: usize>(
        &mut self,
        terms: usize,
        count: usize,
        basis: &[[N<T>; W]; B],
        sums: &mut [[N<T>; W]; ENTRIES],
    ) {
        for _ in 0..count {
            let (functions, later_functions) = self.functions.split_at(terms);
            let (coefficients, later_coefficients) = self.coefficients.split_at(terms);
            let Some((&entry, later_entries)) = self.entries.split_first() else { return };
            let mut sum = basis[usize::from(functions[0])];
            for w in 0..W {
                sum[w] = (coefficients[0] * sum[w]).v();
            }
            for k in 1..terms {
                let function = &basis[usize::from(functions[k])];
                for w in 0..W {
                    sum[w] += coefficients[k] * function[w];
                }
            }
            sums[usize::from(entry)] = sum;
            *self =
                Rest { entries: later_entries, functions: later_functions, coefficients: later_coefficients };
        }
    }
}

/// All basis functions at one instant.
#[inline(always)]
pub(crate) fn basis<T: Real>(spin: &SpinState<T>) -> [[N<T>; 1]; BASIS] {
    let one = spin.cos.lit(1.0);
    let harmonics = [one, spin.cos, spin.sin, spin.cos_2, spin.sin_2];
    let factors = [one, (spin.speed * spin.speed).v(), spin.acceleration, spin.speed];
    let mut functions = [[one]; BASIS];
    for (i, function) in functions.iter_mut().enumerate() {
        *function = [(factors[i / HARMONICS] * harmonics[i % HARMONICS]).v()];
    }
    functions
}
