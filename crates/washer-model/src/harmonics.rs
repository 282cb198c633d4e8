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

/// The union of all lanes' terms, with zeros where a lane has none: a zero term leaves a sum as it was, so that a lane does not
/// feel its neighbours.
#[derive(Clone, Debug)]
pub(crate) struct TermLanes<T> {
    zero: N<T>,
    keys: Vec<(u16, u16)>,
    /// How many terms each entry has, and the basis function of each.
    counts: Vec<u16>,
    functions: Vec<u16>,
    coefficients: Vec<N<T>>,
    lanes: Vec<Vec<Term>>,
}

impl<T: Lane> TermLanes<T> {
    /// The same terms in every lane; sums have `entries` entries.
    pub(crate) fn splat(zero: N<T>, terms: &[Term], entries: usize) -> Self {
        let mut lanes = Self {
            zero,
            keys: Vec::new(),
            counts: vec![0; entries],
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
        if terms.iter().all(|term| self.keys.binary_search(&term.key).is_ok()) {
            self.fill(lane);
        } else {
            self.rebuild();
        }
    }

    fn rebuild(&mut self) {
        self.keys.clear();
        self.keys.extend(self.lanes.iter().flatten().map(|term| term.key));
        self.keys.sort_unstable();
        self.keys.dedup();
        self.counts.fill(0);
        for (entry, _) in &self.keys {
            self.counts[usize::from(*entry)] += 1;
        }
        self.functions.clear();
        self.functions.extend(self.keys.iter().map(|(_, function)| function));
        self.coefficients.clear();
        self.coefficients.resize(self.keys.len(), self.zero);
        (0..T::LANES).for_each(|lane| self.fill(lane));
    }

    fn fill(&mut self, lane: usize) {
        self.coefficients.iter_mut().for_each(|c| c.0.set(lane, 0.0));
        for term in &self.lanes[lane] {
            if let Ok(place) = self.keys.binary_search(&term.key) {
                self.coefficients[place].0.set(lane, term.coefficient);
            }
        }
    }

    /// For each entry the sum of coefficient times basis function, in each of `W` sets of basis functions.
    #[inline(always)]
    pub(crate) fn sum<const ENTRIES: usize, const B: usize, const W: usize>(
        &self,
        basis: &[[N<T>; W]; B],
    ) -> [[N<T>; W]; ENTRIES] {
        let mut entries = [[self.zero; W]; ENTRIES];
        let mut first = 0;
        for (entry, &count) in entries.iter_mut().zip(&self.counts) {
            let terms = first..first + usize::from(count);
            first = terms.end;
            let mut sum = [self.zero; W];
            for (&function, &coefficient) in self.functions[terms.clone()].iter().zip(&self.coefficients[terms]) {
                let basis = &basis[usize::from(function)];
                for w in 0..W {
                    sum[w] += coefficient * basis[w];
                }
            }
            *entry = sum;
        }
        entries
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
