//! The experiments of Petit et al. (2015), row by row, and a few beyond them: each from simulated stars to a table.

use crate::cases::{Failure, Laboratory};
use crate::report::Report;
use crate::{changing, coverage, images, landscape, models, orbits, stellar};

/// One experiment.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Its name on the command line and in the results: `R1` to `R12` for the paper's, a word for others.
    pub name: &'static str,
    /// Its description.
    pub title: &'static str,
    /// The paper's result; empty for experiments that are not the paper's.
    pub paper: &'static str,
    /// Runs it.
    pub run: fn(&Laboratory) -> Result<Report, Failure>,
}

impl Row {
    /// The row of that name, in upper or lower case.
    pub fn from_name(name: &str) -> Option<&'static Row> {
        ROWS.iter().find(|row| row.name.eq_ignore_ascii_case(name))
    }
}

/// All rows.
pub const ROWS: &[Row] = &[
    Row {
        name: "R1",
        title: "line profiles without a planet (Fig. 2-3)",
        paper: "first-moment RV jitter 0.8 km/s rms, 2.5 km/s peak to peak; photon noise alone 66 m/s rms",
        run: images::profiles,
    },
    Row {
        name: "R2",
        title: "filtered RV curve: observed minus modelled first moments (Fig. 3)",
        paper: "residual rms 68 m/s",
        run: images::filtered,
    },
    Row {
        name: "R3",
        title: "spottedness grid of K = 100 m/s, P = 1.7, phi = 0.5 (Fig. 4)",
        paper: "1,000 maps in 3-D and 2,500 per 2-D slice; minimum at the injected values",
        run: landscape::landscape,
    },
    Row {
        name: "R4",
        title: "no planet",
        paper: "K = 51 +- 81 m/s; K above about 130 m/s excluded; P and phi unconstrained",
        run: orbits::no_planet,
    },
    Row {
        name: "R5",
        title: "K from 10 to 200 m/s at P = 1.7, phi = 0.5 (K = 0 is R4)",
        paper: "K within 10 % for K > 20 m/s, error bars < 20 m/s (35 at 60 m/s); P within 2 %; sigma_P 0.05 at 200 \
        m/s, \
                0.6 at 30 m/s",
        run: orbits::amplitudes,
    },
    Row {
        name: "R6",
        title: "P from 0.5 to 2 at K = 100 m/s",
        paper: "P unbiased, error growing with P; K biased up to 50 % at P = 1, at most 20 % elsewhere, less above 1.6",
        run: orbits::periods,
    },
    Row { name: "R7", title: "phi from 0 to 0.9", paper: "all three recovered for every phi", run: orbits::phases },
    Row {
        name: "R8",
        title: "target chi2 0.94, 0.97, 1.0; other noise seeds",
        paper: "small changes, comparable to a new noise seed",
        run: orbits::targets,
    },
    Row {
        name: "R9",
        title: "inclination assumed wrong",
        paper: "at 33 or 43 deg instead of 38: large biases, best chi2 more than doubled, error bars up to ten times \
        wider",
        run: orbits::inclinations,
    },
    Row {
        name: "R10",
        title: "differential rotation gamma 0 to 0.02, modelled",
        paper: "biases and error bars constant",
        run: orbits::shear_modelled,
    },
    Row {
        name: "R11",
        title: "differential rotation gamma 0 to 0.024, ignored",
        paper: "fine up to gamma 0.012, then biased, chi2 + 25 %; mostly no minimum above 0.02",
        run: orbits::shear_ignored,
    },
    Row {
        name: "R12",
        title: "star and orbit together: five and seven parameters",
        paper: "the paper's outlook; the posterior covers the injected values",
        run: stellar::stellar,
    },
    Row {
        name: "co-rotation",
        title: "K = 100 m/s at P = 1 against the number of rotations covered",
        paper: "",
        run: orbits::co_rotation,
    },
    Row {
        name: "coverage",
        title: "truths inside the chain's intervals, over spot maps and noise seeds",
        paper: "",
        run: coverage::coverage,
    },
    Row {
        name: "models",
        title: "stars with faculae, wings and a wandering continuum, by the right model and the plain one",
        paper: "",
        run: models::models,
    },
    Row {
        name: "changing",
        title: "evolving spots: blind searches with static and with evolving maps",
        paper: "",
        run: changing::changing,
    },
];
