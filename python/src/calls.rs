//! Calls that write the files of a command into a folder, and say in text what that command prints.

use crate::fault::Fault;
use crate::job::{Job, attend, soon};
use crate::scene::{Arrays, ConfigText, NewArrays, Source, arrays};
use dimcmc::{
    BestOrbit, BlindSearch, BlindSearchOptions, DetectionLimits, Failure, Figure, Forecast, Format, FrequencySettings,
    GridScan, Injected, LimitsOptions, LimitsProgress, Maps, Next, OptimumFile, Orbit, ParaboloidRule, PlanSettings,
    PlanetBox, Pool, RatePrior, Scene, Simulated, Size, StarTable, Survey, SurveySettings,
};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// How a call is carried out: number of threads, and who is told how far it is.
#[derive(FromPyObject)]
pub struct Manner(pub Option<usize>, pub Option<Py<PyAny>>);

/// Computes with a scene, and makes the folder for what it writes.
fn with_scene(
    py: Python,
    source: Source,
    out: PathBuf,
    Manner(threads, progress): Manner,
    work: impl FnOnce(&Job, &Scene, &Path) -> Result<String, Fault> + Send + 'static,
) -> PyResult<String> {
    attend(py, threads, progress, move |job| {
        job.say("profiles");
        let scene = source.scene(None)?.fitted(&|what| job.say(what));
        work(job, &scene, &out)
    })
}

/// A folder that is to be written into, made if need be, unless Ctrl-C was pressed.
fn create(job: &Job, folder: &Path) -> Result<(), Fault> {
    job.begin_to_write();
    std::fs::create_dir_all(folder).map_err(|e| Fault::Failed(format!("{}: {e}", folder.display())))
}

/// Labels and texts, a line each, labels padded.
fn text(lines: &[(&str, String)]) -> String {
    let width = lines.iter().map(|(label, _)| label.len()).max().unwrap_or(0);
    let lines: Vec<String> = lines.iter().map(|(label, text)| format!("{label:width$}  {text}")).collect();
    lines.join("\n")
}

/// `dimcmc simulate`: the text, and the profiles of each data set.
#[pyfunction]
pub fn simulate(py: Python, config: ConfigText, out: PathBuf, manner: Manner) -> PyResult<(String, Vec<NewArrays>)> {
    let simulated = attend(py, manner.0, manner.1, move |job| {
        job.say("simulating");
        let simulated = Simulated::of(&config.config()?)?;
        create(job, &out)?;
        simulated.write(&out)?;
        Ok(simulated)
    })?;
    let sets = simulated.sets().iter().map(|set| arrays(py, &set.observations));
    Ok((text(&simulated.lines()), sets.collect::<PyResult<_>>()?))
}

/// `dimcmc map`.
#[pyfunction]
pub fn map(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    times_d: Option<Vec<f64>>,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    with_scene(py, Source::new(py, config, observations)?, out, manner, move |job, scene, out| {
        let maps = Maps::of(scene, times_d.as_deref(), &|what| job.say(what)).map_err(Failure::maps)?;
        create(job, out)?;
        maps.write(out)?;
        Ok(text(&maps.lines()))
    })
}

/// Options of `periodogram`: shortest and longest period, oversampling; eccentric, second planet, fixed; draws, seed.
type Options = (Option<f64>, Option<f64>, Option<f64>, bool, bool, bool, usize, u64);

/// `dimcmc periodogram`.
#[pyfunction]
pub fn periodogram(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    options: Options,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let (min_period_d, max_period_d, oversampling, eccentric, second_planet, fixed, draws, seed) = options;
    let options = BlindSearchOptions {
        periods: FrequencySettings { min_period_d, max_period_d, oversampling },
        eccentric,
        second_planet,
        fixed,
        draws,
        seed,
        ..BlindSearchOptions::default()
    };
    with_scene(py, Source::new(py, config, observations)?, out, manner, move |job, scene, out| {
        let found = BlindSearch::of(scene, &options, &|what| job.say(what));
        let found = found.map_err(|error| Failure::blind_search(&scene.settings.path, error))?;
        create(job, out)?;
        found.write(out)?;
        Ok(found.table().trim_end().to_owned())
    })
}

/// Options of `limits`.
#[derive(FromPyObject)]
pub struct Limits {
    #[pyo3(item)]
    min_period_d: Option<f64>,
    #[pyo3(item)]
    max_period_d: Option<f64>,
    #[pyo3(item)]
    periods: usize,
    #[pyo3(item)]
    min_k_kms: Option<f64>,
    #[pyo3(item)]
    max_k_kms: Option<f64>,
    #[pyo3(item)]
    amplitudes: usize,
    #[pyo3(item)]
    phases: usize,
    #[pyo3(item)]
    full: usize,
    /// Whether the best orbit is subtracted; where it is a candidate for `None`.
    #[pyo3(item)]
    subtract_best: Option<bool>,
    #[pyo3(item)]
    fixed: bool,
    #[pyo3(item)]
    draws: usize,
    #[pyo3(item)]
    seed: u64,
}

/// `dimcmc limits`.
#[pyfunction]
pub fn limits(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    options: Limits,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let Limits { min_period_d, max_period_d, periods, min_k_kms, max_k_kms, amplitudes, phases, full, .. } = options;
    let options = LimitsOptions {
        range: FrequencySettings { min_period_d, max_period_d, oversampling: None },
        periods,
        min_k_kms,
        max_k_kms,
        amplitudes,
        phases,
        full,
        best: match options.subtract_best {
            None => BestOrbit::OutIfCandidate,
            Some(true) => BestOrbit::Out,
            Some(false) => BestOrbit::In,
        },
        fixed: options.fixed,
        draws: options.draws,
        seed: options.seed,
    };
    with_scene(py, Source::new(py, config, observations)?, out, manner, move |job, scene, out| {
        let pool = Pool::threads(job.stop());
        let found = DetectionLimits::of(scene, &options, &pool, &|progress| match progress {
            LimitsProgress::Map => job.say("planet-free map"),
            LimitsProgress::Injections { done, total } => job.share(done, total, "orbits"),
            LimitsProgress::Full { done, total } => job.share(done, total, "orbits, full pipeline"),
        });
        let found = found.map_err(|error| Failure::limits(scene.path(), error))?;
        create(job, out)?;
        found.write(out)?;
        Ok(found.table().trim_end().to_owned())
    })
}

/// `dimcmc inject`.
#[pyfunction]
pub fn inject(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    orbit: (f64, f64, f64),
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let source = Source::new(py, config, observations)?;
    let (k_kms, porb_over_prot, phi) = orbit;
    attend(py, manner.0, manner.1, move |job| {
        job.say("injecting");
        let scene = source.scene(None)?;
        let injected = Injected::of(&scene, Orbit { k_kms, porb_over_prot, phi })?;
        create(job, &out)?;
        injected.write(&out)?;
        Ok(text(&injected.lines()))
    })
}

/// How `grid` begins: replacing another one, going on with it; how many of the highest nodes, and those within how many
/// steps, make the paraboloid.
type GridOptions = (bool, bool, Option<usize>, Option<usize>);

/// `dimcmc grid`.
#[pyfunction]
pub fn grid(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    options: GridOptions,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let (replace, resume, nodes, radius) = options;
    let source = Source::new(py, config, observations)?;
    attend(py, manner.0, manner.1, move |job| {
        job.say("profiles");
        let scene = source.scene(None)?;
        let plan = scene.settings.require_grid()?;
        let failed = |error| Fault::from(Failure::grid_scan(scene.path(), error));
        let mut scan = if resume {
            job.say("reading the grid, reference image");
            let scan = GridScan::resume(&scene, plan, &out).map_err(failed)?;
            job.begin_to_write();
            scan
        } else {
            let scene = scene.clone().fitted(&|what| job.say(what));
            let found = scene.optimise_over(&plan.free, &|progress| job.search(progress));
            let found = found.map_err(|error| Failure::search(scene.path(), error))?;
            job.say("start images for distant nodes");
            create(job, &out)?;
            {
                let claim = GridScan::claim(&out, replace).map_err(failed)?;
                GridScan::begin(&scene, plan, found, &out, claim).map_err(failed)?
            }
        };
        let total = scan.landscape.grid().len();
        let pool = Pool::threads(job.stop());
        // batches are cut so that the scan ends by itself, with what was finished in time on disk
        let whole = scan.go(&pool, |landscape| job.count(landscape.nodes().len(), total, "nodes"));
        if !whole.map_err(failed)? {
            return Err(Fault::Interrupted(format!(
                "interrupted after {} nodes; resume with the same call and out={:?}, resume=True",
                scan.landscape.nodes().len(),
                out.display().to_string()
            )));
        }
        let notes = scan.header.notes().into_iter().map(|note| format!("note: {note}\n"));
        let said = scan.conclude(&out, ParaboloidRule { nodes, radius })? + &notes.collect::<String>();
        Ok(said.trim_end().to_owned())
    })
}

/// `dimcmc init` by its arguments: the config, and the table of its values.
#[pyfunction]
pub fn init(py: Python, arguments: Vec<OsString>, manner: Manner) -> PyResult<(String, String)> {
    attend(py, manner.0, manner.1, move |job| {
        job.say("first look, test fit");
        Ok(dimcmc::first_config(arguments, &|_| job.go_on())?)
    })
}

/// `dimcmc report`: the page.
#[pyfunction]
pub fn report(py: Python, folders: Vec<PathBuf>) -> PyResult<String> {
    Ok(soon(py, || dimcmc::report(&folders).map_err(Fault::from))??)
}

/// Whether a file is such a page.
#[pyfunction]
pub fn is_report(file: PathBuf) -> bool {
    dimcmc::is_report(&file)
}

/// What was printed when a file was written into a folder, where the file holds all of it.
#[pyfunction]
pub fn printed(py: Python, folder: PathBuf, file: &str) -> PyResult<Option<String>> {
    let text = soon(py, || dimcmc::printed(&folder, file).map_err(Fault::from))??;
    Ok(text.map(|text| text.trim_end().to_owned()))
}

/// A text as the program prints it, long lines broken.
#[pyfunction]
pub fn broken(text: &str) -> String {
    dimcmc::broken_lines(text)
}

/// Options of `plan`: shortest and longest period, fixed; maps, draws, seed.
type PlanOptions = (Option<f64>, Option<f64>, bool, usize, usize, u64);

/// Nights to be chosen by `plan`: how many, period of the planet, another period.
type PlanNext = Option<(usize, Option<f64>, Option<f64>)>;

/// `dimcmc plan`.
#[pyfunction]
pub fn plan(
    py: Python,
    configs: Vec<ConfigText>,
    nights: (Vec<usize>, PlanNext),
    options: PlanOptions,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let (nights, next) = nights;
    let (min_period_d, max_period_d, fixed, maps, draws, seed) = options;
    let periods = FrequencySettings { min_period_d, max_period_d, oversampling: None };
    let settings = PlanSettings { maps, draws, seed, fixed };
    let next = next.map(|(nights, period_d, other_d)| Next { nights, period_d, other_d });
    attend(py, manner.0, manner.1, move |job| {
        job.say("reading");
        let configs = configs.iter().map(ConfigText::config).collect::<Result<Vec<_>, _>>()?;
        let forecast = Forecast::of(&configs, (&nights, next), periods, &settings, &|what| job.say(what));
        let forecast = forecast.map_err(Failure::plan)?;
        create(job, &out)?;
        forecast.write(&out).map_err(Fault::from)?;
        Ok(forecast.table().trim_end().to_owned())
    })
}

/// `dimcmc optimise`.
#[pyfunction]
pub fn optimise(
    py: Python,
    config: ConfigText,
    observations: Option<Arrays>,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    with_scene(py, Source::new(py, config, observations)?, out, manner, |job, scene, out| {
        scene.require_free()?;
        let found = scene.optimise_with(&|progress| job.search(progress));
        let found = found.map_err(|e| Failure::search(scene.path(), e))?;
        job.say("blind search");
        let file = OptimumFile::new(scene, &found);
        create(job, out)?;
        file.write(out)?;
        Ok(file.table().trim_end().to_owned())
    })
}

/// Options of `survey`: boxes by K and by M sin i as on the command line, whether the prior is that of Jeffreys; table,
/// column of groups, column of reliabilities.
type SurveyOptions = (Vec<String>, Vec<String>, bool, Option<PathBuf>, Option<String>, Option<String>);

/// `dimcmc survey`.
#[pyfunction]
pub fn survey(
    py: Python,
    folders: Vec<PathBuf>,
    options: SurveyOptions,
    out: PathBuf,
    manner: Manner,
) -> PyResult<String> {
    let (boxes, mass_boxes, jeffreys, table, group, reliability) = options;
    let of = |texts: Vec<String>, size: Size, name: &str| {
        let of_text = |text: &String| {
            let wrong = |problem| PyValueError::new_err(format!("{name}: {text}: {problem}"));
            PlanetBox::from_text(text, size).map_err(wrong)
        };
        texts.iter().map(of_text).collect::<PyResult<Vec<_>>>()
    };
    let boxes = [of(boxes, Size::Amplitude, "boxes")?, of(mass_boxes, Size::Mass, "mass_boxes")?].concat();
    let mut settings = SurveySettings {
        prior: if jeffreys { RatePrior::Jeffreys } else { RatePrior::Uniform },
        table: table.map(|path| StarTable { path, group, reliability }),
        ..SurveySettings::default()
    };
    if !boxes.is_empty() {
        settings.boxes = boxes;
    }
    attend(py, manner.0, manner.1, move |job| {
        job.say("reading");
        let survey = Survey::of(&folders, &settings)?;
        create(job, &out)?;
        survey.write(&out).map_err(Fault::from)?;
        Ok(survey.table().trim_end().to_owned())
    })
}

/// `dimcmc export`: the files written.
#[pyfunction]
pub fn export(py: Python, run: PathBuf, format: &str, out: Option<PathBuf>, replace: bool) -> PyResult<Vec<PathBuf>> {
    let format = match format {
        "zarr" => Format::Zarr,
        "emcee" => Format::Emcee,
        "getdist" => Format::Getdist,
        "csv" => Format::Csv,
        other => {
            return Err(PyValueError::new_err(format!(
                "format: must be \"zarr\", \"emcee\", \"getdist\" or \"csv\", not {other:?}"
            )));
        }
    };
    let out = out.unwrap_or_else(|| format.place(&run));
    Ok(soon(py, || dimcmc::export(&run, format, &out, replace).map_err(Fault::from))??)
}

fn drawn(py: Python, folder: &Path) -> PyResult<Vec<Figure>> {
    Ok(soon(py, || dimcmc::figures(folder, None).map_err(Fault::from))??)
}

/// Names of the figures of what a folder holds.
#[pyfunction]
pub fn figure_names(py: Python, folder: PathBuf) -> PyResult<Vec<String>> {
    Ok(drawn(py, &folder)?.into_iter().map(|figure| figure.name).collect())
}

/// One of them, by default the first: name, caption, SVG and PNG.
#[pyfunction]
pub fn figure(
    py: Python,
    folder: PathBuf,
    name: Option<String>,
    dpi: f64,
) -> PyResult<(String, String, String, Vec<u8>)> {
    let figures = drawn(py, &folder)?;
    let wanted = |figure: &&Figure| name.as_ref().is_none_or(|name| *name == figure.name);
    let Some(figure) = figures.iter().find(wanted) else {
        let names: Vec<&str> = figures.iter().map(|figure| figure.name.as_str()).collect();
        let name = name.unwrap_or_default();
        return Err(PyKeyError::new_err(format!("no figure {name}: there are {}", names.join(", "))));
    };
    let (svg, png) = py.detach(|| (figure.svg(), figure.png(dpi)));
    Ok((figure.name.clone(), figure.caption.clone(), svg, png))
}
