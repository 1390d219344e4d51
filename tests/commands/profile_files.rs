//! Profiles in the formats of other programs, given to `dimcmc init`: readable ones are read, and a refusal describes
//! the profiles with advice. It names no file that has not been written. The formats are in `tests/method/lsd.rs`.
//!
//! No rotation period is given, so that no map is tried.

use crate::desk::{Desk, says};
use serde_json::{Value, json};

/// Depth of a line of this vsini and local width (km/s).
fn depth(v: f64, vsini: f64, sigma: f64) -> f64 {
    let rings = (-50..=50).map(|k| f64::from(k) / 50.5);
    let (sum, weight) = rings.fold((0.0, 0.0), |(sum, weight), x| {
        let of = (1.0 - x * x).sqrt();
        (sum + of * (-0.5 * ((v - vsini * x) / sigma).powi(2)).exp(), weight + of)
    });
    0.4 * sum / weight
}

/// Six profiles in bins of `step` (km/s), each bin a row by `row` of profile, velocity and intensity.
fn profiles(step: f64, vsini: f64, row: impl Fn(usize, f64, f64) -> String) -> Desk {
    let desk = Desk::new(json!({}));
    let mut list = String::new();
    for k in 0..6 {
        let bin = |j: i32| {
            let v = step * f64::from(j);
            let noise = 1e-3 * (f64::from(j * j) * 3.7 + 11.0 * k as f64).sin();
            row(k, v, 1.0 - depth(v, vsini, 3.1) + noise)
        };
        desk.write(&format!("{k}.prof"), &(-42..=42).map(bin).collect::<String>());
        list += &format!("{k}.prof {}\n", 100.0 + 0.7 * k as f64);
    }
    desk.write("observations.txt", &list);
    desk
}

const INIT: [&str; 4] = ["init", "observations.txt", "--out", "star.json"];

fn plain(v: f64, i: f64) -> String {
    format!("{v:.3} {i:.6} 1e-3\n")
}

fn range(desk: &Desk) -> Value {
    desk.json("star.json")["observations"]["velocity_range_kms"].clone()
}

#[test]
fn percent_and_counts_are_named() {
    for (scale, cure) in [(100.0, "these look like percent, divide I and sigma by 100"), (23450.0, "by its continuum")]
    {
        let desk = profiles(1.8, 25.0, |_, v, i| format!("{v:.3} {:.5e} {:e}\n", scale * i, 1e-3 * scale));
        let message = desk.refusal(&INIT);
        says(
            &message,
            &["observations.txt: the continuum of the profiles is at ", "I in units of the continuum", cure],
        );
        assert!(!message.contains("star.json"), "{message}");
    }
}

#[test]
fn a_line_that_shows_no_rotation_is_named() {
    let desk = profiles(0.225, 0.4, |_, v, i| plain(v, i));
    let message = desk.refusal(&INIT);
    says(&message, &["observations.txt: ", "vsini is not resolved", "--vsini", "--line-sigma", "--resolving-power"]);
    assert!(!message.contains("star.json"), "{message}");
}

#[test]
fn bad_ends_are_left_out_and_said() {
    for bad in ["nan nan", "0 1e-3", "0 1e5", "1 0", "1 1e5"] {
        // more of them in some profiles than in others
        let desk = profiles(1.8, 25.0, |k, v, i| match v < -70.0 + k as f64 {
            true => format!("{v:.3} {bad}\n"),
            false => plain(v, i),
        });
        says(&desk.succeed(&INIT), &["profiles: all of them: bins without data", "at the ends left out"]);
        let vsini = desk.json("star.json")["star"]["vsini_kms"].as_f64().unwrap();
        assert!((vsini - 25.0).abs() < 2.5, "{bad}: {vsini}");
        // one in the middle is refused, with its line
        let spoilt = |row: &str| if row.starts_with("0.000 ") { "0.000 nan 1e-3\n".into() } else { format!("{row}\n") };
        desk.edit("3.prof", |text| text.lines().map(spoilt).collect());
        says(
            &desk.refusal(&[&INIT[..], &["--force"]].concat()),
            &["3.prof:43: intensity is NaN", "velocity range in use"],
        );
    }
}

#[test]
fn a_range_may_be_given() {
    // a second line beyond the range, deeper than that of the star
    let desk = profiles(1.8, 25.0, |_, v, i| plain(v, i - 0.9 * (-((v + 70.0) / 3.0).powi(2)).exp()));
    desk.succeed(&[&INIT[..], &["--velocity-range", "-50.4", "60"]].concat());
    assert_eq!(range(&desk), json!([-50.4, 60.0]));
    let vsini = desk.json("star.json")["star"]["vsini_kms"].as_f64().unwrap();
    assert!((vsini - 25.0).abs() < 2.5, "{vsini}");
    let refused =
        |from: &str, to: &str| desk.refusal(&[&INIT[..], &["--force", "--velocity-range", from, to]].concat());
    says(&refused("50", "-50"), &["--velocity-range: 50 must be below -50"]);
    says(&refused("500", "600"), &["0.prof: velocity range [500, 600] km/s lies outside the data"]);
}

#[test]
fn a_cosmic_is_named_at_once() {
    let desk = profiles(1.8, 25.0, |k, v, i| plain(v, if k == 2 && v.abs() < 0.1 { i + 0.2 } else { i }));
    says(&desk.succeed(&INIT), &["note: profiles: profile 3 (\"2.prof\", 101.4000 d): the bin at 0.00 km/s is "]);
}
