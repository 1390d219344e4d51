//! The part of a report on the maps of a star.

use super::chapter::{Chapter, NOTHING, Tone, number, pairs, parameters, tone};
use crate::data::io::map::FitFile;
use crate::model::Parameter;
use crate::planets::speeds::with_unit;
use crate::sampling::log_density::Status;
use crate::surface::SpotField;
use crate::surface::maps::ImageSummary;

/// For the whole result.
pub(super) fn chapter(file: &FitFile) -> Chapter {
    let fit = &file.summary;
    let mut rows = file.field.as_ref().map_or_else(Vec::new, of_field);
    rows.extend([
        ("χ²/N", number(fit.chi2_per_datum, 4)),
        ("χ²/N, static spots", number(fit.chi2_per_datum_unchanging, 4)),
        ("data", format!("{} in {} profiles", fit.data, fit.profiles)),
    ]);
    rows.extend(fit.image.as_ref().map_or_else(Vec::new, of_image));
    let moments = match fit.image {
        Some(_) => "rms of the radial velocities",
        None => "rms of the first moments",
    };
    let velocity = |kms: Option<f64>| kms.map_or_else(|| NOTHING.into(), with_unit);
    rows.push((moments, velocity(fit.observed_rv_rms_kms.into())));
    if fit.filtered_rv_rms_kms.is_some() {
        rows.push(("rms of the filtered velocities", velocity(fit.filtered_rv_rms_kms)));
        rows.push(("photon noise of a radial velocity", velocity(fit.photon_rv_error_kms.into())));
    }
    rows.extend([
        ("rms of the velocities, spots marginalised out", velocity(fit.rv_rms_kms)),
        ("their uncertainty", velocity(fit.rv_error_kms)),
        ("rms of the residuals", number(fit.residual_rms, 6)),
        ("pixels", fit.pixels.to_string()),
    ]);
    let mut notes = Vec::new();
    if file.field.is_some() {
        notes.push(
            "The most probable map is smoother than the star. Where the posterior SD approaches the prior amplitude, \
            the map is prior-dominated."
                .to_owned(),
        );
    }
    notes.extend(
        fit.chi2_per_datum_unchanging
            .map(|_| "Residuals of the static map that vanish with the evolving maps show spot evolution.".into()),
    );
    let (heading, table) = match file.field {
        Some(_) => ("Maps", "Spots and fit."),
        None => ("Map", "Fit."),
    };
    let has_orbit = fit.parameters[Parameter::K] > 0.0 || file.truth.is_some();
    let parameters = parameters(&fit.parameters, file.truth.as_ref(), |of| has_orbit || !of.is_orbital());
    Chapter {
        heading: heading.into(),
        verdicts: vec![sentence(file)],
        warnings: file.warnings.iter().chain(&file.checks.warnings).cloned().collect(),
        notes,
        tables: vec![(table.into(), pairs(&rows))],
        diagnostics: vec![("Parameters of the maps.".into(), parameters)],
    }
}

fn sentence(file: &FitFile) -> (Tone, String) {
    let Some(field) = &file.field else {
        let converged = file.summary.status == Status::Converged;
        let sentence = match converged {
            true => "Static map of maximum entropy at the target χ².",
            false => {
                "Static map: the reconstruction stopped short of the target χ², the entropy is not at its maximum."
            }
        };
        return (tone(converged), sentence.into());
    };
    let chi2 = number(file.summary.chi2_per_datum, 3);
    let sentence = match field.spot_lifetime_d {
        Some(_) => format!("Evolving maps, one per night: spot lifetime {}, χ²/N = {chi2}.", field.lifetime()),
        None => format!("Static map with uncertainties: χ²/N = {chi2}."),
    };
    (Tone::Neutral, sentence)
}

fn of_field(field: &SpotField) -> Vec<(&'static str, String)> {
    let caveat = |name: &str| field.caveat(name).map_or_else(String::new, |caveat| format!(" ({caveat})"));
    let lifetime_d = field.lifetime_d().unwrap_or_else(|| field.lifetime());
    vec![
        ("spot amplitude (SD of the filling factor)", field.amplitude() + &caveat("spot_amplitude")),
        ("power-law index", field.slope() + &caveat("spot_slope")),
        ("turnover degree *ℓ*_{b}", number(field.spot_break_degree, 1)),
        ("spot lifetime (d)", lifetime_d + &caveat("spot_lifetime_d")),
        ("RV jitter, without a planet", with_unit(field.velocity_jitter_kms)),
        ("ln *Z*", number(field.ln_evidence, 2)),
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
