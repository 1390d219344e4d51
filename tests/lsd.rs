//! LSD profiles in and out: the real formats, round trips, and one clear line for everything that can be wrong.

use dimcmc::io::lsd::{self, ReadOptions};
use dimcmc::observation::{Observations, Profile};
use std::path::{Path, PathBuf};

fn options(range: Option<(f64, f64)>) -> ReadOptions {
    ReadOptions { velocity_range_kms: range, ..ReadOptions::default() }
}

/// Two profiles of 11 bins and their list.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.prof", "b.prof"] {
        std::fs::write(dir.path().join(name), profile(11)).unwrap();
    }
    std::fs::write(dir.path().join("observations.txt"), "# list\na.prof 1.5 -2.0\n\nb.prof 2.5 # cloudy\n").unwrap();
    dir
}

fn profile(bins: usize) -> String {
    let rows: String = (0..bins).map(|j| format!("{:.1} 0.9{j} 0.001\n", -9.0 + 1.8 * j as f64)).collect();
    format!("title\n {bins} 2\n{rows}")
}

fn read(dir: &Path, options: &ReadOptions) -> Result<Observations, String> {
    lsd::read(&dir.join("observations.txt"), options).map(|d| d.observations).map_err(|e| e.to_string())
}

/// The message for a folder in which `file` was changed, without the path of the folder.
fn message(file: &str, change: impl Fn(String) -> String) -> String {
    message_with(file, change, &options(None))
}

fn message_with(file: &str, change: impl Fn(String) -> String, options: &ReadOptions) -> String {
    let dir = folder();
    let path = dir.path().join(file);
    std::fs::write(&path, change(std::fs::read_to_string(&path).unwrap())).unwrap();
    let message = read(dir.path(), options).unwrap_err();
    assert!(!message.contains('\n'), "{message}");
    message.replace(&format!("{}/", dir.path().display()), "")
}

#[test]
fn vrad_is_subtracted_before_the_cut() {
    let dir = folder();
    let read = read(dir.path(), &ReadOptions { velocity_range_kms: Some((-5.4, 5.4)), sigma_scale: 0.5 }).unwrap();
    assert_eq!(read.times_d(), [1.5, 2.5]);
    assert!((read.step_kms - 1.8).abs() < 1e-12);
    let [a, b] = &read.profiles[..] else { panic!() };
    // a: -9 + 2 + 1.8 = -5.2 up to 3.8 + ... <= 5.4; b: -5.4 to 5.4, edges included.
    assert!((a.first_velocity_kms + 5.2).abs() < 1e-9 && a.intensity.len() == 6, "{a:?}");
    assert!((b.first_velocity_kms + 5.4).abs() < 1e-9 && b.intensity.len() == 7, "{b:?}");
    assert_eq!((a.intensity[0], b.intensity[0]), (0.91, 0.92));
    assert_eq!(a.sigma[0], 0.0005);
}

#[test]
fn what_is_written_reads_back() {
    let profiles = (0..12).map(|k| Profile {
        time_d: 2456886.39347 + k as f64 / 7.0,
        first_velocity_kms: -50.4,
        intensity: (0..57).map(|j| 1.0 - 0.1 * ((j * k) as f64).sin().abs() / 3.0).collect(),
        sigma: vec![1e-3 / 3.0; 57],
    });
    let written = Observations { step_kms: 1.8, profiles: profiles.collect() };
    let dir = tempfile::tempdir().unwrap();
    lsd::write(dir.path(), &written).unwrap();
    let back = read(dir.path(), &options(Some((-50.4, 50.4)))).unwrap();
    assert!((back.step_kms - 1.8).abs() < 1e-9);
    for (w, b) in written.profiles.iter().zip(&back.profiles) {
        assert_eq!(w.time_d, b.time_d);
        assert!((w.first_velocity_kms - b.first_velocity_kms).abs() < 1e-9);
        assert!(w.intensity.iter().zip(&b.intensity).all(|(x, y)| (x - y).abs() < 1e-9));
        assert!(w.sigma.iter().zip(&b.sigma).all(|(x, y)| (x / y - 1.0).abs() < 1e-9));
        assert_eq!(w.intensity.len(), b.intensity.len());
    }
}

#[test]
fn the_fingerprint_is_that_of_the_bytes() {
    let dir = folder();
    let list = dir.path().join("observations.txt");
    let hash = |options: &ReadOptions| lsd::read(&list, options).unwrap().sha256;
    let before = hash(&options(None));
    assert_eq!(before.len(), 64);
    assert_eq!(before, hash(&options(Some((-5.4, 5.4)))));
    std::fs::write(dir.path().join("b.prof"), profile(11).replace("title", "other")).unwrap();
    assert_ne!(before, hash(&options(None)));
}

#[test]
fn faults_of_the_list_name_its_line() {
    let list = "observations.txt";
    let cases: [(&str, &str, &str); 6] = [
        ("b.prof 2.5", "b.prof", "observations.txt:4: 1 columns where FILE TIME_DAYS [VRAD_KMS] is due"),
        ("b.prof 2.5", "b.prof noon", "observations.txt:4: time \"noon\" is not a finite number"),
        ("b.prof 2.5", "b.prof NaN", "observations.txt:4: time \"NaN\" is not a finite number"),
        ("-2.0", "inf", "observations.txt:2: radial velocity \"inf\" is not a finite number"),
        ("b.prof 2.5", "b.prof 2 3 4", "observations.txt:4: 4 columns where FILE TIME_DAYS [VRAD_KMS] is due"),
        ("b.prof 2.5", "c.prof 2.5", "observations.txt:4: cannot read profile c.prof: No such file"),
    ];
    for (old, new, expected) in cases {
        let message = message(list, |text| text.replace(old, new));
        assert!(message.starts_with(expected), "{message}");
    }
    assert_eq!(message(list, |_| "# nothing\n\n".into()), "observations.txt: lists no profile");
    let absent = lsd::read(&PathBuf::from("/nowhere/observations.txt"), &options(None)).unwrap_err().to_string();
    assert!(absent.starts_with("/nowhere/observations.txt: cannot read: No such file"), "{absent}");
}

#[test]
fn faults_of_a_profile_name_its_line() {
    let cases: [(&str, &str, &str); 10] = [
        ("-9.0 0.90 0.001", "-9.0 0.90", "b.prof:3: 2 columns instead of 3"),
        ("-9.0 0.90 0.001", "-9.0 0.9O 0.001", "b.prof:3: \"0.9O\" is not a number"),
        ("-9.0 0.90 0.001", "-9.0 NaN 0.001", "b.prof:3: intensity is NaN, not a finite number"),
        ("-9.0 0.90 0.001", "-9.0 0.9 inf", "b.prof:3: sigma is inf, not a finite number"),
        ("-9.0 0.90 0.001", "-9.0 0.9 0", "b.prof:3: sigma is 0, it must be above 0"),
        ("-9.0 0.90 0.001", "-9.0 0.9 -0.001", "b.prof:3: sigma is -0.001, it must be above 0"),
        (" 11 2", " 12 2", "b.prof:2: announces 12 points, but 11 rows follow"),
        (" 11 2", " 10 2", "b.prof:13: more rows than the 10 points announced"),
        (" 11 2", " 11 4", "b.prof:2: announces 4 columns after the velocity, not 2 or 6"),
        ("-7.2 ", "-9.2 ", "b.prof:4: velocity -9.2 km/s does not increase from -9"),
    ];
    for (old, new, expected) in cases {
        assert_eq!(message("b.prof", |text| text.replacen(old, new, 1)), expected);
    }
    let bent = message("b.prof", |text| text.replacen("-5.4 ", "-5.3 ", 1));
    assert!(bent.starts_with("b.prof:5: velocity axis is not uniform: a step of 1.9"), "{bent}");
    assert_eq!(message("b.prof", |_| String::new()), "b.prof: holds 0 points, at least 5 are needed");
    assert_eq!(
        message("b.prof", |_| profile(12)),
        "b.prof: velocity axis (12 bins from -9.000 km/s in steps of 1.8000) differs from that of a.prof \
         (11 bins from -9.000 km/s in steps of 1.8000)"
    );
}

#[test]
fn a_velocity_range_must_hold_five_bins() {
    let with = |lo, hi| message_with("b.prof", |text| text, &options(Some((lo, hi))));
    assert_eq!(
        with(-3.0, 3.0),
        "a.prof: velocity range [-3, 3] km/s holds 3 bins, at least 5 are needed; the data reach \
         from -7.000 to 11.000 km/s after VRAD"
    );
    assert!(with(50.0, 60.0).contains("[50, 60] km/s lies outside the data; the data reach from"));
}

#[test]
fn no_text_makes_it_panic() {
    let base = profile(11);
    let pieces = ["", "\n", " ", "1e308", "-1e308", "NaN", "-", "2", "é\u{0}", "18446744073709551616", "\n 5 2\n"];
    for k in 0..2000 {
        let (at, piece) = ((k * 7919) % base.len(), pieces[k % pieces.len()]);
        let mutated = match k % 3 {
            0 => base[..at].to_string(),
            1 => format!("{}{piece}{}", &base[..at], &base[at..]),
            _ => format!("{}{piece}{}", &base[..at], &base[(at + 1 + k % 11).min(base.len())..]),
        };
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a.prof"), &mutated).unwrap();
        std::fs::write(dir.path().join("observations.txt"), "a.prof 0\n").unwrap();
        if let Err(message) = read(dir.path(), &options(Some((-6.0, 6.0)))) {
            assert!(!message.contains('\n'), "{message}");
        }
    }
}

#[test]
fn the_oracle_s_profiles_are_read() {
    let list = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/oracle/observations.txt");
    let data = lsd::read(&list, &options(Some((-50.4, 50.4)))).unwrap().observations;
    assert_eq!((data.profiles.len(), data.len()), (50, 50 * 57));
    assert_eq!(data.profiles[1].time_d, 0.18);
}

/// The data may not be distributed with the program, so that this runs where they are.
#[test]
fn the_profiles_of_lo_peg_are_read() {
    let list = &Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/lopeg/observations.txt");
    if list.exists() {
        let data = lsd::read(list, &options(Some((-90.0, 90.0)))).unwrap().observations;
        assert_eq!((data.profiles.len(), data.profiles[0].intensity.len()), (16, 100));
        assert!((data.mean_equivalent_width_kms() - 2.7175).abs() < 1e-3);
    }
}
