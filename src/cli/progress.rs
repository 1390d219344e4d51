//! Progress on a terminal, and only there.

use super::Global;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal as _;
use std::time::Duration;

/// A bar of `total` steps, or a spinner where their number is not known; hidden with `--quiet` or when stderr is no
/// terminal. Clear it with `finish_and_clear` before anything is printed.
pub fn bar(global: &Global, total: Option<u64>, message: &'static str) -> ProgressBar {
    bar_if(!global.quiet, total, message)
}

/// The same for threads without access to ranks: hidden where it is not wanted.
pub fn bar_if(is_wanted: bool, total: Option<u64>, message: &'static str) -> ProgressBar {
    if !is_wanted || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    // the message is truncated at the width of the terminal
    let (bar, template) = match total {
        Some(total) => (ProgressBar::new(total), "{bar:10} {wide_msg}"),
        None => (ProgressBar::new_spinner(), "{spinner} [{elapsed}] {wide_msg}"),
    };
    // a template is a constant of this program; if it is invalid, indicatif's default style is used
    bar.set_style(ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(message);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}
