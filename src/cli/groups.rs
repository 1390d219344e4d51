//! The commands in the order of their use, for `dimcmc --help`.

use clap::Command;

/// Groups of commands with their titles. Commands without a group are shown last.
const GROUPS: &[(&str, &[&str])] = &[
    ("Begin", &["init", "import", "plan", "simulate", "inject"]),
    ("Image and search", &["map", "periodogram", "limits", "optimise", "grid"]),
    ("Sample", &["sample", "analyse", "compare", "merge", "batch", "survey"]),
    ("Show and pass on", &["plot", "report", "export"]),
    ("This program", &["schema", "completions", "man", "help"]),
];

/// The command line with its commands in groups.
pub fn grouped(command: Command) -> Command {
    let list = list(&command);
    let template = "{about-with-newline}\n{usage-heading} {usage}\n\n{before-help}Options:\n{options}{after-help}";
    command
        .before_help(list)
        .after_help(
            "`dimcmc COMMAND --help` explains a command and shows an example; `dimcmc init --help` is where to begin.",
        )
        .help_template(template)
}

fn list(command: &Command) -> String {
    let known = |name: &str| GROUPS.iter().any(|(_, names)| names.contains(&name));
    let others: Vec<&str> = command.get_subcommands().map(Command::get_name).filter(|name| !known(name)).collect();
    let groups = GROUPS.iter().copied().chain(std::iter::once(("Others", others.as_slice())));
    let about = |name: &str| match command.find_subcommand(name) {
        Some(found) => Some(found.get_about().map(ToString::to_string).unwrap_or_default()),
        // clap's own command, which does not exist yet
        None => (name == "help").then(|| "Show the help of a command".to_owned()),
    };
    let width = command.get_subcommands().map(|c| c.get_name().len()).max().unwrap_or(0);
    let shown = |(title, names): (&str, &[&str])| {
        let line = |name: &&str| Some(format!("  {name:<width$}  {}\n", about(name)?));
        let lines: String = names.iter().filter_map(line).collect();
        (!lines.is_empty()).then(|| format!("{title}:\n{}", lines.trim_end_matches('\n')))
    };
    groups.filter_map(shown).collect::<Vec<_>>().join("\n\n")
}
