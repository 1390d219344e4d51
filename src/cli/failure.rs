//! Why a command stopped, with the exit code: 2 for bad usage or input, 75 where a scheduler stopped a resumable
//! command, 1 for anything else. Only [`Failure::of`] decides which errors of the system are due to the input.

use crate::data::config::ConfigError;
use crate::data::init::ProposalError;
use crate::data::io::FileError;
use crate::data::io::atomic::WriteError;
use crate::data::io::journal::JournalError;
use crate::data::io::lsd::LsdError;
use crate::data::scene::SceneError;
use crate::figures::plot::PlotError;
use crate::inference::search::SearchError;
use crate::planets::periodogram::FrequencyError;
use crate::runs::blind_search::BlindSearchError;
use crate::runs::comparison::PairError;
use crate::runs::detection_limits::LimitsError;
use crate::runs::export::ExportError;
use crate::runs::grid_scan::GridScanError;
use crate::runs::injected::InjectError;
use crate::runs::maps::MapError;
use crate::runs::origin::OriginError;
use crate::runs::plan::{CampaignError, ForecastError, PlanError};
use crate::runs::run::RunError;
use crate::runs::simulated::SimulateError;
use crate::runs::survey::SurveyError;
use crate::surface::ReferenceError;
use crate::surface::record::RebuildError;
use crate::surface::{NoMaps, SurfaceError};
use std::error::Error;
use std::io::ErrorKind;
use std::path::Path;

/// Exit code of bad usage or input.
const INPUT: u8 = 2;

/// Exit code of another failure.
const FAILED: u8 = 1;

/// Exit code of a command that Ctrl-C stopped.
pub const INTERRUPTED: u8 = FAILED;

/// Exit code of a resumable command that a scheduler stopped: sysexits' EX_TEMPFAIL.
pub const RESUME: u8 = 75;

/// A message of one line for the user, with its exit code.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct Failure {
    code: u8,
    message: String,
}

impl Failure {
    /// Bad usage or input, which the user can correct.
    pub fn input(message: impl Into<String>) -> Self {
        Failure { code: INPUT, message: message.into() }
    }

    /// Bad usage or input, unless the system is the cause, such as a full disk or a missing permission.
    pub fn of(error: impl Error + 'static) -> Self {
        Failure { code: if is_of_system(&error) { FAILED } else { INPUT }, message: error.to_string() }
    }

    /// The system has refused an operation; `message` names it.
    pub fn system(error: &std::io::Error, message: impl Into<String>) -> Self {
        Failure { code: if is_of_system(error) { FAILED } else { INPUT }, message: message.into() }
    }

    /// A failure despite correct input.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Failure { code: FAILED, message: message.to_string() }
    }

    /// The same with a further message.
    pub fn with(self, more: &str) -> Self {
        Failure { message: self.message + more, ..self }
    }

    /// A signal stopped it.
    pub fn interrupted(code: u8, message: impl std::fmt::Display) -> Self {
        Failure { code, message: message.to_string() }
    }

    /// No reference image at the values of the config at `path`.
    pub fn reference(path: &Path, error: ReferenceError) -> Self {
        match error {
            ReferenceError::TargetBelowFloor { .. } => {
                let config = path.display();
                Failure::input(format!(
                    "{config}: imaging.chi2_target: {error}; `dimcmc map {config}` diagnoses why; for evolving \
                    spots set imaging.objective \"marginal-likelihood\""
                ))
            }
            ReferenceError::NothingToFit { .. } => {
                Failure::input(format!("{}: imaging.chi2_target: {error}", path.display()))
            }
            ReferenceError::Solver(_) => Failure::failed(format!("{}: {error}", path.display())),
        }
    }

    /// No map.
    pub fn maps(error: MapError) -> Self {
        match &error {
            MapError::NoMaps { error: NoMaps::Reference(_), .. } => Failure::input(error.to_string()),
            MapError::Times(problem) => Failure::input(format!("--times: {problem}")),
            MapError::NoMaps { .. } => Failure::failed(error),
        }
    }

    /// No blind search of the star of the config at `path`.
    pub fn blind_search(path: &Path, error: BlindSearchError) -> Self {
        match error {
            BlindSearchError::Frequencies(error @ FrequencyError::TooFewTimes(_)) => {
                Failure::input(format!("{}: observations: {error}", path.display()))
            }
            BlindSearchError::Frequencies(error) => Failure::of(error),
            BlindSearchError::Detection(SurfaceError::Reference(error)) => Failure::reference(path, error),
            BlindSearchError::Detection(error) => Failure::failed(format!("{}: {error}", path.display())),
        }
    }

    /// No detection limits of the star of the config at `path`.
    pub fn limits(path: &Path, error: LimitsError) -> Self {
        match error {
            LimitsError::Search(error) => Failure::blind_search(path, error),
            error @ LimitsError::Range { .. } => Failure::input(error.to_string()),
            error @ (LimitsError::Unbounded(_) | LimitsError::Interrupted) => Failure::failed(error),
        }
    }

    /// No plan.
    pub fn plan(error: ForecastError) -> Self {
        match error {
            ForecastError::Campaign(CampaignError::Scene(error)) => error.into(),
            ForecastError::Campaign(error @ CampaignError::Nights { .. }) => Failure::input(error.to_string()),
            ForecastError::TooFewTimes { .. } => Failure::input(error.to_string()),
            ForecastError::Plan(PlanError::Frequencies(error)) => Failure::of(error),
            ForecastError::Plan(error @ PlanError::TooLong { .. }) => Failure::input(error.to_string()),
            error => Failure::failed(error),
        }
    }

    /// A search in the config at `path` that found nothing.
    pub fn search(path: &Path, error: SearchError) -> Self {
        match error {
            SearchError::Reference(error) => Failure::reference(path, error),
            SearchError::Field(_) | SearchError::Optimise(_) => Failure::failed(format!("{}: {error}", path.display())),
        }
    }

    /// A run of the config at `path` that cannot begin or be resumed.
    pub fn run(path: &Path, error: RunError) -> Self {
        match error {
            RunError::Config(error) => error.into(),
            RunError::Search(error) => Failure::search(path, error),
            RunError::Origin(error) => Failure::origin(path, error),
            RunError::Write(_) | RunError::Folder { .. } | RunError::Chain(_) => Failure::failed(error),
            RunError::Ensemble(error) => Failure::input(format!("{}: {error}", path.display())),
            RunError::Merged(_) | RunError::Analysis { .. } => Failure::of(error),
            RunError::PriorStart | RunError::UnresolvedSpots(_) => {
                Failure::input(format!("{}: {error}", path.display()))
            }
            RunError::Journal(error) => error.into(),
            RunError::Interrupted => Failure::failed(error),
        }
    }

    /// A likelihood grid of the config at `path` that cannot begin or be resumed.
    pub fn grid_scan(path: &Path, error: GridScanError) -> Self {
        match error {
            GridScanError::Origin(error) => Failure::origin(path, error),
            GridScanError::Journal(error) => error.into(),
            GridScanError::Write(_) | GridScanError::Landscape(_) => Failure::failed(error),
        }
    }

    /// A computation in a folder that cannot be resumed with the config at `path`.
    pub fn origin(path: &Path, error: OriginError) -> Self {
        match error {
            OriginError::Reference(RebuildError::Reference(error)) => Failure::reference(path, error),
            OriginError::Irreproducible { .. } => Failure::failed(error),
            error => Failure::of(error),
        }
    }

    /// The code for the shell.
    pub fn exit_code(&self) -> u8 {
        self.code
    }

    /// Whether it is bad usage or input, which the user can correct.
    pub fn is_input(&self) -> bool {
        self.code == INPUT
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Failure::of(error)
    }
}

impl From<LsdError> for Failure {
    fn from(error: LsdError) -> Self {
        match error {
            LsdError::Write(error) => Failure::failed(error),
            error => Failure::of(error),
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Config(error) => error.into(),
            SceneError::Observations(error) => error.into(),
            SceneError::LightCurve(error) => Failure::of(error),
        }
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        match error {
            SimulateError::Scene(error) => error.into(),
            error @ (SimulateError::Nothing { .. } | SimulateError::ObservedLight { .. }) => {
                Failure::input(error.to_string())
            }
        }
    }
}

impl From<InjectError> for Failure {
    fn from(error: InjectError) -> Self {
        Failure::input(error.to_string())
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        Failure::failed(error)
    }
}

impl From<JournalError> for Failure {
    fn from(error: JournalError) -> Self {
        Failure::of(error)
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Write(error) => error.into(),
            error => Failure::of(error),
        }
    }
}

impl From<PairError> for Failure {
    fn from(error: PairError) -> Self {
        Failure::of(error)
    }
}

impl From<SurveyError> for Failure {
    fn from(error: SurveyError) -> Self {
        Failure::of(error)
    }
}

impl From<ProposalError> for Failure {
    fn from(error: ProposalError) -> Self {
        Failure::of(error)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Failure::of(error)
    }
}

impl From<PlotError> for Failure {
    fn from(error: PlotError) -> Self {
        Failure::of(error)
    }
}

/// Whether an error, or its source, is the system's: any but a file that is missing, exists already, or has another
/// format.
fn is_of_system(error: &(dyn Error + 'static)) -> bool {
    let mut behind = Some(error);
    while let Some(error) = behind {
        if let Some(error) = error.downcast_ref::<std::io::Error>() {
            return !matches!(
                error.kind(),
                ErrorKind::NotFound
                    | ErrorKind::AlreadyExists
                    | ErrorKind::NotADirectory
                    | ErrorKind::IsADirectory
                    | ErrorKind::InvalidFilename
                    | ErrorKind::InvalidInput
                    | ErrorKind::InvalidData
                    | ErrorKind::UnexpectedEof
            );
        }
        behind = error.source();
    }
    false
}
