//! The symbols of parameters in astronomy.

use crate::figures::drawing::Axis;
use crate::model::Parameter;
use crate::planets::speeds::Speeds;

/// Decimals of a period in days, in figures and tables alike.
pub const PERIOD_DIGITS: usize = 4;

/// Unit of phi: the part of an orbit from the epoch to the largest radial velocity.
const PHASE_UNIT: &str = "cycles to max. RV";

/// Symbol and unit of a parameter by its name in files; the name itself for other parameters.
pub fn symbol(name: &str) -> (&str, &'static str) {
    // spots have no established symbols
    match name {
        "spot_amplitude" => return ("spot amplitude", ""),
        "spot_slope" => return ("power-law index of spots", ""),
        "spot_lifetime_d" => return ("spot lifetime", "d"),
        _ => {}
    }
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

impl Speeds {
    /// A velocity axis in this unit.
    pub fn axis(self, label: &str, range_kms: [f64; 2]) -> Axis {
        Axis::linear(&format!("{label} ({})", self.name), range_kms.map(|kms| self.factor * kms))
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

/// A parameter in figures: periods in days, small velocities in m/s.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    symbol: String,
    unit: &'static str,
    /// Factor on its values.
    pub factor: f64,
}

impl Shown {
    /// The parameter with a name and values up to `largest`, for a star with a rotation period (d).
    pub fn of(name: &str, rotation_period_d: Option<f64>, largest: f64) -> Self {
        let (symbol, unit) = symbol(name);
        let shown = |symbol: &str, unit, factor| Shown { symbol: symbol.to_owned(), unit, factor };
        match (name, rotation_period_d) {
            ("porb_over_prot", Some(days)) => shown("*P*_{orb}", "d", days),
            ("porb2_over_prot", Some(days)) => shown("*P*_{orb,2}", "d", days),
            ("k_kms" | "k2_kms", _) => {
                let speeds = Speeds::of(&[largest]);
                shown(symbol, speeds.name, speeds.factor)
            }
            _ => shown(symbol, unit, 1.0),
        }
    }

    /// Label of an axis: symbol and unit.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.symbol.clone() } else { format!("{} ({})", self.symbol, self.unit) }
    }

    /// The same for narrow panels.
    pub fn short_label(&self) -> String {
        self.label().replace(PHASE_UNIT, "cycles").replace(" of spots", "")
    }
}

/// The title of a parameter above a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Title {
    symbol: String,
    /// The value; `None` where the data do not constrain it.
    value: Option<String>,
    errors: String,
    unit: String,
}

impl Title {
    /// Largest number of lines of a title.
    pub const LINES: usize = 3;

    /// A value with its error bars, downwards and upwards, before multiplication; `sigma` has two digits.
    pub fn value(shown: &Shown, value: f64, [down, up]: [f64; 2], sigma: f64) -> Self {
        let digits = decimals(shown.factor * sigma);
        let [value, down, up] = [value, down, up].map(|x| format!("{:.digits$}", shown.factor * x));
        let unit = match shown.unit {
            // the unit of a phase is omitted
            "" | PHASE_UNIT => String::new(),
            "°" => "°".to_owned(),
            unit => format!(" {unit}"),
        };
        Title {
            symbol: shown.symbol.clone(),
            value: Some(value),
            errors: if down == up { format!("± {up}") } else { format!("+{up} -{down}") },
            unit,
        }
    }

    /// For a parameter that the data do not constrain, so that no value is meaningful.
    pub fn unconstrained(shown: &Shown) -> Self {
        Title { symbol: shown.symbol.clone(), value: None, errors: String::new(), unit: String::new() }
    }

    /// In so many lines, at most [`Title::LINES`].
    pub fn lines(&self, lines: usize) -> Vec<String> {
        let Title { symbol, value, errors, unit } = self;
        match (value, lines) {
            (None, 1) => vec![format!("{symbol} unconstrained")],
            (None, _) => vec![symbol.clone(), "unconstrained".to_owned()],
            (Some(value), 1) => vec![format!("{symbol} = {value} {errors}{unit}")],
            (Some(value), 2) => vec![symbol.clone(), format!("{value} {errors}{unit}")],
            (Some(value), _) => {
                let unit = unit.trim();
                let head = if unit.is_empty() { symbol.clone() } else { format!("{symbol} ({unit})") };
                vec![head, value.clone(), errors.clone()]
            }
        }
    }
}

/// `x` shifted by the whole number of cycles that brings it nearest to `centre`, for a periodic parameter (period 1).
pub fn nearest_turn(x: f64, centre: f64) -> f64 {
    x - (x - centre).round()
}

/// Decimals for two digits of `error`.
pub fn decimals(error: f64) -> usize {
    if error > 0.0 && error.is_finite() { (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize } else { 3 }
}
