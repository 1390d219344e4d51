//! The conclusion of a finished or unfinished run: its summary, and the corresponding text.

use super::{CHAIN, RunError, SUMMARY, read_chain};
use crate::data::io::atomic::write_json;
use crate::runs::manifest::{Manifest, RunSummary, kinds_and_goals};
use crate::sampling::chain::statistics::unwrap_around;
use crate::sampling::chain::{Chain, ParameterKind, Settled, table};
use std::path::Path;

/// Summary and text.
#[derive(Clone, Debug)]
pub struct Conclusion {
    /// The content of `summary.json`.
    pub summary: RunSummary,
    /// The verdict, the table of the parameters, and notes: the output of `dimcmc analyse`.
    pub text: String,
    /// How the sampler went: what `--verbose` adds.
    pub diagnostics: String,
    kinds: Vec<ParameterKind>,
    settled: Vec<Settled>,
}

impl Conclusion {
    /// Reads the run in `folder`, whether or not it is finished; also its chain.
    ///
    /// # Errors
    /// No run there, or one that is broken.
    pub fn read(folder: &Path) -> Result<(Self, Chain), RunError> {
        let manifest = Manifest::read(folder)?;
        let chain = read_chain(folder, &manifest)?;
        Ok((Conclusion::of(folder, &manifest, &chain)?, chain))
    }

    /// For a chain in `folder`, the name in errors.
    ///
    /// # Errors
    /// A config that this version does not support, a chain without a step.
    #[doc(hidden)]
    pub fn of(folder: &Path, manifest: &Manifest, chain: &Chain) -> Result<Self, RunError> {
        let settings = manifest.settings(folder)?;
        let (kinds, _) = kinds_and_goals(&settings);
        let (summary, settled) = manifest
            .summarise(&settings, chain)
            .map_err(|source| RunError::Analysis { path: folder.join(CHAIN), source })?;
        let mut text = summary.table(manifest.truth(&settings, &summary).as_ref()).trim_end().to_owned();
        let notes = summary.remarks.iter().cloned().chain(manifest.warnings()).chain(manifest.co_rotation(&summary));
        notes.for_each(|note| text += &format!("\nnote: {note}"));
        let diagnostics = table::diagnostics(&summary).trim_end().to_owned();
        Ok(Conclusion { summary, text, diagnostics, kinds, settled })
    }

    /// The draws of every parameter and of every derived quantity, by name: those of `chain`, the chain of this
    /// conclusion, in its order and without the omitted steps. Phases are unwrapped around their mode.
    pub fn draws(&self, chain: &Chain) -> Vec<(String, Vec<f64>)> {
        let kept = || chain.records().iter().skip(self.summary.discarded_steps * chain.shape().size());
        let parameter = |(k, name): (usize, &String)| {
            let mut values: Vec<f64> = kept().map(|record| record.theta[k]).collect();
            if self.kinds[k] == ParameterKind::Periodic {
                unwrap_around(&mut values, self.summary.parameters[name].mode);
            }
            (name.clone(), values)
        };
        let derived = |settled: &Settled| {
            (settled.quantity.name.clone(), kept().map(|record| settled.value(&record.theta)).collect())
        };
        chain.names().iter().enumerate().map(parameter).chain(self.settled.iter().map(derived)).collect()
    }

    /// Writes `summary.json` into `folder`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), RunError> {
        Ok(write_json(&folder.join(SUMMARY), &self.summary)?)
    }
}
