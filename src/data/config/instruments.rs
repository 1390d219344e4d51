//! Spectropolarimeters and spectrographs by name: resolving power, wavelength and RV stability, from the papers that
//! describe them.
//!
//! Resolving powers are of the usual mode; with a slit they depend on its width. Wavelengths are round values for the
//! LSD profiles of cool stars. Stabilities hold for profiles without a gas cell, which LSD does not take.

/// A spectrograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spectrograph {
    /// Name as in its papers.
    pub name: &'static str,
    /// Resolving power: wavelength over the full width at half maximum of the instrumental profile.
    pub resolving_power: f64,
    /// Central wavelength of LSD profiles (nm).
    pub wavelength_nm: f64,
    /// RV stability (m/s) from night to night: scale of the priors of RV jitter and RV offsets of nights.
    pub stability_ms: f64,
    /// Where resolving power and stability are from.
    pub source: &'static str,
}

const fn row(
    name: &'static str,
    resolving_power: f64,
    wavelength_nm: f64,
    stability_ms: f64,
    source: &'static str,
) -> Spectrograph {
    Spectrograph { name, resolving_power, wavelength_nm, stability_ms, source }
}

/// The spectrographs known by name: name, resolving power, wavelength (nm), RV stability (m/s), source.
#[rustfmt::skip]
pub const SPECTROGRAPHS: [Spectrograph; 17] = [
    row("ESPaDOnS", 65_000.0, 640.0, 30.0, "Donati 2003; 20 to 30 m/s: Moutou et al. 2007"),
    row("NARVAL", 65_000.0, 640.0, 30.0, "Aurière 2003; twin of ESPaDOnS"),
    row("Neo-Narval", 65_000.0, 640.0, 3.0, "Télescope Bernard Lyot; below 3 m/s by design"),
    row("SPIRou", 70_000.0, 1600.0, 3.0, "Donati et al. 2020; 2.6 m/s on Gl 699: Artigau et al. 2022"),
    row("HARPS", 115_000.0, 520.0, 1.0, "Mayor et al. 2003"),
    row("HARPSpol", 110_000.0, 520.0, 3.0, "Piskunov et al. 2011; assumed, no simultaneous reference"),
    row("HARPS-N", 115_000.0, 520.0, 1.0, "Cosentino et al. 2012"),
    row("CARMENES VIS", 94_600.0, 700.0, 2.0, "Quirrenbach et al. 2014; 1 to 2 m/s: Reiners et al. 2018"),
    row("CARMENES NIR", 80_400.0, 1200.0, 4.0, "Quirrenbach et al. 2014; Bauer et al. 2020"),
    row("ESPRESSO", 140_000.0, 550.0, 0.5, "Pepe et al. 2021, mode HR"),
    row("SOPHIE", 75_000.0, 550.0, 2.0, "Perruchot et al. 2008, mode HR; Bouchy et al. 2013"),
    row("UVES", 40_000.0, 550.0, 100.0, "Dekker et al. 2000, slit of 1\"; assumed, no gas cell"),
    row("FEROS", 48_000.0, 550.0, 10.0, "Kaufer et al. 1999; Brahm et al. 2017"),
    row("CRIRES+", 100_000.0, 1600.0, 10.0, "Dorn et al. 2023, slit of 0.2\"; telluric lines: Figueira et al. 2010"),
    row("PEPSI", 120_000.0, 600.0, 10.0, "Strassmeier et al. 2015, 2018"),
    row("TRES", 44_000.0, 550.0, 15.0, "Fűrész 2008; Buchhave et al. 2010"),
    row("HIRES", 48_000.0, 550.0, 100.0, "Vogt et al. 1994, slit of 0.86\"; no gas cell: Chubak et al. 2012"),
];

impl Spectrograph {
    /// The spectrograph called `name`, whatever its case, blanks and hyphens.
    pub fn named(name: &str) -> Option<&'static Spectrograph> {
        SPECTROGRAPHS.iter().find(|spectrograph| plain(spectrograph.name) == plain(name))
    }

    /// The error on an unknown name, which lists the known ones.
    pub fn unknown(name: &str) -> String {
        let known: Vec<&str> = SPECTROGRAPHS.iter().map(|spectrograph| spectrograph.name).collect();
        format!("{name:?} is none of {}", known.join(", "))
    }
}

/// A name normalised for comparison: lower case, without blanks, hyphens and underscores.
fn plain(name: &str) -> String {
    name.chars().filter(|c| !c.is_whitespace() && !"-_".contains(*c)).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::{SPECTROGRAPHS, Spectrograph};

    /// Every row has plausible values and is found by its name only.
    #[test]
    fn every_row_is_sane() {
        for row in &SPECTROGRAPHS {
            assert!((40_000.0..=200_000.0).contains(&row.resolving_power), "{row:?}");
            assert!((400.0..=2500.0).contains(&row.wavelength_nm), "{row:?}");
            assert!((0.1..=100.0).contains(&row.stability_ms), "{row:?}");
            assert!(!row.source.is_empty() && !row.source.contains(['\n', '|']), "{row:?}");
            assert_eq!(Spectrograph::named(&row.name.to_uppercase()), Some(row));
            assert_eq!(Spectrograph::named(&row.name.to_lowercase().replace(' ', "-")), Some(row));
        }
        assert_eq!(Spectrograph::named("CRIRES"), None);
        assert_eq!(Spectrograph::named(""), None);
    }
}
