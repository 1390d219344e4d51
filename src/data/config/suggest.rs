//! The name that was perhaps meant.

/// Similarity (Jaro-Winkler, which favours a common beginning) from which a name is worth suggesting.
const SIMILAR: f64 = 0.75;

/// The candidate most like `given`, whatever the case, if one is.
pub(super) fn nearest<'a>(given: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let given = given.to_lowercase();
    let similarity = |name: &str| strsim::jaro_winkler(&given, &name.to_lowercase());
    let best = candidates.iter().map(|name| (similarity(name), *name)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= SIMILAR).then_some(best.1)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn near_names_are_found_and_far_ones_not() {
        let names = crate::model::Parameter::ALL.map(|p| p.name());
        for (given, expected) in [
            ("vsinni_kms", Some("vsini_kms")),
            ("K_kms", Some("k_kms")),
            ("k", Some("k_kms")),
            ("porb_over_rot", Some("porb_over_prot")),
            ("inclination", Some("inclination_deg")),
            ("gamma", None),
            ("", None),
        ] {
            assert_eq!(nearest(given, &names), expected, "{given}");
        }
    }
}
