//! Sections of the page, in the order of a reader's questions: each with its figures, notes and tables.

use super::chapter::{Chapter, Table};
use super::{Part, unique};
use crate::data::io::map::MAP;
use crate::data::io::truth;
use crate::figures::drawing::Figure;
use crate::runs::{blind_search, comparison, grid_scan, limits, manifest, optimum, plan};

/// The subject of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Velocities,
    Spectra,
    Maps,
    LightCurves,
    Periodogram,
    Posterior,
    Limits,
    Optimum,
    Landscape,
    Comparison,
    Plan,
    Simulation,
}

impl Kind {
    /// All of them, in the order of the page.
    const ALL: [Kind; 12] = [
        Kind::Velocities,
        Kind::Spectra,
        Kind::Maps,
        Kind::LightCurves,
        Kind::Periodogram,
        Kind::Posterior,
        Kind::Limits,
        Kind::Optimum,
        Kind::Landscape,
        Kind::Comparison,
        Kind::Plan,
        Kind::Simulation,
    ];

    /// Its anchor, and its heading.
    pub fn names(self) -> (&'static str, &'static str) {
        match self {
            Kind::Velocities => ("velocities", "Radial velocities"),
            Kind::Spectra => ("spectra", "Dynamic spectra"),
            Kind::Maps => ("maps", "Maps"),
            Kind::LightCurves => ("light-curves", "Light curves and indicators"),
            Kind::Periodogram => ("periodogram", "Periodogram"),
            Kind::Posterior => ("posterior", "Posterior"),
            Kind::Limits => ("limits", "Detection limits"),
            Kind::Optimum => ("optimum", "Optimum"),
            Kind::Landscape => ("landscape", "Likelihood grid"),
            Kind::Comparison => ("comparison", "Chain and likelihood grid"),
            Kind::Plan => ("plan", "Plan"),
            Kind::Simulation => ("simulation", "Simulation"),
        }
    }

    /// The rank of its sentences among all: those on a planet first.
    pub fn rank(self) -> usize {
        const FIRST: [Kind; 4] = [Kind::Periodogram, Kind::Posterior, Kind::Optimum, Kind::Limits];
        let place = |all: &[Kind]| all.iter().position(|kind| *kind == self);
        place(&FIRST).or_else(|| Some(FIRST.len() + place(&Kind::ALL)?)).unwrap_or(usize::MAX)
    }

    /// For the file that identifies a result.
    pub fn of_file(file: &str) -> Kind {
        match file {
            MAP => Kind::Maps,
            blind_search::FILE => Kind::Periodogram,
            limits::JSON => Kind::Limits,
            plan::JSON => Kind::Plan,
            manifest::FILE => Kind::Posterior,
            grid_scan::HEADER => Kind::Landscape,
            optimum::FILE => Kind::Optimum,
            comparison::FILE => Kind::Comparison,
            truth::FILE => Kind::Simulation,
            _ => Kind::Simulation,
        }
    }

    /// For a figure by its name; `true` where it is folded.
    fn of_figure(name: &str) -> (Kind, bool) {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches('_');
        match stem {
            "rv" => (Kind::Velocities, false),
            "residuals" | "changes" => (Kind::Spectra, false),
            "profiles" => (Kind::Spectra, true),
            "map" | "maps" | "maps_mollweide" => (Kind::Maps, false),
            "lightcurve" | "indicators" => (Kind::LightCurves, false),
            "periodogram" => (Kind::Periodogram, false),
            "corner" => (Kind::Posterior, false),
            "traces" | "autocorrelation" => (Kind::Posterior, true),
            "limits" => (Kind::Limits, false),
            "optimum" => (Kind::Optimum, false),
            "landscape" => (Kind::Landscape, false),
            "comparison" => (Kind::Comparison, false),
            "plan" => (Kind::Plan, false),
            _ => (Kind::Simulation, false),
        }
    }

    /// The title of folded figures and tables.
    fn folded_is(self) -> &'static str {
        match self {
            Kind::Velocities => "Velocities of the maps",
            Kind::Spectra => "All line profiles",
            Kind::Maps => "Parameters of the maps",
            Kind::Posterior => "Sampler diagnostics",
            Kind::Limits => "Table of limits",
            _ => "More",
        }
    }
}

/// A section.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub kind: Kind,
    pub figures: Vec<Figure>,
    pub notes: Vec<String>,
    /// Tables, each with a caption.
    pub tables: Vec<(String, Table)>,
    pub folded: Folded,
}

/// Content that is shown on request only.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Folded {
    pub summary: &'static str,
    pub figures: Vec<Figure>,
    pub tables: Vec<(String, Table)>,
}

/// The sections with content from the parts.
pub(super) fn sections(parts: Vec<Part>) -> Vec<Section> {
    let several = |kind: Kind| parts.iter().flat_map(|part| &part.chapters).filter(|(of, _)| *of == kind).count() > 1;
    // velocities of a search are more informative than those of maps, whose orbit is assumed
    let is_searched = parts.iter().any(|part| part.chapters.iter().any(|(kind, _)| *kind == Kind::Periodogram));
    let mut sections: Vec<Section> = Kind::ALL
        .into_iter()
        .map(|kind| {
            let of_kind = |part: &Part| -> Vec<(String, Chapter)> {
                let here = part.chapters.iter().filter(|(of, _)| *of == kind);
                here.map(|(_, chapter)| (part.title.clone(), chapter.clone())).collect()
            };
            let chapters: Vec<(String, Chapter)> = parts.iter().flat_map(of_kind).collect();
            let tables = |of: fn(&Chapter) -> &Vec<(String, Table)>| -> Vec<(String, Table)> {
                let named = |folder: &str, caption: &str| match several(kind) {
                    true => format!("{folder}: {caption}"),
                    false => caption.to_owned(),
                };
                let all =
                    chapters.iter().flat_map(|(folder, chapter)| of(chapter).iter().map(move |one| (folder, one)));
                all.map(|(folder, (caption, table))| (named(folder, caption), table.clone())).collect()
            };
            Section {
                kind,
                figures: Vec::new(),
                notes: unique(chapters.iter().flat_map(|(_, chapter)| chapter.notes.iter().cloned())),
                tables: tables(|chapter| &chapter.tables),
                folded: Folded {
                    summary: kind.folded_is(),
                    figures: Vec::new(),
                    tables: tables(|chapter| &chapter.diagnostics),
                },
            }
        })
        .collect();
    let mut names: Vec<String> = Vec::new();
    for part in parts {
        let is_map = part.chapters.iter().all(|(kind, _)| *kind != Kind::Periodogram);
        for mut figure in part.figures {
            let (kind, mut is_folded) = Kind::of_figure(&figure.name);
            is_folded |= kind == Kind::Velocities && is_map && is_searched;
            // names are anchors within the page
            while names.contains(&figure.name) {
                figure.name.push_str("_2");
            }
            names.push(figure.name.clone());
            if let Some(section) = sections.iter_mut().find(|section| section.kind == kind) {
                let into = if is_folded { &mut section.folded.figures } else { &mut section.figures };
                into.push(figure);
            }
        }
    }
    for section in &mut sections {
        // observations before the residuals of a static map
        section.figures.sort_by_key(|figure| figure.name.starts_with("changes"));
        // a section without other content is not folded
        let is_bare = section.figures.is_empty() && section.tables.is_empty();
        if is_bare {
            section.figures.append(&mut section.folded.figures);
        }
    }
    sections.retain(|section| !(section.figures.is_empty() && section.tables.is_empty() && section.notes.is_empty()));
    sections
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_has_its_section() {
        for (name, kind) in [
            ("rv_2", Kind::Velocities),
            ("map_3", Kind::Maps),
            ("maps_mollweide", Kind::Maps),
            ("periodogram_2", Kind::Periodogram),
            ("lightcurve", Kind::LightCurves),
            ("indicators", Kind::LightCurves),
        ] {
            assert_eq!(Kind::of_figure(name), (kind, false), "{name}");
        }
        assert_eq!(Kind::of_figure("traces"), (Kind::Posterior, true));
        let mut ranks = Kind::ALL.map(Kind::rank);
        ranks.sort_unstable();
        assert!(ranks.windows(2).all(|pair| pair[0] < pair[1]), "{ranks:?}");
    }
}
