//! `dimcmc inject`: an orbit injected into the profiles of a config.

use super::Failure;
use super::output::Output;
use super::report_lines::Report;
use super::signals::{RESULT, Signals};
use crate::data::config::Config;
use crate::data::io::{lsd, truth};
use crate::data::scene::Scene;
use crate::runs::injected::{CONFIG, Injected, folder_of};
use crate::star::Orbit;
use std::path::PathBuf;

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
    after_help = "Example:\n  dimcmc inject configs/demo.json --k-kms 0.2 --porb-over-prot 2.6 --phi 0.25 \\\n    \
                  --out demo_injected"
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
    let signals = Signals::catch(RESULT)?;
    args.output.check()?;
    let scene = Scene::new(&Config::load(&args.config)?)?;
    args.output.spare(&scene.files(), |name| name == CONFIG)?;
    for set in &scene.settings.sets {
        let below = folder_of(&scene, set);
        args.output.spare_below(&below, &scene.files(), |name| lsd::is_written(name) || name == truth::FILE)?;
    }
    let Args { k_kms, porb_over_prot, phi, .. } = *args;
    let injected = Injected::of(&scene, Orbit { k_kms, porb_over_prot, phi })?;
    signals.defer();
    let folder = args.output.create()?;
    injected.write(&folder)?;
    let lines = injected.lines().into_iter();
    let report = lines.fold(Report::default(), |report, (label, text)| report.line(label, text));
    let where_to = if scene.settings.sets.len() > 1 { " of each data set in a folder of its name" } else { "" };
    report.written(&folder, format!("{CONFIG}, observations.txt, p000.prof ... and truth.json{where_to}")).print();
    Ok(())
}
