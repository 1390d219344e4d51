//! The symbols of astronomers for parameters.

use crate::model::Parameter;

/// Decimals of a period in days, in figures and tables alike.
pub const PERIOD_DIGITS: usize = 4;

/// Unit of phi: the part of an orbit from the epoch to the largest radial velocity.
const PHASE_UNIT: &str = "cycles to max. RV";

/// Symbol and unit of a parameter by its name in files; the name itself if it is another one.
pub fn symbol(name: &str) -> (&str, &'static str) {
    if let Some(parameter) = Parameter::from_name(name) {
        return (parameter.spec().symbol, unit(parameter));
    }
    match name {
        "t_max_rv_d" => ("*T*_{max RV}", "d"),
        "eccentricity" => ("*e*", ""),
        "omega_deg" => ("*ω*", "°"),
        "t_max_rv2_d" => ("*T*_{max RV,2}", "d"),
        "msini2_mjup" => ("*M*_{2} sin *i*", "*M*_{Jup}"),
        "eccentricity2" => ("*e*_{2}", ""),
        "omega2_deg" => ("*ω*_{2}", "°"),
        "msini_mjup" => ("*M* sin *i*", "*M*_{Jup}"),
        name => (name, ""),
    }
}

fn unit(parameter: Parameter) -> &'static str {
    match parameter.unit() {
        "1" => "",
        "deg" => "°",
        "cycles" => PHASE_UNIT,
        unit => unit,
    }
}

/// Label of an axis: symbol and unit.
pub fn label(name: &str) -> String {
    if let Some(injected) = name.strip_prefix("true_") {
        return format!("injected {}", label(injected));
    }
    match symbol(name) {
        (symbol, "") => symbol.to_owned(),
        (symbol, unit) => format!("{symbol} ({unit})"),
    }
}

/// Short label of an axis, for narrow panels.
pub fn short_label(name: &str) -> String {
    label(name).replace(PHASE_UNIT, "cycles")
}

/// What is said of a parameter above a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Title {
    symbol: String,
    /// The value; `None` where the data do not constrain it.
    value: Option<String>,
    errors: String,
    unit: String,
}

impl Title {
    /// Lines that a title has at most.
    pub const LINES: usize = 3;

    /// A value with its error bars, downwards and upwards.
    pub fn value(name: &str, value: f64, [down, up]: [f64; 2], digits: usize) -> Self {
        let (down, up) = (format!("{down:.digits$}"), format!("{up:.digits$}"));
        let (symbol, unit) = symbol(name);
        let unit = match unit {
            // those of a phase go without saying
            "" | PHASE_UNIT => String::new(),
            "°" => "°".to_owned(),
            unit => format!(" {unit}"),
        };
        Title {
            symbol: symbol.to_owned(),
            value: Some(format!("{value:.digits$}")),
            errors: if down == up { format!("± {up}") } else { format!("+{up} -{down}") },
            unit,
        }
    }

    /// Of a parameter that the data do not constrain, so that no value means anything.
    pub fn unconstrained(name: &str) -> Self {
        let symbol = symbol(name).0.to_owned();
        Title { symbol, value: None, errors: String::new(), unit: String::new() }
    }

    /// In so many lines, [`Title::LINES`] at most.
    pub fn lines(&self, lines: usize) -> Vec<String> {
        let Title { symbol, value, errors, unit } = self;
        match (value, lines) {
            (None, 1) => vec![format!("{symbol} unconstrained")],
            (None, _) => vec![symbol.clone(), "unconstrained".to_owned()],
            (Some(value), 1) => vec![format!("{symbol} = {value} {errors}{unit}")],
            (Some(value), 2) => vec![symbol.clone(), format!("{value} {errors}{unit}")],
            (Some(value), _) => vec![symbol.clone(), value.clone(), errors.clone()],
        }
    }
}

/// `x` by the whole number of turns that brings it nearest to `centre`, for a periodic parameter (period 1).
pub fn nearest_turn(x: f64, centre: f64) -> f64 {
    x - (x - centre).round()
}

/// Decimals that show two digits of `error`.
pub fn decimals(error: f64) -> usize {
    if error > 0.0 && error.is_finite() { (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize } else { 3 }
}
