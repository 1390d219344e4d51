//! `dimcmc man`: the manual, one page per command.

use super::output::Output;
use super::{Failure, console};
use crate::data::io::atomic;
use crate::numerics::text::shown;
use clap_mangen::Man;

/// Write the manual pages
///
/// dimcmc.1, and one for each command (dimcmc-map.1, ...). `man ./man/dimcmc-map.1` shows one; in share/man/man1 of a
/// folder of the manual's path, `man dimcmc-map` finds it.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc man --out man")]
pub struct Args {
    #[command(flatten)]
    output: Output,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    args.output.check()?;
    let pages = pages()?;
    let folder = args.output.create()?;
    for (name, page) in &pages {
        atomic::write(&folder.join(name), page)?;
    }
    console::line(format_args!("written: {}: {} pages, dimcmc.1 first", shown(&folder), pages.len()));
    Ok(())
}

/// Every page with its file name.
fn pages() -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let mut whole = super::command();
    // adds the options of every command to its page
    whole.build();
    let commands = whole.get_subcommands().filter(|command| command.get_name() != "help" && !command.is_hide_set());
    let named = commands.map(|command| command.clone().display_name(format!("dimcmc-{}", command.get_name())));
    let all: Vec<clap::Command> = std::iter::once(whole.clone()).chain(named).collect();
    let page = |command: clap::Command| {
        let man = Man::new(command).source(concat!("dimcmc ", env!("CARGO_PKG_VERSION")));
        let mut text = Vec::new();
        let rendered = man.render(&mut text).map(|()| (man.get_filename(), text));
        rendered.map_err(|e| Failure::failed(format!("manual page: {e}")))
    };
    all.into_iter().map(page).collect()
}
