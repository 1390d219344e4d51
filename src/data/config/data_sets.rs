//! `observations`: one data set, or a list of them.

use super::listed::{Listed, Section};
use super::raw_parts::ObservationsSection;

/// The data sets as written.
pub(super) type DataSets = Listed<ObservationsSection>;

impl Section for ObservationsSection {
    const KEY: &'static str = "observations";
    const SCHEMA: [&'static str; 2] = ["DataSets", "One data set, or a list of several of one star."];
    const EMPTY: &'static str = "the list is empty, one data set at least is needed";
}
