//! What is said of the maps of a star that may change.

use super::chapters::{number, pairs, parameters};
use super::{Chapter, Tone};
use crate::data::io::map::ChangingFitFile;

/// Of the whole result.
pub(super) fn chapter(file: &ChangingFitFile) -> Chapter {
    let (fit, field) = (&file.summary, &file.field);
    let bound = |name: &str| match field.at_bounds.iter().any(|reached| reached == name) {
        true => " (at the bound of its search)",
        false => "",
    };
    let lifetime = field.spot_lifetime_d.map_or("for ever".to_owned(), |days| format!("{days:.2}"));
    let rows = [
        ("amplitude of the spot filling factor", number(field.spot_amplitude, 4)),
        ("slope of its spectrum", number(field.spot_slope, 3) + bound("spot_slope")),
        ("degree below which that is flat", number(field.spot_break_degree, 1)),
        ("lifetime of the spots (d)", lifetime + bound("spot_lifetime_d")),
        ("velocity jitter (km/s)", number(field.velocity_jitter_kms, 4)),
        ("ln of the evidence", number(field.ln_evidence, 2)),
        ("chi2 per datum", number(fit.chi2_per_datum, 4)),
        ("the same, had these spots lived for ever", number(fit.chi2_per_datum_unchanging, 4)),
        ("data in profiles", format!("{} in {}", fit.data, fit.profiles)),
        ("scatter of the first moments (km/s)", number(fit.observed_rv_rms_kms, 4)),
        ("scatter of the radial velocities, all maps integrated out (km/s)", number(fit.rv_rms_kms, 4)),
        ("their error (km/s)", number(fit.rv_error_kms, 4)),
        ("residuals, rms", number(fit.residual_rms, 6)),
        ("pixels", fit.pixels.to_string()),
    ];
    let parameters = parameters(&fit.parameters, file.truth.as_ref());
    let sentence = match field.spot_lifetime_d {
        Some(days) => format!("The spots live some {days:.1} d: each night has a map of its own, with its error."),
        None => "The spots are taken for unchanging: one map of all nights, with its error.".to_owned(),
    };
    let mut notes = vec![
        "A map is the most probable one, and smoother than the star. Its standard deviation says where it can be \
        believed: where it is as large as the amplitude the profiles tell nothing."
            .to_owned(),
    ];
    notes.extend(fit.chi2_per_datum_unchanging.map(|_| {
        "Where the left panel of the spectra in time has colours and the right one has none, the star changed.".into()
    }));
    Chapter {
        heading: "Maps".into(),
        verdicts: vec![(Tone::Neutral, sentence)],
        warnings: file.warnings.iter().chain(&file.checks.warnings).cloned().collect(),
        notes,
        tables: vec![
            ("The field of spots, and the fit of its most probable maps.".into(), pairs(&rows)),
            ("Parameters of star and orbit.".into(), parameters),
        ],
    }
}
