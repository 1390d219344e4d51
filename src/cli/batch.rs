//! `dimcmc batch`: the chains of many stars.

use super::output::{Output, note_objective};
use super::signals::Signals;
use super::{Failure, Global, cluster, console, progress};
use crate::data::config::Config;
use crate::data::io::atomic::write_json;
use crate::data::io::lines::{self, JournalError};
use crate::numerics::text::{Align, columns, escaped, shown};
use crate::runs::batch::{End, FILE, LOCK, Row, read_list, rows, sample_all};
use crate::sampling::chain::ParameterSummary;
use std::path::PathBuf;

/// Sample the posteriors of many stars
///
/// The list names one config per line. Each star gets a run as by `sample`, in a folder of its name below --out. As
/// many stars run at once as there are threads, or MPI ranks. Given again, the command skips finished stars and resumes
/// interrupted ones. A star that fails does not stop the others. Writes batch.json and prints a table.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc batch configs/stars.txt --out runs/stars")]
pub struct Args {
    /// List of configs, one per line, relative to the list's folder; `#` begins a comment
    list: PathBuf,
    /// Folder for the runs and the table; an existing one is resumed
    #[arg(long = "out", value_name = "DIR")]
    folder: PathBuf,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch("star")?;
    let stars = read_list(&args.list, &args.folder).map_err(Failure::of)?;
    // only for stars to begin; a config that cannot be read is reported with its star
    let to_begin = stars.iter().filter(|star| !star.folder.exists());
    note_objective(&to_begin.filter_map(|star| Config::load(&star.config).ok()).collect::<Vec<_>>());
    let output = Output::to(args.folder.clone(), true);
    drop(output.create()?);
    let folder = output.folder();
    // locking a file works where folders cannot be locked
    let held = lines::hold_for(&folder.join(LOCK)).map_err(|error| match error {
        JournalError::Locked { .. } => {
            Failure::failed(format!("--out {}: another `dimcmc batch` is at work there", folder.display()))
        }
        error => error.into(),
    })?;
    let pool = cluster::pool(global, &signals);
    signals.defer();
    let bar = progress::bar(global, Some(stars.len() as u64), "stars");
    let ends = sample_all(&stars, &pool, &|| bar.inc(1));
    bar.finish_and_clear();
    let rows = rows(&stars, &ends);
    write_json(&folder.join(FILE), &rows)?;
    let _ = std::fs::remove_file(folder.join(LOCK));
    drop(held);
    console::line(format_args!("{}written: {}: {FILE}", table(&rows), shown(folder)));
    let count = |is: &dyn Fn(&End) -> bool| ends.iter().filter(|end| is(end)).count();
    let (interrupted, failed) = (count(&|end| *end == End::Interrupted), count(&|end| matches!(end, End::Failed(_))));
    if interrupted > 0 {
        let message = format!("interrupted with {interrupted} of {} stars to do; the same command resumes", ends.len());
        return Err(signals.interrupted(message));
    }
    match failed {
        0 => Ok(()),
        _ => Err(Failure::failed(format!("{failed} of {} stars have no chain", ends.len()))),
    }
}

/// One line per star and parameter, or the reason why there is none.
fn table(rows: &[Row]) -> String {
    let head = ["star", "parameter", "median", "- 68%", "+ 68%", "R-hat", "ESS", "converged"];
    let mut cells = vec![head.map(str::to_owned).to_vec()];
    let (mut failures, mut verdicts) = (String::new(), String::new());
    for row in rows {
        match &row.end {
            End::Sampled => {}
            End::Interrupted => failures += &format!("{}: interrupted\n", escaped(&row.name)),
            End::Failed(why) => failures += &format!("{}: {}\n", escaped(&row.name), escaped(why)),
        }
        if let Some(verdict) = &row.verdict {
            verdicts += &format!("{}: {}\n", row.name, verdict.sentence);
        }
        for (name, one) in &row.parameters {
            cells.push([vec![escaped(&row.name).into_owned(), name.clone()], numbers(one, row.converged)].concat());
        }
    }
    let aligns: Vec<Align> = (0..head.len()).map(|k| if k < 2 { Align::Left } else { Align::Right }).collect();
    if cells.len() == 1 { failures } else { verdicts + "\n" + &columns(&cells, &aligns) + &failures }
}

fn numbers(one: &ParameterSummary, converged: Option<bool>) -> Vec<String> {
    let [low, high] = one.ci68;
    let number = |x: f64| format!("{x:.4}");
    let or_none = |x: Option<f64>, digits: usize| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"));
    let converged = if converged == Some(true) { "yes" } else { "no" };
    vec![
        number(one.median),
        number(one.median - low),
        number(high - one.median),
        or_none(one.rhat, 3),
        or_none(one.ess, 0),
        converged.to_owned(),
    ]
}
