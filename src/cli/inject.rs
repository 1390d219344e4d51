//! `dimcmc inject`: an orbit put into the profiles of a config.

use super::Failure;
use super::output::Output;
use super::report_lines::Report;
use crate::data::calibrated::of_sets;
use crate::data::config::{self, Config, DataSetSettings, Settings};
use crate::data::io::truth::InjectedTruth;
use crate::data::io::{atomic, lsd, truth};
use crate::data::scene::Scene;
use crate::model::Parameter;
use crate::star::Orbit;
use crate::star::injection::inject;
use crate::star::observation::{Observations, Profile};
use std::path::PathBuf;

/// Name of the config that is written beside the profiles.
const CONFIG: &str = "config.json";

/// Inject a planetary signal into observed profiles
///
/// Each profile is shifted by the orbit's velocity at its time and resampled on its own velocity axis; uncertainties
/// shift along, times and VRAD stay. The interpolation is band-limited and leaves white noise nearly white (worst case,
/// half way between two bins: 0.93 of its variance, correlation 0.07 between neighbours). Stokes V and N are dropped.
/// Writes observations.txt and the profiles it lists, config.json (for these profiles; its start values differ from the
/// injected orbit) and truth.json. Each of several data sets gets a folder of its name. An orbit already present in the
/// profiles adds to the injected one.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  dimcmc inject configs/demo.json --k-kms 0.2 --porb-over-prot 2.6 --phi 0.25 --out \
    demo_injected"
)]
pub struct Args {
    /// Config file (JSON)
    config: PathBuf,
    #[command(flatten)]
    output: Output,
    /// Semi-amplitude (km/s)
    #[arg(long, value_name = "KMS")]
    k_kms: f64,
    /// Orbital period over the rotation period
    #[arg(long, value_name = "RATIO")]
    porb_over_prot: f64,
    /// Phase (orbital cycles) of maximum RV, counted from rotation cycle 0
    #[arg(long, value_name = "CYCLES", allow_negative_numbers = true)]
    phi: f64,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    args.output.check()?;
    let scene = Scene::new(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| name == CONFIG)?;
    let several = scene.settings.sets.len() > 1;
    let folder_of = |set: &DataSetSettings| if several { format!("{}/", set.name) } else { String::new() };
    for set in &scene.settings.sets {
        args.output
            .spare_below(&folder_of(set), &scene.files(), |name| lsd::is_written(name) || name == truth::FILE)?;
    }
    let whole = scene.whole();
    let orbit = orbit(args, &whole)?;
    let star = &scene.imager.star;
    let injected = of_sets(&scene.imager, &inject(&whole, star, &[orbit]));
    let config = scene.settings.with_observations(|set| format!("{}observations.txt", folder_of(set)));
    let velocity_kms: Vec<f64> =
        whole.profiles.iter().map(|profile| orbit.velocity_kms(star.cycle(profile.time_d))).collect();
    let largest = velocity_kms.iter().map(|v| v.abs()).fold(0.0, f64::max);
    let folder = args.output.create()?;
    for (s, set) in scene.settings.sets.iter().enumerate() {
        let of_set = scene.imager.profiles_of(s);
        let own = &injected[s];
        let folder = folder.join(folder_of(set));
        let failed = |e| Failure::failed(format!("{}: cannot be created: {e}", folder.display()));
        std::fs::create_dir_all(&folder).map_err(failed)?;
        lsd::write_as(&folder, own, &scene.data.sets[s].labels, "with an injected orbit")?;
        let truth = InjectedTruth {
            injected: orbit,
            before: scene.truth,
            times_d: own.times_d(),
            velocity_kms: velocity_kms[of_set].to_vec(),
            provenance: scene.provenance(),
        };
        truth::write(&folder, &truth)?;
    }
    atomic::write(&folder.join(CONFIG), config::to_text(&config).as_bytes())?;
    let mut report = Report::default()
        .line("profiles", format!("{}, shifted by up to {largest:.4} km/s", whole.profiles.len()))
        .line("orbit", format!("K {} km/s, Porb/Prot {}, phi {}", orbit.k_kms, orbit.porb_over_prot, orbit.phi));
    for note in outside(&scene.settings, &orbit) {
        report = report.line("note", note);
    }
    let where_to = if several { " of each data set in a folder of its name" } else { "" };
    report.written(folder, format!("{CONFIG}, observations.txt, p000.prof ... and truth.json{where_to}")).print();
    Ok(())
}

/// The orbit asked for, which leaves the line in the data.
fn orbit(args: &Args, whole: &Observations) -> Result<Orbit, Failure> {
    let Args { k_kms, porb_over_prot, phi, .. } = *args;
    let width_kms = |p: &Profile| p.intensity.len() as f64 * p.step_kms;
    let most = 0.25 * whole.profiles.iter().map(width_kms).fold(f64::INFINITY, f64::min);
    let wrong = |option: &str, value: f64, must: String| {
        Err(Failure::input(format!("--{option}: must be {must}, not {value}")))
    };
    match () {
        _ if !(k_kms >= 0.0 && k_kms <= most) => {
            wrong("k-kms", k_kms, format!("from 0 to {most:.1}, a quarter of the width of the profiles"))
        }
        _ if !(porb_over_prot > 0.0 && porb_over_prot.is_finite()) => {
            wrong("porb-over-prot", porb_over_prot, "above 0".into())
        }
        _ if !phi.is_finite() => wrong("phi", phi, "finite".into()),
        _ => Ok(Orbit { k_kms, porb_over_prot, phi: phi.rem_euclid(1.0) }),
    }
}

/// Priors that do not hold the orbit.
fn outside(settings: &Settings, orbit: &Orbit) -> Vec<String> {
    let value = |parameter| match parameter {
        Parameter::K => Some(orbit.k_kms),
        Parameter::PorbOverProt => Some(orbit.porb_over_prot),
        Parameter::Phi => Some(orbit.phi),
        _ => None,
    };
    let missed = settings.free.iter().filter_map(|f| Some((f, value(f.parameter).filter(|x| !f.prior.contains(*x))?)));
    missed.map(|(f, x)| format!("{x} is outside the prior of parameters.{}", f.parameter.name())).collect()
}
