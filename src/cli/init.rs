//! `dimcmc init`: a first config for observed profiles.

use super::output::ConfigFile;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console, progress};
use crate::data::config::{ConfigError, IndicatorSection, Spectrograph};
use crate::data::dataset::SceneError;
use crate::data::init::{Given, Known, LightCurve, List, Place, Proposal, ProposalError, propose};
use crate::data::io::lsd::LsdError;
use crate::data::io::{FileError, atomic, lsd};
use crate::numerics::text::{Align, columns, shown};
use crate::star::BrightnessModel;
use crate::surface::ObjectiveKind;
use clap::{Args as _, FromArgMatches as _};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Write a first config for observed profiles
///
/// Measures on the profiles: velocity range, vsini, systemic velocity, noise and priors of the orbit. Other values are
/// given by options or assumed; a table lists the source of each. The rotation period must be given: without it the
/// config contains a null, which other commands refuse. A test fit on some of the profiles follows. If it finds no map,
/// nothing is written.
///
/// Several lists are data sets of one star, one per spectrograph. They share one config, and the RV offset of each set
/// after the first is fitted.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc init demo_data/observations.txt --rotation-period 3.0 \\\n    \
                  --inclination 38 --out demo.json")]
pub struct Args {
    /// List of profiles, one per line: file, time (d), and optionally the velocity to subtract (km/s). Several lists
    /// are data sets of one star
    #[arg(required = true)]
    observations: Vec<PathBuf>,
    /// Light curve of the same weeks: a table of time, flux and its uncertainty; repeat the option for several
    #[arg(long, value_name = "FILE")]
    photometry: Vec<PathBuf>,
    /// Wavelength (nm) of each light curve, separated by commas: about 790 for TESS, 640 for Kepler
    #[arg(long, value_name = "NM", value_delimiter = ',')]
    photometry_wavelength: Vec<f64>,
    /// Activity indicator: a table of time, value and its uncertainty; repeat the option for several
    #[arg(long, value_name = "FILE")]
    indicator: Vec<PathBuf>,
    #[command(flatten)]
    output: ConfigFile,
    #[command(flatten)]
    known: KnownArgs,
}

/// What the profiles do not say, or not as well.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The star and the spectrograph")]
pub struct KnownArgs {
    /// Name of the star: the heading of its report
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Rotation period (d)
    #[arg(long, value_name = "DAYS", allow_negative_numbers = true)]
    rotation_period: Option<f64>,
    /// Time of rotation cycle 0 (d); the middle of the observations if not given
    #[arg(long, value_name = "DAYS", allow_negative_numbers = true)]
    epoch: Option<f64>,
    /// Inclination of the rotation axis to the line of sight (degrees)
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    inclination: Option<f64>,
    /// Projected rotation velocity (km/s), in place of the measured one
    #[arg(long, value_name = "KMS", allow_negative_numbers = true)]
    vsini: Option<f64>,
    /// Differential rotation: equator minus pole (rad/d)
    #[arg(long, value_name = "RAD/D", allow_negative_numbers = true)]
    domega: Option<f64>,
    /// Coefficient of linear limb darkening
    #[arg(long, value_name = "U", allow_negative_numbers = true)]
    limb_darkening: Option<f64>,
    /// Temperature of the photosphere (K)
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    photosphere: Option<f64>,
    /// Temperature of the spots (K)
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    spot: Option<f64>,
    /// Wavelength of the profiles (nm); for several lists one each, separated by commas
    #[arg(long, value_name = "NM", value_delimiter = ',')]
    wavelength: Vec<f64>,
    /// Standard deviation of the local line (km/s), before instrumental broadening
    #[arg(long, value_name = "KMS", allow_negative_numbers = true)]
    line_sigma: Option<f64>,
    /// Spectrograph, such as ESPaDOnS, SPIRou or HARPS: its resolving power and wavelength, where these are not given;
    /// for several lists one each, separated by commas
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    instrument: Vec<String>,
    /// Resolving power of the spectrograph; for several lists one each, separated by commas
    #[arg(long, value_name = "R", value_delimiter = ',')]
    resolving_power: Vec<f64>,
    /// Velocity range to use (km/s, after VRAD); bins outside it, such as bad ends, are ignored
    #[arg(long, num_args = 2, value_names = ["MIN", "MAX"], allow_negative_numbers = true)]
    velocity_range: Option<Vec<f64>>,
    /// Likelihood of an orbit: marginalised over evolving-spot maps, or the static map of minimum spot coverage
    #[arg(long, value_name = "NAME", value_parser = ["marginal-likelihood", "spottedness"])]
    objective: Option<String>,
    /// Brightness model of a static map (--objective spottedness): brighter and darker than the photosphere, or spots
    /// only
    #[arg(long, value_name = "MODEL", value_parser = ["bright-and-dark", "spots"])]
    brightness: Option<String>,
    /// Pixels of the image
    #[arg(long, value_name = "N")]
    pixels: Option<usize>,
}

/// The option that names spectrographs.
const INSTRUMENT: &str = "--instrument";

/// The setter for an option's value.
type Slot = fn(&mut Known) -> &mut Option<Given<f64>>;

impl KnownArgs {
    /// Every option with its value, its key in the config, and its setter.
    fn options(&self) -> [(&'static str, Option<f64>, &'static str, Slot); 11] {
        [
            ("--rotation-period", self.rotation_period, "star.rotation_period_d", |known| &mut known.rotation_period_d),
            ("--epoch", self.epoch, "star.epoch_d", |known| &mut known.epoch_d),
            ("--inclination", self.inclination, "star.inclination_deg", |known| &mut known.inclination_deg),
            ("--vsini", self.vsini, "star.vsini_kms", |known| &mut known.vsini_kms),
            ("--domega", self.domega, "star.domega_rad_d", |known| &mut known.domega_rad_d),
            ("--limb-darkening", self.limb_darkening, "star.limb_darkening", |known| &mut known.limb_darkening),
            ("--photosphere", self.photosphere, "star.photosphere_k", |known| &mut known.photosphere_k),
            ("--spot", self.spot, "star.spot_k", |known| &mut known.spot_k),
            ("--wavelength", self.wavelength.first().copied(), "star.wavelength_nm", |known| &mut known.wavelength_nm),
            ("--line-sigma", self.line_sigma, "star.line.sigma_kms", |known| &mut known.line_sigma_kms),
            ("--resolving-power", self.resolving_power.first().copied(), "instrument.resolving_power", |known| {
                &mut known.resolving_power
            }),
        ]
    }

    /// The given options replace the values in `known`.
    pub fn over(&self, mut known: Known) -> Result<Known, Failure> {
        if let Some(spectrograph) = self.spectrographs()?.first() {
            let given = |value: f64| Some(Given { value, by: INSTRUMENT.to_owned() });
            let by = format!("{INSTRUMENT}; {}", spectrograph.source);
            known.instrument_name = Some(Given { value: spectrograph.name, by });
            known.resolving_power = given(spectrograph.resolving_power);
            // a file specifies the wavelength of its profiles
            known.wavelength_nm = known.wavelength_nm.or(given(spectrograph.wavelength_nm));
        }
        for (name, value, _, slot) in self.options() {
            if let Some(value) = value {
                if !value.is_finite() {
                    return Err(Failure::input(format!("{name}: must be a finite number, not {value}")));
                }
                *slot(&mut known) = Some(Given { value, by: name.to_owned() });
            }
        }
        if let Some([from, to]) = self.velocity_range.as_deref() {
            if !(from.is_finite() && to.is_finite() && from < to) {
                return Err(Failure::input(format!("--velocity-range: {from} must be below {to}, both finite")));
            }
            known.velocity_range_kms = Some(Given { value: (*from, *to), by: "--velocity-range".to_owned() });
            known.only_within_range = true;
        }
        if let Some(name) = &self.objective {
            let kinds = [ObjectiveKind::MarginalLikelihood, ObjectiveKind::Spottedness];
            let value = kinds.into_iter().find(|kind| kind.name() == name);
            known.objective = value.map(|value| Given { value, by: "--objective".to_owned() });
        }
        if let Some(name) = &self.brightness {
            let model = |model: &BrightnessModel| model.name() == name;
            let value = [BrightnessModel::Spots, BrightnessModel::BrightAndDark].into_iter().find(model);
            known.brightness = value.map(|value| Given { value, by: "--brightness".to_owned() });
        }
        if known.objective().properties().has_field && self.brightness.is_some() {
            return Err(Failure::input(
                "--brightness: no effect on evolving maps, which may be brighter and darker than the photosphere: \
                 delete it, or set --objective spottedness",
            ));
        }
        if let Some(name) = &self.name {
            known.name = Some(Given { value: name.clone(), by: "--name".to_owned() });
        }
        if let Some(value) = self.pixels {
            known.pixels = Some(Given { value, by: "--pixels".to_owned() });
        }
        Ok(known)
    }

    /// Values of an option for `lists` lists: none, one for all, or one of each; with the specific values of each after
    /// the first.
    fn of_lists(name: &str, values: &[f64], lists: usize) -> Result<Vec<Option<Given<f64>>>, Failure> {
        if values.len() > 1 && values.len() != lists {
            let problem =
                format!("{name}: {} values, and {lists} of what they are for: give one, or one each", values.len());
            return Err(Failure::input(problem));
        }
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(Failure::input(format!("{name}: must be a finite number, not {value}")));
        }
        let given = |value: &f64| Given { value: *value, by: name.to_owned() };
        Ok((0..lists).map(|s| values.get(s).map(given)).collect())
    }

    /// The named spectrographs.
    fn spectrographs(&self) -> Result<Vec<&'static Spectrograph>, Failure> {
        let named = |name: &String| {
            let other = "for any other give --resolving-power and --wavelength";
            let problem = || format!("{INSTRUMENT}: {}; {other}", Spectrograph::unknown(name));
            Spectrograph::named(name).ok_or_else(|| Failure::input(problem()))
        };
        self.instrument.iter().map(named).collect()
    }

    /// Resolving powers and wavelengths (nm) for `lists` lists, from their options or from the named spectrographs;
    /// with the specific values of each after the first.
    fn instruments(&self, lists: usize) -> Result<[Vec<Option<Given<f64>>>; 2], Failure> {
        let spectrographs = self.spectrographs()?;
        let of = |name: &str, values: &[f64], usual: fn(&Spectrograph) -> f64| {
            let usual: Vec<f64> = spectrographs.iter().map(|spectrograph| usual(spectrograph)).collect();
            let usual = KnownArgs::of_lists(INSTRUMENT, &usual, lists)?;
            let given = KnownArgs::of_lists(name, values, lists)?;
            Ok::<_, Failure>(if values.is_empty() { usual } else { given })
        };
        Ok([
            of("--resolving-power", &self.resolving_power, |spectrograph| spectrograph.resolving_power)?,
            of("--wavelength", &self.wavelength, |spectrograph| spectrograph.wavelength_nm)?,
        ])
    }

    /// Checks that options with one value per list are single values.
    pub fn check_single(&self) -> Result<(), Failure> {
        self.instruments(1).map(drop)
    }

    /// Why there is no proposal; named by its option where a given value is wrong, and by the `list` where it was
    /// measured: the config has not been written.
    pub fn failure(&self, error: ProposalError, list: &Path) -> Failure {
        if let ProposalError::Scene(SceneError::Config(ConfigError::Key { key, problem, .. })) = &error {
            let at_fault =
                |given: &str| key == given || key.strip_prefix(given).is_some_and(|rest| rest.starts_with('.'));
            let option = self.options().into_iter().find(|(_, value, given, _)| value.is_some() && at_fault(given));
            let pixels = (self.pixels.is_some() && at_fault("imaging.pixels")).then_some("--pixels");
            if let Some(name) = option.map(|(name, ..)| name).or(pixels) {
                return Failure::input(format!("{name}: {key}: {problem}"));
            }
            let profiles = shown(list);
            return Failure::input(format!("{profiles}: no config can be made of these profiles: {key}: {problem}"));
        }
        error.into()
    }
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    let spinner = progress::bar(global, None, "first look, test fit");
    let proposal = args.proposal(&|note| spinner.println(format!("note: {note}")));
    spinner.finish_and_clear();
    let proposal = proposal?;
    let _claimed = args.output.claim(None)?;
    signals.defer();
    atomic::write(args.output.path(), proposal.json.as_bytes())?;
    console::print(format_args!("{}\nwritten: {}\n", proposal.table(), shown(args.output.path())));
    next_commands(&proposal, args.output.path());
    Ok(())
}

/// The first config from the `arguments` of the command, as text, and the table of its values; nothing is written.
/// `say` is called with warnings before the test fit.
///
/// # Errors
/// Invalid arguments, and profiles from which no config can be made.
pub fn first_config(arguments: Vec<OsString>, say: &dyn Fn(&str)) -> Result<(String, String), Failure> {
    let command = Args::augment_args(clap::Command::new("init").no_binary_name(true));
    let wrong = |error: clap::Error| {
        let text = error.to_string();
        let problem = text.split("\n\n").next().unwrap_or_default().trim_start_matches("error: ");
        Failure::input(problem.split_whitespace().collect::<Vec<_>>().join(" "))
    };
    let matches = command.try_get_matches_from(arguments).map_err(wrong)?;
    let proposal = Args::from_arg_matches(&matches).map_err(wrong)?.proposal(say)?;
    Ok((proposal.json.clone(), proposal.table()))
}

impl Args {
    /// The config from these arguments, with the sources of its values.
    fn proposal(&self, say: &dyn Fn(&str)) -> Result<Proposal, Failure> {
        self.output.check(None)?;
        let lists = &self.observations;
        for list in lists {
            self.output.spare(&lsd::files(list), None)?;
        }
        self.output.spare(&self.photometry, None)?;
        self.output.spare(&self.indicator, None)?;
        let read = |list: &PathBuf| {
            std::fs::read(list).map_err(|source| LsdError::from(FileError::Read { path: list.clone(), source }))
        };
        let bytes = lists.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let known = self.known.over(Known::default())?;
        let place = Place {
            config: self.output.path(),
            lists: self.lists(&bytes, &known)?,
            light_curves: self.light_curves(&known)?,
            indicators: self.indicators(&known)?,
            schema: self.output.schema(),
        };
        propose(&place, &known, say).map_err(|error| self.known.failure(error, &lists[0]))
    }

    /// The lists with the contents `bytes`.
    fn lists<'a>(&'a self, bytes: &'a [Vec<u8>], known: &Known) -> Result<Vec<List<'a>>, Failure> {
        let lists = &self.observations;
        let several = lists.len() > 1;
        if several && !known.objective().properties().marginalises {
            let problem = "several lists take the objective \"marginal-likelihood\", which fits the velocity offsets \
                           between them: leave --objective out, or give one list";
            return Err(Failure::input(problem));
        }
        let [powers, wavelengths] = self.known.instruments(lists.len())?;
        let names = names(lists);
        let mut found = Vec::new();
        for (s, (list, list_bytes)) in lists.iter().zip(bytes).enumerate() {
            if let Some(same) = lists[..s].iter().find(|other| same_file(other, list)) {
                return Err(Failure::input(format!("{}: is given twice", shown(same))));
            }
            found.push(List {
                list,
                list_bytes,
                list_in_config: self.output.relative(list)?,
                name: names.as_ref().map(|names| names[s].clone()).filter(|_| several),
                resolving_power: powers[s].clone(),
                wavelength_nm: wavelengths[s].clone(),
            });
        }
        Ok(found)
    }

    /// The light curves.
    fn light_curves(&self, known: &Known) -> Result<Vec<LightCurve>, Failure> {
        if !known.objective().properties().takes_light_curves {
            only_evolving("--photometry", &self.photometry)?;
        }
        let count = self.photometry.len();
        let wavelengths = KnownArgs::of_lists("--photometry-wavelength", &self.photometry_wavelength, count)?;
        let names = names_of_tables(&self.photometry, "photometry");
        let tables = self.photometry.iter().zip(names).zip(wavelengths);
        let curve = |((path, name), given): ((&PathBuf, String), Option<Given<f64>>)| {
            let path_in_config = self.output.relative(path)?;
            Ok(LightCurve { name, path_in_config, wavelength_nm: given.map(|given| given.value) })
        };
        tables.map(curve).collect()
    }

    /// The activity indicators.
    fn indicators(&self, known: &Known) -> Result<Vec<IndicatorSection>, Failure> {
        if !known.objective().properties().has_field {
            only_evolving("--indicator", &self.indicator)?;
        }
        let section = |(path, name): (&PathBuf, String)| {
            Ok(IndicatorSection { name: Some(name), path: self.output.relative(path)?, exclude: Vec::new() })
        };
        self.indicator.iter().zip(names_of_tables(&self.indicator, "indicator")).map(section).collect()
    }
}

/// Refuses tables of an option that needs evolving maps.
fn only_evolving(option: &str, tables: &[PathBuf]) -> Result<(), Failure> {
    if tables.is_empty() {
        return Ok(());
    }
    Err(Failure::input(format!("{option}: takes the objective \"marginal-likelihood\": leave --objective out")))
}

/// Names of tables: those of their files without invalid characters; `otherwise` and a number where nothing remains, or
/// the name is taken.
fn names_of_tables(tables: &[PathBuf], otherwise: &str) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (k, path) in tables.iter().enumerate() {
        let name = plain(&path.file_stem().unwrap_or_default().to_string_lossy());
        let is_free = |name: &String| names.iter().all(|other| !other.eq_ignore_ascii_case(name));
        let numbered = || (k + 1..).map(|number| format!("{otherwise}{number}")).find(is_free);
        names.extend(name.filter(is_free).or_else(numbered));
    }
    names
}

/// Whether two paths refer to the same file.
fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Names of data sets: of their lists, or of the folders of these, whichever differ; `None` where neither do.
fn names(lists: &[PathBuf]) -> Option<Vec<String>> {
    let name = |part: fn(&Path) -> Option<&std::ffi::OsStr>| -> Option<Vec<String>> {
        let of = |list: &PathBuf| plain(&part(list)?.to_string_lossy());
        let names = lists.iter().map(of).collect::<Option<Vec<String>>>()?;
        let different = names.iter().map(|name| name.to_lowercase()).collect::<std::collections::BTreeSet<_>>();
        (different.len() == lists.len()).then_some(names)
    };
    name(|list| list.parent()?.file_name()).or_else(|| name(Path::file_stem))
}

/// The characters of `text` that are valid in a name; `None` where none remain.
fn plain(text: &str) -> Option<String> {
    let name: String = text.chars().filter(|c| c.is_ascii_alphanumeric() || "_-".contains(*c)).take(40).collect();
    Some(name).filter(|name| !name.is_empty())
}

/// The suggested commands for the config at `path`.
pub fn next_commands(proposal: &Proposal, path: &Path) {
    let config = shown(path);
    let next = match proposal.complete {
        true => {
            let row = |command: String, what: &str| vec![command, what.to_owned()];
            let rows = [
                row(format!("  dimcmc map {config} --out map"), "does the model fit? is the map plausible?"),
                row(format!("  dimcmc periodogram {config} --out search"), "is there a planet, and at which period?"),
                row(format!("  dimcmc limits {config} --out limits"), "which planets would have been found?"),
                row(format!("  dimcmc sample {config} --out run"), "the posterior"),
                row("  dimcmc report map search limits run".to_owned(), "one HTML page of all of it"),
            ];
            format!("next:\n{}", columns(&rows, &[Align::Left, Align::Left]))
        }
        false => format!("next: correct {config} as the notes say, then\n  dimcmc map {config} --out map\n"),
    };
    console::print(next);
}
