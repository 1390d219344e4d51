//! Progress on a terminal, and only there.

use super::Global;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal as _;
use std::time::Duration;

/// A bar of `total` steps, or a spinner where their number is not known; hidden with `--quiet` or when stderr is no terminal.
/// Clear it with `finish_and_clear` before anything is printed.
pub fn bar(global: &Global, total: Option<u64>, message: &'static str) -> ProgressBar {
    if global.quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let (bar, template) = match total {
        Some(total) => (ProgressBar::new(total), "{msg} {wide_bar} {pos}/{len} [{elapsed} < {eta}]"),
        None => (ProgressBar::new_spinner(), "{spinner} {msg} [{elapsed}]"),
    };
    bar.set_style(style(template));
    bar.set_message(message);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

/// The style of a template; a template is a constant of this program, and where it is wrong, indicatif's own style does.
pub fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
