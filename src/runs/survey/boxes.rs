//! Boxes of planets: ranges of period and of semi-amplitude or minimum mass.

use crate::planets::occurrence::Span;
use crate::star::planet::amplitude_kms;
use std::fmt::{Display, Formatter};
use std::str::FromStr;

/// The unit of the size of a planet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Semi-amplitude (km/s).
    Amplitude,
    /// Minimum mass (Jupiter masses).
    Mass,
}

/// Planets whose rate is requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanetBox {
    /// Shortest and longest period (d).
    pub periods_d: [f64; 2],
    /// Smallest and largest size.
    pub sizes: [f64; 2],
    /// The kind of the size.
    pub size: Size,
}

impl PlanetBox {
    /// Hot Jupiters: periods from 1 to 10 d, K from 50 m/s to 1 km/s, 0.35 to 7.2 Jupiter masses in 3 d around a star
    /// like the Sun.
    pub const HOT_JUPITERS: PlanetBox = PlanetBox { periods_d: [1.0, 10.0], sizes: [0.05, 1.0], size: Size::Amplitude };

    /// From text, `P1:P2,S1:S2`.
    ///
    /// # Errors
    /// Its error.
    pub fn from_text(text: &str, size: Size) -> Result<Self, String> {
        let form = "four numbers above 0, rising in each pair: P1:P2,".to_owned()
            + match size {
                Size::Amplitude => "K1:K2 (d, km/s)",
                Size::Mass => "M1:M2 (d, Jupiter masses)",
            };
        let range = |pair: &str| -> Option<[f64; 2]> {
            let (low, high) = pair.split_once(':')?;
            let [low, high] = [low, high].map(|x| f64::from_str(x.trim()).ok());
            Some([low?, high?]).filter(|[low, high]| *low > 0.0 && low < high && high.is_finite())
        };
        let (periods, sizes) = text.split_once(',').ok_or(form.as_str())?;
        let (periods_d, sizes) = range(periods).zip(range(sizes)).ok_or(form.as_str())?;
        Ok(PlanetBox { periods_d, sizes, size })
    }

    /// Its ranges.
    pub fn span(&self) -> Span {
        Span { periods_d: self.periods_d, sizes: self.sizes }
    }

    /// Semi-amplitude (km/s) of a size at a period, around a star of that mass: NaN for masses where it is unknown.
    pub fn k_kms(&self, period_d: f64, size: f64, mass_msun: Option<f64>) -> f64 {
        match self.size {
            Size::Amplitude => size,
            Size::Mass => mass_msun.map_or(f64::NAN, |mass| amplitude_kms(size, period_d, mass)),
        }
    }

    /// As text.
    pub fn words(&self) -> String {
        let [[p1, p2], [s1, s2]] = [self.periods_d, self.sizes];
        match self.size {
            Size::Amplitude => format!("P {p1} to {p2} d, K {s1} to {s2} km/s"),
            Size::Mass => format!("P {p1} to {p2} d, M sin i {s1} to {s2} M_Jup"),
        }
    }
}

impl Display for PlanetBox {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let [[p1, p2], [s1, s2]] = [self.periods_d, self.sizes];
        write!(f, "{p1}:{p2},{s1}:{s2}")
    }
}

#[test]
fn boxes_are_read_from_text() {
    let hot = PlanetBox::from_text("1:10,0.05:1", Size::Amplitude).unwrap();
    assert_eq!(hot, PlanetBox::HOT_JUPITERS);
    assert_eq!(PlanetBox::from_text(&hot.to_string(), Size::Amplitude).unwrap(), hot);
    for wrong in ["1:10", "1:10,1:0.05", "0:10,0.05:1", "1:10,0.05:1:2", "a:10,0.05:1", "1:inf,0.05:1"] {
        let problem = PlanetBox::from_text(wrong, Size::Mass).unwrap_err();
        assert!(problem.contains("P1:P2,M1:M2"), "{problem}");
    }
    let mass = PlanetBox { size: Size::Mass, ..hot };
    // 1 Jupiter mass in 3 d around the Sun
    assert!((mass.k_kms(3.0, 1.0, Some(1.0)) - 0.1408).abs() < 5e-4, "{}", mass.k_kms(3.0, 1.0, Some(1.0)));
    assert!(mass.k_kms(3.0, 1.0, None).is_nan());
}
