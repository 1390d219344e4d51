//! The response of several data sets in sequence: each has its own local line, spot contrast and velocity axis, and all
//! share one star. A single set is the usual case.

use super::grid::SurfaceGrid;
use super::response::Part;
use super::seen::{Sampling, Seen};
use super::{StarSettings, StarState};
use crate::numerics::vector::Number;
use nalgebra::DMatrix;
use std::ops::Range;

/// The response of all profiles to a map of the star.
#[derive(Clone, Debug)]
pub struct Response {
    parts: Vec<Part>,
    /// First bin of each profile, and the end.
    starts: Vec<usize>,
    /// Index of the data set of each profile.
    set_of: Vec<usize>,
}

impl Response {
    /// The response of one data set at one state of star and planet.
    pub fn new(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, sampling: &Sampling) -> Self {
        Response::of_sets(grid, star, state, &[sampling.clone().into()])
    }

    /// The response of data `sets`.
    pub fn of_sets(grid: &SurfaceGrid, star: &StarSettings, state: &StarState, sets: &[Seen]) -> Self {
        let part = |set: &Seen| Part::new(grid, &set.star(star, &state.surface), state, set);
        Response::stacked(sets.iter().map(part).collect())
    }

    /// From its parts, one per data set.
    pub(super) fn stacked(parts: Vec<Part>) -> Self {
        let (mut starts, mut set_of) = (vec![0], Vec::new());
        for (s, part) in parts.iter().enumerate() {
            let end = starts[starts.len() - 1];
            starts.extend((0..part.profiles()).map(|k| end + part.bins(k).end));
            set_of.extend((0..part.profiles()).map(|_| s));
        }
        Response { parts, starts, set_of }
    }

    /// The response at a state that differs from this one's by orbit and systemic velocity alone: only the lines are
    /// shifted.
    pub fn with_velocities(&self, star: &StarSettings, state: &StarState, sets: &[Seen]) -> Self {
        let shifted = |(part, set): (&Part, &Seen)| part.with_velocities(&set.star(star, &state.surface), state, set);
        Response::stacked(self.parts.iter().zip(sets).map(shifted).collect())
    }

    /// Brightness of a spot over that of the photosphere, for profile `k`, at the state of this response.
    pub fn contrast(&self, k: usize) -> f64 {
        self.parts[self.set_of[k]].contrast()
    }

    /// Number of pixels of a map.
    pub fn pixels(&self) -> usize {
        self.parts[0].pixels()
    }

    /// Number of profiles.
    pub fn profiles(&self) -> usize {
        self.set_of.len()
    }

    /// Number of visible (pixel, profile) pairs.
    pub fn pairs(&self) -> usize {
        self.parts.iter().map(Part::pairs).sum()
    }

    /// Memory (bytes) that a pass over all pairs reads.
    pub fn bytes(&self) -> usize {
        self.parts.iter().map(Part::bytes).sum()
    }

    /// Bins of profile `k` within the data.
    pub fn bins(&self, k: usize) -> Range<usize> {
        self.starts[k]..self.starts[k + 1]
    }

    /// Number of data.
    pub fn data_len(&self) -> usize {
        self.starts[self.profiles()]
    }

    /// Each part with its profiles and its bins.
    fn places(&self) -> impl Iterator<Item = (&Part, Range<usize>, Range<usize>)> {
        self.parts.iter().scan(0, |first, part| {
            let profiles = *first..*first + part.profiles();
            *first = profiles.end;
            let bins = self.starts[profiles.start]..self.starts[profiles.end];
            Some((part, profiles, bins))
        })
    }

    /// Line depth of every bin and continuum of every profile for the brightness map `x`; or for several maps in `x` in
    /// sequence, each profile using its own.
    pub fn apply(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        for (part, profiles, bins) in self.places() {
            part.apply(x, &mut line[bins], &mut continuum[profiles]);
        }
    }

    /// Their change for a change `x` of the brightness.
    pub fn change(&self, x: &[f64], line: &mut [f64], continuum: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        for (part, profiles, bins) in self.places() {
            part.change(x, &mut line[bins], &mut continuum[profiles]);
        }
    }

    /// [`Response::apply`] for maps that differ between data sets, like the brightness of spots: `fill` receives the
    /// first profile of the set, and makes its `map`.
    pub fn apply_each(
        &self,
        map: &mut [f64],
        line: &mut [f64],
        continuum: &mut [f64],
        fill: impl Fn(usize, &mut [f64]),
    ) {
        for (part, profiles, bins) in self.places() {
            fill(profiles.start, map);
            part.apply(map, &mut line[bins], &mut continuum[profiles]);
        }
    }

    /// Transpose of [`Response::change`]; `out` is overwritten.
    pub fn apply_transpose(&self, line: &[f64], continuum: &[f64], out: &mut [f64]) {
        assert_eq!(continuum.len(), self.profiles());
        self.summed(out, |part, profiles, bins, out| part.apply_transpose(&line[bins], &continuum[profiles], out));
    }

    /// The transpose applied to the result of `weigh` on the changes of line depth and continuum of every profile by
    /// `x`: given the number of a profile, those of its bins, and of its continuum, it replaces the former, and returns
    /// the replacement of the latter. `out` is overwritten. Both passes run profile by profile, so that data of a large
    /// map are read from memory once. Maps in single precision are accurate to six digits, and faster.
    pub fn apply_and_back<N: Number>(
        &self,
        x: &[N],
        out: &mut [N],
        mut weigh: impl FnMut(usize, &mut [f64], f64) -> f64,
    ) {
        self.summed(out, |part, profiles, _, out| {
            part.apply_and_back(x, out, |k, line, continuum| weigh(profiles.start + k, line, continuum));
        });
    }

    /// The sum over the parts of their contributions to a map.
    fn summed<N: Number>(&self, out: &mut [N], mut make: impl FnMut(&Part, Range<usize>, Range<usize>, &mut [N])) {
        let mut own = Vec::new();
        for (s, (part, profiles, bins)) in self.places().enumerate() {
            if s == 0 {
                make(part, profiles, bins, out);
                continue;
            }
            own.resize(out.len(), N::default());
            make(part, profiles, bins, &mut own);
            out.iter_mut().zip(&own).for_each(|(out, own)| *out = N::of((*out).into() + (*own).into()));
        }
    }

    /// Normalised depth `1 - I` of every bin for a brightness map: the observable of `docs/method.md` section 1.
    pub fn depths(&self, brightness: &[f64]) -> Vec<f64> {
        let mut depths = vec![0.0; self.data_len()];
        let mut continuum = vec![0.0; self.profiles()];
        self.apply(brightness, &mut depths, &mut continuum);
        for (k, continuum) in continuum.iter().enumerate() {
            depths[self.bins(k)].iter_mut().for_each(|depth| *depth /= continuum);
        }
        depths
    }

    /// The same for an evolving star: profile k sees the brightness map in column k (pixels, profiles).
    pub fn depths_of_each(&self, brightness: &DMatrix<f64>) -> Vec<f64> {
        assert_eq!(brightness.shape(), (self.pixels(), self.profiles()), "a map of each profile");
        let mut depths = vec![0.0; self.data_len()];
        for (part, profiles, bins) in self.places() {
            part.depths_of_each(brightness.columns_range(profiles), &mut depths[bins]);
        }
        depths
    }
}
