//! The climb to the most probable field, by quasi-Newton steps in ln amplitude, slope, ln lifetime and ln jitter.

use super::known::Known;
use super::{Assumed, Marginal};
use crate::field::{Field, FieldError, Kernel, Lifetime, Spectrum};
use crate::model::Parameter;
use nalgebra::{Matrix4, Vector4};

/// Bounds of a jitter (km/s); without one it is 0.
const JITTER_KMS: (f64, f64) = (1e-3, 3.0);

/// A search ends when a step would gain less than this in ln Z, or after so many steps.
pub(super) const GAIN: f64 = 0.02;
pub(super) const STEPS: usize = 25;

/// Step of the derivatives of ln Z: errors of ln Z of 0.03 are some 10 in its second derivative.
const STEP: f64 = 0.1;

/// Second derivatives of minus ln Z larger than this are significant; otherwise uncertainties of 10 % are usual.
pub(super) const LEAST_BEND: f64 = 10.0;
pub(super) const USUAL_BEND: f64 = 100.0;

/// Longest step in ln amplitude, slope and ln lifetime: maps are found from those of the previous step.
const LONGEST: f64 = 0.35;

/// ln amplitude, slope, ln lifetime, ln jitter.
pub(super) fn place(Assumed { field, jitter_kms, .. }: &Assumed) -> Vector4<f64> {
    let lifetime_d = match field.kernel.lifetime {
        Lifetime::Days(days) => days,
        Lifetime::Static => f64::INFINITY,
    };
    Vector4::new(field.spectrum.amplitude.ln(), field.spectrum.slope, lifetime_d.ln(), jitter_kms.ln())
}

pub(super) fn assumed_at(place: Vector4<f64>, like: &Assumed) -> Assumed {
    let lifetime = match like.field.kernel.lifetime {
        Lifetime::Static => Lifetime::Static,
        Lifetime::Days(_) => Lifetime::Days(place[2].exp()),
    };
    let field = Field {
        spectrum: Spectrum { amplitude: place[0].exp(), slope: place[1], ..like.field.spectrum },
        kernel: Kernel { lifetime, ..like.field.kernel },
    };
    Assumed { field, jitter_kms: if like.jitter_kms == 0.0 { 0.0 } else { place[3].exp() }, ..*like }
}

/// Bounds in the coordinates of [`place`].
pub(super) fn limits(known: &Known) -> [(f64, f64); 4] {
    let [amplitude, slope, lifetime] = [0, 1, 2].map(|i| {
        let ((low, high), p) = (known.bounds(i), Parameter::FIELD[i]);
        (p.to_sampling(low), p.to_sampling(high))
    });
    [amplitude, slope, lifetime, (JITTER_KMS.0.ln(), JITTER_KMS.1.ln())]
}

/// The end of a climb, with the estimate by its steps of minus the second derivatives of ln Z.
pub(super) struct Top {
    pub marginal: Marginal,
    pub hessian: Matrix4<f64>,
}

/// A climb from `first` by at most so many quasi-Newton steps (BFGS; Nocedal & Wright 2006, chapter 6), within the
/// bounds. Correlations of the parameters are those of the second derivatives `nearby`, if there are any.
pub(super) fn climb(
    first: Marginal,
    known: &Known,
    nearby: Option<Matrix4<f64>>,
    steps: usize,
    at: &(impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError> + Sync),
) -> Result<Top, FieldError> {
    let (free, limits) = (known.free(&first.assumed), limits(known));
    let height = |of: &Marginal| known.height(of);
    // gradient, and minus the second derivatives along each parameter. Derivatives at fixed maps are not sufficient:
    // the determinant changes with the maps, and outweighs the rest
    let slope = |of: &Marginal| {
        let from = place(&of.assumed);
        if free.contains(&true) {
            // once, before two threads need it
            of.settled.evidence.explained();
        }
        let beside = |i: usize, h: f64| {
            let mut to = from;
            to[i] += h;
            at(assumed_at(to, &of.assumed), Some(of))
                .map(|there| height(&there))
                .ok()
                .filter(|height| height.is_finite())
        };
        let along = |i: usize| {
            if !free[i] {
                return (0.0, 0.0);
            }
            let here = height(of);
            match rayon::join(|| beside(i, STEP), || beside(i, -STEP)) {
                (Some(above), Some(below)) => {
                    ((above - below) / (2.0 * STEP), (2.0 * here - above - below) / (STEP * STEP))
                }
                (Some(above), None) => ((above - here) / STEP, 0.0),
                (None, Some(below)) => ((here - below) / STEP, 0.0),
                (None, None) => (0.0, 0.0),
            }
        };
        let all = [0, 1, 2, 3].map(along);
        (Vector4::from(all.map(|a| a.0)), Vector4::from(all.map(|a| a.1)))
    };
    let mut here = first;
    let (mut gradient, bend) = slope(&here);
    let mut hessian = nearby.unwrap_or_else(|| Matrix4::from_diagonal_element(USUAL_BEND));
    let scale =
        bend.zip_map(&hessian.diagonal(), |bend, was| if bend > LEAST_BEND { (bend / was).sqrt() } else { 1.0 });
    hessian.component_mul_assign(&(scale * scale.transpose()));
    for taken in 1..=steps {
        let from = place(&here.assumed);
        // parameters that are pushed against a bound stay there
        let pushes = |i: usize| {
            let (low, high) = limits[i];
            (from[i] <= low + 1e-9 && gradient[i] < 0.0) || (from[i] >= high - 1e-9 && gradient[i] > 0.0)
        };
        let inside = Vector4::from_fn(|i, _| if pushes(i) || !free[i] { 0.0 } else { gradient[i] });
        let moves = |i: usize| free[i] && !pushes(i);
        let own = |i: usize, j: usize| if i == j { hessian[(i, i)].max(LEAST_BEND) } else { 0.0 };
        let among = Matrix4::from_fn(|i, j| if moves(i) && moves(j) { hessian[(i, j)] } else { own(i, j) });
        let factor = among.cholesky().or_else(|| Matrix4::from_fn(own).cholesky());
        let Some(mut step) = factor.map(|factor| factor.solve(&inside)) else { break };
        if inside.dot(&step) < 2.0 * GAIN {
            break;
        }
        step *= (LONGEST / step.amax()).min(1.0);
        let Some(next) = shortened(&here, step, &gradient, (&limits, &height), at) else { break };
        let moved = Vector4::from_fn(|i, _| if free[i] { place(&next.assumed)[i] - from[i] } else { 0.0 });
        let gained = height(&next) - height(&here);
        here = next;
        if gained < 0.1 * GAIN || taken == steps {
            break;
        }
        let (there, _) = slope(&here);
        let bent = gradient - there;
        if moved.dot(&bent) > 0.0 {
            let before = hessian * moved;
            hessian += bent * bent.transpose() / moved.dot(&bent);
            hessian -= before * before.transpose() / moved.dot(&before);
        }
        gradient = there;
    }
    Ok(Top { marginal: here, hessian })
}

/// The first of progressively shorter steps that leads up; `None` where none does.
fn shortened(
    here: &Marginal,
    mut step: Vector4<f64>,
    gradient: &Vector4<f64>,
    (limits, height): (&[(f64, f64); 4], &impl Fn(&Marginal) -> f64),
    at: &impl Fn(Assumed, Option<&Marginal>) -> Result<Marginal, FieldError>,
) -> Option<Marginal> {
    // shorter ones gain less than a tenth of the expected gain
    const TRIES: usize = 4;
    let from = place(&here.assumed);
    for _ in 0..TRIES {
        let to = Vector4::from_fn(|i, _| (from[i] + step[i]).clamp(limits[i].0, limits[i].1.max(from[i])));
        let to = Vector4::from_fn(|i, _| if step[i] == 0.0 { from[i] } else { to[i] });
        let next = at(assumed_at(to, &here.assumed), Some(here));
        if let Some(next) = next.ok().filter(|next| height(next) > height(here) + 1e-4 * gradient.dot(&step)) {
            return Some(next);
        }
        step *= 0.3;
    }
    None
}
