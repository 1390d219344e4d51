//! What a report has on the maps of a star.

use super::chapter::{Chapter, Tone, number, pairs, parameters, tone};
use crate::data::io::map::FitFile;
use crate::sampling::log_density::Status;
use crate::surface::SpotField;
use crate::surface::maps::ImageSummary;

/// Of the whole result.
pub(super) fn chapter(file: &FitFile) -> Chapter {
    let fit = &file.summary;
    let mut rows = file.field.as_ref().map_or_else(Vec::new, of_field);
    rows.extend([
        ("chi2 per datum", number(fit.chi2_per_datum, 4)),
        ("the same, static spots", number(fit.chi2_per_datum_unchanging, 4)),
        ("data in profiles", format!("{} in {}", fit.data, fit.profiles)),
    ]);
    rows.extend(fit.image.as_ref().map_or_else(Vec::new, of_image));
    let moments = match fit.image {
        Some(_) => "scatter of the radial velocities (km/s)",
        None => "scatter of the first moments (km/s)",
    };
    rows.push((moments, number(fit.observed_rv_rms_kms, 4)));
    if fit.filtered_rv_rms_kms.is_some() {
        rows.push(("the same with the model taken out (km/s)", number(fit.filtered_rv_rms_kms, 4)));
        rows.push(("photon noise of a radial velocity (km/s)", number(fit.photon_rv_error_kms, 4)));
    }
    rows.extend([
        ("scatter of the radial velocities, all maps integrated out (km/s)", number(fit.rv_rms_kms, 4)),
        ("their error (km/s)", number(fit.rv_error_kms, 4)),
        ("residuals, rms", number(fit.residual_rms, 6)),
        ("pixels", fit.pixels.to_string()),
    ]);
    let mut notes = Vec::new();
    if file.field.is_some() {
        notes.push(
            "A map is the most probable one, and smoother than the star. Where the \
            posterior SD approaches the prior amplitude, the map is prior-dominated."
                .to_owned(),
        );
    }
    notes.extend(fit.chi2_per_datum_unchanging.map(|_| {
        "Where the left panel of the spectra in time has colours and the right one has none, the star changed.".into()
    }));
    let (heading, table) = match file.field {
        Some(_) => ("Maps", "The field of spots, and the fit of its most probable maps."),
        None => ("Map", "The fit."),
    };
    let parameters = parameters(&fit.parameters, file.truth.as_ref());
    Chapter {
        heading: heading.into(),
        verdicts: vec![sentence(file)],
        warnings: file.warnings.iter().chain(&file.checks.warnings).cloned().collect(),
        notes,
        tables: vec![(table.into(), pairs(&rows)), ("Parameters of star and orbit.".into(), parameters)],
        ..Chapter::default()
    }
}

fn sentence(file: &FitFile) -> (Tone, String) {
    let Some(field) = &file.field else {
        let converged = file.summary.status == Status::Converged;
        let sentence = match converged {
            true => "The map reaches the target chi2 and is the one of greatest entropy that does.",
            false => {
                "The reconstruction stopped short of the target chi2: this map is not the one of greatest entropy \
                 there."
            }
        };
        return (tone(converged), sentence.into());
    };
    let sentence = match field.spot_lifetime_d {
        Some(days) => format!("The spots live some {days:.1} d: each night has a map of its own, with its error."),
        None => "The spots are taken for unchanging: one map of all nights, with its error.".to_owned(),
    };
    (Tone::Neutral, sentence)
}

fn of_field(field: &SpotField) -> Vec<(&'static str, String)> {
    let bound = |name: &str| match field.at_bounds.iter().any(|reached| reached == name) {
        true => " (at the bound of its search)",
        false => "",
    };
    let lifetime = field.spot_lifetime_d.map_or("infinite (static)".to_owned(), |days| format!("{days:.2}"));
    vec![
        ("amplitude of the spot filling factor", number(field.spot_amplitude, 4)),
        ("slope of its spectrum", number(field.spot_slope, 3) + bound("spot_slope")),
        ("degree below which that is flat", number(field.spot_break_degree, 1)),
        ("lifetime of the spots (d)", lifetime + bound("spot_lifetime_d")),
        ("velocity jitter (km/s)", number(field.velocity_jitter_kms, 4)),
        ("ln of the evidence", number(field.ln_evidence, 2)),
    ]
}

fn of_image(image: &ImageSummary) -> Vec<(&'static str, String)> {
    let spottedness = match image.deviation {
        None => ("spot coverage", number(image.spottedness, 4)),
        Some(mean) => (
            "brightness minus 1, rms (mean of dark, of bright parts)",
            format!("{:.4} ({:.4}, {:.4})", image.spottedness, mean.darkness, mean.brightness_excess),
        ),
    };
    vec![spottedness, ("entropy", number(image.entropy, 4))]
}
