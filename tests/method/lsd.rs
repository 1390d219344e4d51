//! LSD profiles in and out: the real formats, round trips, and one clear line for every error.

use dimcmc::internals::data::io::lsd;
use dimcmc::internals::star::observation::{Observations, Profile};
use std::path::{Path, PathBuf};

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

/// First and last velocity used.
type Range = Option<(f64, f64)>;

fn read(dir: &Path, range: Range, sigma_scale: f64) -> Result<Observations, String> {
    let used = lsd::read(&dir.join("observations.txt")).and_then(|all| all.within(range, sigma_scale));
    used.map_err(|e| e.to_string())
}

/// The message for a folder in which `file` was changed, without the path of the folder.
fn message(file: &str, change: impl Fn(String) -> String) -> String {
    message_with(file, change, None)
}

fn message_with(file: &str, change: impl Fn(String) -> String, range: Range) -> String {
    let dir = folder();
    let path = dir.path().join(file);
    std::fs::write(&path, change(std::fs::read_to_string(&path).unwrap())).unwrap();
    let message = read(dir.path(), range, 1.0).unwrap_err();
    assert!(!message.contains('\n'), "{message}");
    message.replace(&format!("{}/", dir.path().display()), "")
}

#[test]
fn vrad_is_subtracted_before_the_cut() {
    let dir = folder();
    let read = read(dir.path(), Some((-5.4, 5.4)), 0.5).unwrap();
    assert_eq!(read.times_d(), [1.5, 2.5]);
    assert!((read.step_kms() - 1.8).abs() < 1e-12);
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
        step_kms: 1.8,
        intensity: (0..57).map(|j| 1.0 - 0.1 * ((j * k) as f64).sin().abs() / 3.0).collect(),
        sigma: vec![1e-3 / 3.0; 57],
        exposure_s: None,
    });
    let written = Observations { profiles: profiles.collect() };
    let dir = tempfile::tempdir().unwrap();
    lsd::write(dir.path(), &written).unwrap();
    let back = read(dir.path(), Some((-50.4, 50.4)), 1.0).unwrap();
    assert!((back.step_kms() - 1.8).abs() < 1e-9);
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
    let hash = || lsd::read(&list).unwrap().sha256.unwrap();
    let before = hash();
    assert_eq!(before.len(), 64);
    assert_eq!(before, hash());
    std::fs::write(dir.path().join("b.prof"), profile(11).replace("title", "other")).unwrap();
    assert_ne!(before, hash());
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
    let absent = lsd::read(&PathBuf::from("/nowhere/observations.txt")).unwrap_err().to_string();
    assert!(absent.starts_with("/nowhere/observations.txt: cannot read: No such file"), "{absent}");
}

#[test]
fn faults_of_a_profile_name_its_line() {
    let cases: [(&str, &str, &str); 10] = [
        ("-9.0 0.90 0.001", "-9.0 0.90", "b.prof:3: 2 columns instead of 3: velocity, I and sigma are due"),
        ("-9.0 0.90 0.001", "-9.0 0.9O 0.001", "b.prof:3: \"0.9O\" is not a number"),
        ("0.0 0.95 0.001", "0.0 NaN 0.001", "b.prof:8: intensity is NaN, not a finite number"),
        ("0.0 0.95 0.001", "0.0 0.9 inf", "b.prof:8: sigma is inf, not a finite number"),
        ("0.0 0.95 0.001", "0.0 0.9 0", "b.prof:8: sigma is 0, it must be above 0"),
        ("0.0 0.95 0.001", "0.0 0.9 -0.001", "b.prof:8: sigma is -0.001, it must be above 0"),
        (" 11 2", " 12 2", "b.prof:2: announces 12 points, but 11 rows follow"),
        (" 11 2", " 10 2", "b.prof:13: more rows than the 10 points announced"),
        (" 11 2", " 11 4", "b.prof:2: announces 4 columns after the velocity, not 2, 6 or 8"),
        ("-7.2 ", "-9.2 ", "b.prof:4: velocity -9.2 km/s does not increase from -9"),
    ];
    for (old, new, expected) in cases {
        let message = message("b.prof", |text| text.replacen(old, new, 1));
        let rest = message.strip_prefix(expected).unwrap_or_else(|| panic!("{message}"));
        assert!(rest.is_empty() || rest.starts_with(", within the velocity range in use: "), "{message}");
    }
    let bent = message("b.prof", |text| text.replacen("-5.4 ", "-5.3 ", 1));
    assert!(bent.starts_with("b.prof:5: velocity axis is not uniform: a step of 1.9"), "{bent}");
    assert_eq!(message("b.prof", |_| String::new()), "b.prof: holds 0 points, at least 5 are needed");
    let finer: String = (0..12).map(|j| format!("{:.1} 0.9 0.001\n", -9.0 + 1.7 * f64::from(j))).collect();
    assert_eq!(
        message("b.prof", |_| finer.clone()),
        "b.prof: velocity axis (12 bins from -9.000 km/s in steps of 1.7000) differs from that of a.prof \
         (11 bins from -9.000 km/s in steps of 1.8000), in the width of the bins: resample the profiles onto one axis"
    );
    let shifted: String = (0..11).map(|j| format!("{:.2} 0.9 0.001\n", -8.37 + 1.8 * f64::from(j))).collect();
    let message = message("b.prof", |_| shifted.clone());
    assert!(message.contains("by 0.35 of a bin") && message.contains("its velocity (0.6300 km/s here) in the third"));
}

#[test]
fn a_velocity_range_must_hold_five_bins() {
    let with = |lo, hi| message_with("b.prof", |text| text, Some((lo, hi)));
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
    let pieces = [
        "",
        "\n",
        " ",
        "1e308",
        "-1e308",
        "NaN",
        "-",
        "2",
        "é\u{0}",
        "18446744073709551616",
        "\n 5 2\n",
        ",",
        ";",
        "v,I,sigma\n",
    ];
    for k in 0..2000 {
        let (at, piece) = ((k * 7919) % base.len(), pieces[k % pieces.len()]);
        let mutated = match k % 3 {
            0 => base[..at].to_string(),
            1 => format!("{}{piece}{}", &base[..at], &base[at..]),
            _ => format!("{}{piece}{}", &base[..at], &base[(at + 1 + k % 11).min(base.len())..]),
        };
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("a.prof"), &mutated).unwrap();
        std::fs::write(dir.path().join("b.prof"), &base).unwrap();
        std::fs::write(dir.path().join("observations.txt"), "a.prof 0\nb.prof 1\n").unwrap();
        if let Err(message) = read(dir.path(), Some((-6.0, 6.0)), 1.0) {
            assert!(!message.contains('\n'), "{message}");
        }
    }
}

#[test]
fn the_oracle_s_profiles_are_read() {
    let list = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/oracle/observations.txt");
    let data = lsd::read(&list).unwrap().within(Some((-50.4, 50.4)), 1.0).unwrap();
    assert_eq!((data.profiles.len(), data.len()), (50, 50 * 57));
    assert_eq!(data.profiles[1].time_d, 0.18);
}

/// A list of profiles that are all there.
fn listed(list: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in list.lines().filter_map(|line| line.split_whitespace().next()) {
        std::fs::write(dir.path().join(name), profile(11)).unwrap();
    }
    std::fs::write(dir.path().join("observations.txt"), list).unwrap();
    dir
}

fn list_of(times: &[f64]) -> String {
    times.iter().enumerate().map(|(k, time)| format!("{k}.prof {time}\n")).collect()
}

#[test]
fn times_that_are_not_days_of_one_count_are_refused_by_line() {
    let night: Vec<f64> = (0..8).map(|k| 1800.0 * f64::from(k)).collect();
    let fortnight: Vec<f64> = (0..8).map(|k| 2e5 * f64::from(k)).collect();
    let cases: [(&[f64], usize, &str); 11] = [
        (&[2456886.4, 2456887.4, 56888.4], 3, "MJD is JD - 2400000.5"),
        (&[2456886.4, 56887.4, 56888.4], 1, "MJD is JD - 2400000.5"),
        (&[56886.4, 2456887.4], 2, "MJD is JD - 2400000.5"),
        (&[2456886.4, 6887.4, 2456888.4], 2, "a Julian date beside another count of days"),
        (&[56886.4, 6887.4, 56888.4], 2, "time 6887.4 is 137 years from time 56886.4 in line 1: another time system"),
        (&fortnight, 1, "the times span 3833 years from here on: days are due; if these are seconds (16.204 d in all)"),
        (&night, 1, "no two of the times are nearer than 1800 days to each other: days are due; if these are seconds"),
        (&[1.4e9, 1.4001e9], 1, "time 1.4e9 is no time in days; divide seconds by 86400"),
        (&[0.0, 1.0, -1e300], 3, "is no time in days"),
        (&[0.5, 1.5, 0.5], 3, "2.prof has the time 0.5 of 0.prof in line 1: is it the same profile?"),
        (&[2456886.4], 1, "the only profile of the list"),
    ];
    for (times, line, expected) in cases {
        let message = read(listed(&list_of(times)).path(), None, 1.0).unwrap_err();
        assert!(message.contains(&format!("observations.txt:{line}: ")) && message.contains(expected), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }
    for twice in ["a.prof 1.5\nb.prof 2.5\na.prof 3.5\n", "a.prof 1.5\nb.prof 2.5\n./a.prof 3.5 -1.0\n"] {
        let message = read(listed(twice).path(), None, 1.0).unwrap_err();
        assert!(message.contains("observations.txt:3: ") && message.contains("a.prof is listed in line 1 already"));
    }
    let message = read(listed("a.prof 0 -19800\nb.prof 1 -19800\n").path(), None, 1.0).unwrap_err();
    assert!(message.contains("observations.txt:1: radial velocity -1.98e4 is no velocity in km/s"), "{message}");
}

#[test]
fn times_that_people_have_are_taken() {
    let season: Vec<f64> = (0..9).map(|k| 2450000.0 + 365.25 * f64::from(k)).collect();
    let cases: [&[f64]; 6] =
        [&[0.0, 0.18], &[-3.5, 0.0, 700.0], &[2456886.4, 2456901.6], &[56886.4, 58886.4], &season[..2], &season];
    for times in &cases[..5] {
        read(listed(&list_of(times)).path(), None, 1.0).unwrap();
    }
    // once a year is no way to observe a rotating star, but with a second visit in one of the years it is taken
    let visited: Vec<f64> = season.iter().copied().chain([2450003.0]).collect();
    read(listed(&list_of(&visited)).path(), None, 1.0).unwrap();
}

/// A line of 41 bins, `I`, `sigma` and `V` at each, by what writes one row.
fn line(row: impl Fn(f64, f64, f64) -> String) -> String {
    let at = |j: i32| {
        let v = 2.0 * f64::from(j);
        let depth = 0.3 * (-v * v / 200.0).exp();
        row(v, 1.0 - depth, 1e-3 * v / 10.0 * depth)
    };
    (-20..=20).map(at).collect()
}

/// A data set of `text` and the same one at another time.
fn read_text(text: impl AsRef<[u8]>) -> Result<lsd::ProfileSet, String> {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.lsd", "b.lsd"] {
        std::fs::write(dir.path().join(name), text.as_ref()).unwrap();
    }
    let list = dir.path().join("observations.txt");
    std::fs::write(&list, "a.lsd 0\nb.lsd 1\n").unwrap();
    lsd::read(&list).map_err(|e| e.to_string().replace(&format!("{}/", dir.path().display()), ""))
}

/// LSDpy, SpecpolFlow, iLSD and CSV, as their sources write them, and what people do to them.
#[test]
fn every_format_gives_the_same_profile() {
    let expected = read_text(line(|v, i, _| format!("{v:.2} {i:.5e} 1.0e-3\n"))).unwrap();
    let two = || line(|v, i, _| format!("{v:>12.6} {i:>13.5e} 1.0e-3\n"));
    let six = || line(|v, i, p| format!("{v:>12.6} {i:>13.5e}  1.0e-3 {p:>13.6e}  1e-4  0.0e0  1e-4\n"));
    let eight = || line(|v, i, p| format!("{v:>12.6} {i:>13.5e}  1.0e-3 {p:>13.6e} 1e-4 0.0e0 1e-4 2e-5 1e-4\n"));
    let ilsd = || line(|v, i, _| format!("{v:8.2} {i:13.5e} 1.00000E-03\n"));
    let csv = || line(|v, i, _| format!("{v},{i:.5e},1e-3\n"));
    let formats = [
        ("LSDpy", format!("***LSD profile normalizing: d=0.200 lande=1.2\n 41 6\n{}", six())),
        ("SpecpolFlow", format!("#LSD profile\n 41 8\n{}", eight())),
        ("no header, null 2", eight()),
        ("comments", format!("# LO Peg\n* reduced\n! by hand\n#\n 41 2\n# v I sigma\n{}", two())),
        ("titles", format!("LSD of LO Peg, 2014 Aug 16\nESPaDOnS, Libre-Esprit\nnight one\n 41 2\n{}", two())),
        ("iLSD", format!("    41     1   1000 1.0137E+00\n{}", ilsd())),
        ("CSV", format!("velocity,intensity,sigma\n{}", csv())),
        ("CSV by other names", format!("\u{feff}RV (km/s), I/Ic, \"Error\",\n{}", csv().replace('\n', ",\n"))),
        ("CSV, no header", csv()),
        ("numpy", format!("# vel_kms,stokesI,sigI\n{}", csv())),
        ("CSV, order", format!("name;sig;Flux;v\n{}", line(|v, i, _| format!("x;1e-3;{i:.5e};{v}\n")))),
        ("blanks, order", format!("sigma v I\n{}", line(|v, i, _| format!("1e-3 {v} {i:.5e}\n")))),
        ("tabs and CRLF", format!("star\n41\t2\n{}", two()).replace(' ', "\t").replace('\n', "\r\n")),
        ("units in a comment", format!("# velocity (km/s)  I/Ic  sigma\n{}", two())),
        ("Stokes V", format!("velocity,I,sigma_I,V,sigma_V,N,sigma_N\n{}", csv().replace('\n', ",0.1,2e-4,0,2e-4\n"))),
        ("rdb", format!("vrad\tflux\terr\n----\t---\t---\n{}", line(|v, i, _| format!("{v}\t{i:.5e}\t1e-3\n")))),
        ("units below", format!("velocity;I;sigma\nkm/s;;\n{}", csv().replace(',', ";"))),
        ("four columns", line(|v, i, _| format!("{v} {i:.5e} 1e-3 0\n"))),
        ("Fortran", line(|v, i, _| format!("{v:.1}D+00 {} 1.0d-03\n", format!("{i:.5e}").replace('e', "D")))),
        ("descending", two().lines().rev().map(|row| format!("{row}\n")).collect()),
        ("minus of print", csv().replace("-4", "\u{2212}4").replace("-2", "\u{2212}2")),
        ("bad end", format!("v I sigma\n-46 nan nan\n-44 1 0\n-42 -- --\n{}42 1e9 1\nnan nan nan\n", two())),
        ("zeros at the ends", format!("v I sigma\n-44 0 1e-3\n-42 0 0.1\n{}42 -1 1e-3\n", two())),
        ("weightless end", format!("{}42 0.9 1e5\n", two())),
    ];
    for (name, text) in formats {
        let data = read_text(text).unwrap_or_else(|message| panic!("{name}: {message}"));
        let (read, due) = (&data.observations.profiles[0], &expected.observations.profiles[0]);
        assert_eq!((&read.intensity, &read.sigma), (&due.intensity, &due.sigma), "{name}");
        assert!((read.first_velocity_kms - due.first_velocity_kms).abs() < 1e-9, "{name}");
        assert!((read.step_kms - due.step_kms).abs() < 1e-12, "{name}");
        let left_out = data.remarks
            == ["all of them: bins without data (no number, no or a huge sigma, zeros) at the ends left out"];
        assert_eq!(left_out, name.contains("end") && name != "descending", "{name}: {:?}", data.remarks);
        assert!(left_out || data.remarks.is_empty(), "{name}: {:?}", data.remarks);
    }
    let several = format!("    41     2   1000 1.0E+00\n{}    900 1.0E+00\n{}", ilsd(), ilsd().replace("E-03", "E-02"));
    let data = read_text(several).unwrap();
    assert_eq!(data.observations, expected.observations);
    assert_eq!(data.remarks, ["all of them: the first of 2 mean profiles in the file is used"]);
}

/// The second of two profiles, its text changed, read where a range of velocities is used.
fn second(list: &str, text: impl AsRef<[u8]>, range: Range) -> Result<Profile, String> {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("LO Peg")).unwrap();
    std::fs::write(dir.path().join("a.lsd"), line(|v, i, _| format!("{v:.2} {i:.5e} 1.0e-3\n"))).unwrap();
    for name in ["b.lsd", "LO Peg/b.lsd"] {
        std::fs::write(dir.path().join(name), text.as_ref()).unwrap();
    }
    let path = dir.path().join("observations.txt");
    std::fs::write(&path, list).unwrap();
    let read = lsd::read_around(&path, range).and_then(|all| all.within(range, 1.0));
    read.map(|mut all| all.profiles.remove(1))
        .map_err(|e| e.to_string().replace(&format!("{}/", dir.path().display()), ""))
}

const LIST: &str = "a.lsd 0\nb.lsd 1\n";

#[test]
fn bad_bins_do_no_harm_outside_of_the_range_in_use() {
    let good = line(|v, i, _| format!("{v:.2} {i:.5e} 1.0e-3\n"));
    for (row, bad) in [("nan nan", "intensity is NaN"), ("1.0 0", "sigma is 0"), ("-9e9 1", "not in units")] {
        let text =
            line(|v, i, _| if v == -30.0 { format!("{v:.2} {row}\n") } else { format!("{v:.2} {i:.5e} 1.0e-3\n") });
        let range = Some((-28.0, 40.0));
        assert_eq!(second(LIST, &text, range), second(LIST, &good, range));
        let message = second(LIST, &text, Some((-30.0, 40.0))).unwrap_err();
        assert!(message.starts_with("b.lsd:6: ") && message.contains(bad), "{message}");
        assert!(message.contains(", within the velocity range in use: interpolate the bin"), "{message}");
        // with VRAD the range is of the star
        let list = "a.lsd 0\nb.lsd 1 4\n";
        assert!(second(list, &text, Some((-34.0, 36.0))).is_err());
        assert_eq!(second(list, &text, Some((-32.0, 36.0))).unwrap().first_velocity_kms, -32.0);
    }
}

#[test]
fn profiles_may_begin_and_end_elsewhere_on_the_same_bins() {
    let good = second(LIST, line(|v, i, _| format!("{v:.2} {i:.5e} 1.0e-3\n")), Some((-36.0, 36.0))).unwrap();
    let longer = line(|v, i, _| {
        let before = if v == -40.0 { "-44 1 1e-3\n-42 1 1e-3\n" } else { "" };
        format!("{before}{v:.2} {i:.5e} 1.0e-3\n")
    });
    assert_eq!(second(LIST, longer, Some((-36.0, 36.0))).unwrap(), good);
    let shifted = |by: f64| line(|v, i, _| format!("{:.2} {i:.5e} 1.0e-3\n", v + by));
    // VRAD makes the axes equal
    let moved = second("a.lsd 0\nb.lsd 1 13.7\n", shifted(13.7), Some((-36.0, 36.0))).unwrap();
    assert_eq!((moved.intensity, moved.first_velocity_kms), (good.intensity.clone(), -36.0));
    let message = second(LIST, shifted(0.7), None).unwrap_err();
    assert!(message.contains("by 0.35 of a bin") && message.contains("third column"), "{message}");
}

#[test]
fn velocities_may_be_rounded_in_print() {
    let rows = |digits: usize| line(|v, i, _| format!("{:.digits$} {i:.5e} 1.0e-3\n", 0.4117 * v));
    let [exact, rounded] = [4, 1].map(|digits| read_text(rows(digits)).unwrap().observations);
    assert!((exact.step_kms() / rounded.step_kms() - 1.0).abs() < 2e-3);
    assert!((exact.profiles[0].first_velocity_kms - rounded.profiles[0].first_velocity_kms).abs() < 0.05);
}

#[test]
fn lists_as_people_write_them() {
    let text = line(|v, i, _| format!("{v:.2} {i:.5e} 1.0e-3\n"));
    let due = second("a.lsd 0\nb.lsd 1.5 -2\n", &text, None).unwrap();
    for list in [
        "\u{feff}a.lsd 0\r\nb.lsd 1.5 -2\r\n",
        "a.lsd 0\n\"LO Peg/b.lsd\" 1.5 -2\n",
        "a.lsd 0\n'LO Peg/b.lsd' 1.5 \u{2212}2 # cloudy\n",
        "a.lsd\t0\nLO Peg/b.lsd\t1.5\t-2\n",
        "a.lsd,0\nb.lsd, 1.5, -2\n",
        "file;time;vrad\na.lsd;0;0\nb.lsd;1.5D0;-2.0\n",
        "# list\nTime (d), Filename, VRAD (km/s)\n0, a.lsd, 0\n1.5, \"LO Peg/b.lsd\", -2\n",
    ] {
        assert_eq!(second(list, &text, None).as_ref(), Ok(&due), "{list:?}");
    }
    for (list, cure) in [
        ("a.lsd 0\nLO Peg/b.lsd 1.5\n", "observations.txt:2: time \"Peg/b.lsd\" is not a finite number; the name of a"),
        ("a.lsd 0\nb.lsd 1,5\n", "observations.txt:2: time \"1,5\" has a decimal comma"),
        ("SIMPLE  =      T", "observations.txt: is a FITS file; a list of profiles is text"),
    ] {
        let message = second(list, &text, None).unwrap_err();
        assert!(message.starts_with(cure), "{message}");
    }
}

#[test]
fn a_wild_bin_is_named_with_its_profile() {
    let dir = tempfile::tempdir().unwrap();
    let list: String = (0..6).map(|k| format!("{k}.lsd {k}.5\n")).collect();
    for k in 0..6 {
        let noise = |v: f64| 1e-3 * (v * v * 3.7 + f64::from(k)).sin();
        let cosmic = |v: f64| if k == 4 && v == 12.0 { 0.1 } else { 0.0 };
        let text = line(|v, i, _| format!("{v} {:.6} 1e-3\n", i + noise(v) + cosmic(v)));
        std::fs::write(dir.path().join(format!("{k}.lsd")), text).unwrap();
    }
    std::fs::write(dir.path().join("observations.txt"), list).unwrap();
    let remarks = lsd::read(&dir.path().join("observations.txt")).unwrap().remarks;
    assert!(remarks.len() == 1, "{remarks:?}");
    assert!(remarks[0].starts_with("profile 5 (\"4.lsd\", 4.5000 d): the bin at 12.00 km/s is "), "{remarks:?}");
}

#[test]
fn files_that_are_no_text_are_named_with_the_cure() {
    let fits = format!("SIMPLE  = {:>20}{}", "T", " ".repeat(2850));
    let message = second(LIST, fits, None).unwrap_err();
    assert!(message.starts_with("b.lsd: is a FITS file; a profile is text"), "{message}");
    assert!(message.contains("`Table.read(\"b.lsd\").write(\"profile.csv\")`"), "{message}");
    assert!(second(LIST, b"\x1f\x8b\x08\0", None).unwrap_err().contains("is a compressed file"));
    let decimal = line(|v, i, _| format!("{v:.1} {i:.4} 0.001\n").replace('.', ","));
    let message = second(LIST, decimal, None).unwrap_err();
    assert!(message.starts_with("b.lsd:1: \"-40,0\" has a decimal comma"), "{message}");
}

#[test]
fn what_is_no_intensity_is_turned_into_it_or_refused() {
    let expected = read_text(line(|v, i, _| format!("{v} {i:.6} 1e-3\n"))).unwrap().observations;
    let noise = |v: f64| 0.01 * (37.0 * v).sin();
    let depth = read_text(line(|v, i, _| format!("{v} {:.6} 1e-3\n", 1.0 - i))).unwrap();
    let excess = read_text(line(|v, i, _| format!("{v} {:.6} 1e-3\n", i - 1.0))).unwrap();
    for (data, said) in [(depth, "given as 1 - I (continuum at 0, line above it)"), (excess, "given as I - 1")] {
        for (got, wanted) in data.observations.profiles.iter().zip(&expected.profiles) {
            assert!(got.intensity.iter().zip(&wanted.intensity).all(|(g, w)| (g - w).abs() < 1e-9));
        }
        assert!(data.remarks.len() == 1 && data.remarks[0].contains(said), "{:?}", data.remarks);
    }
    // shallow and noisy
    let noisy = read_text(line(|v, i, _| format!("{v} {:.6} 1e-2\n", 0.1 * (1.0 - i) + noise(v)))).unwrap();
    assert!(noisy.remarks[0].contains("1 - I"));
    let stokes_v = read_text(line(|v, _, p| format!("{v} {p:.6} 1e-3\n"))).unwrap_err();
    assert!(
        stokes_v.contains("a.lsd: the continuum is at 0, with as much above as below it: is it Stokes V"),
        "{stokes_v}"
    );
    // noise around a deep line with a little continuum is I
    assert!(
        read_text(line(|v, i, _| format!("{v} {:.6} 1e-2\n", 2.5 * i - 1.5 + noise(v)))).unwrap().remarks.is_empty()
    );
}

#[test]
fn faults_of_other_formats_name_their_line() {
    let csv = || line(|v, i, _| format!("{v},{i:.5e},1e-3\n"));
    let cases: [(String, &str); 12] = [
        (format!("wavelength,flux,error\n{}", csv()), "a.lsd:1: names no column as the velocity: velocity (or v, vel)"),
        (format!("v,flux,snr\n{}", csv()), "a.lsd:1: names no column as the sigma"),
        (format!("v,I,I\n{}", csv()), "a.lsd:1: columns 2 and 3 are both named as the intensity"),
        (format!("v (m/s),I,sigma\n{}", csv()), "a.lsd:1: the velocity is in m/s, km/s is due"),
        (format!("v,I,sigma\n{}v,I,sigma\n{}", csv(), csv()), "a.lsd:43: \"v\" is not a number"),
        (format!("v,I,sigma\n{}", csv().replace("1e-3", "1e-3,0")), "a.lsd:2: 4 columns instead of 3"),
        (
            line(|v, i, _| format!("{v};{};0,001\n", format!("{i:.4}").replace('.', ","))),
            "a.lsd:1: \"0,9999\" has a decimal comma: write numbers with decimal points",
        ),
        (format!(" 41 1 1000 1.0\n{}", csv().replace(',', " ").repeat(2)), "a.lsd:43: more rows than the 41 points"),
        (format!(" 42 1 1000 1.0\n{}", csv().replace(',', " ")), "a.lsd:1: announces 42 points, but 41 rows follow"),
        (
            line(|v, i, _| format!("{} {i} 1e-3\n", 1000.0 * v)),
            "a.lsd:1: velocity -40000 km/s is too large; is it in m/s?",
        ),
        ("# nothing\n".into(), "a.lsd: holds 0 points"),
        (String::new(), "a.lsd: holds 0 points"),
    ];
    for (text, expected) in cases {
        let message = read_text(&text).unwrap_err();
        assert!(message.starts_with(expected), "{message}\n{}", text.lines().next().unwrap_or_default());
        assert!(!message.contains('\n'), "{message}");
    }
    let binary: Vec<u8> = (0..100_000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    assert!(!read_text(binary).unwrap_err().contains('\n'));
    let gzip = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3];
    assert!(!read_text(gzip).unwrap_err().contains('\n'));
}

/// The data may not be distributed with the program, so that this runs where they are.
#[test]
fn the_profiles_of_lo_peg_are_read() {
    let list = &Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/lopeg/observations.txt");
    if list.exists() {
        let data = lsd::read(list).unwrap().within(Some((-90.0, 90.0)), 1.0).unwrap();
        assert_eq!((data.profiles.len(), data.profiles[0].intensity.len()), (16, 100));
        assert!((data.mean_equivalent_width_kms() - 2.7175).abs() < 1e-3);
    }
}

/// Exposure times stand in a column that is named, and in no other.
#[test]
fn exposure_times_are_of_a_named_column() {
    let dir = folder();
    let exposures = |list: &str| {
        std::fs::write(dir.path().join("observations.txt"), list).unwrap();
        let read = read(dir.path(), None, 1.0)?;
        Ok::<_, String>(read.profiles.iter().map(|p| (p.first_velocity_kms, p.exposure_s)).collect::<Vec<_>>())
    };
    let both = [(-9.0, Some(600.0)), (-10.8, Some(1200.0))];
    for list in [
        "# file time_d vrad_kms exposure_s\na.prof 1.5 0 600\nb.prof 2.5 1.8 1200 # cloudy\n",
        "# two nights\n#\n# File  BJD  vrad (km/s)  exposure (s)\n\na.prof 1.5 0 600\nb.prof 2.5 1.8 1200\n",
        "file,time_d,exposure_s,vrad_kms\na.prof,1.5,600,0\nb.prof,2.5,1200,1.8\n",
        "exptime file time rv\n600 a.prof 1.5 0\n1200 b.prof 2.5 1.8\n",
    ] {
        assert_eq!(exposures(list).unwrap(), both, "{list}");
    }
    // without a velocity, and of one profile alone
    let list = "# file time_d exposure_s\na.prof 1.5 600\nb.prof 2.5\n";
    assert_eq!(exposures(list).unwrap(), [(-9.0, Some(600.0)), (-9.0, None)]);
    // a third column without a name is a velocity, whatever other comments say
    for list in [
        "# file time_d vrad_kms\na.prof 1.5 0\nb.prof 2.5 1.8\n",
        "# file, time and exposure: see the log\na.prof 1.5\nb.prof 2.5 1.8\n",
        "a.prof 1.5 0\n# file time_d exposure_s\nb.prof 2.5 1.8\n",
    ] {
        assert_eq!(exposures(list).unwrap(), [(-9.0, None), (-10.8, None)], "{list}");
    }
    for (list, wanted) in [
        (
            "a.prof 1.5 0 600\nb.prof 2.5 0 600\n",
            "observations.txt:1: 4 columns where FILE TIME_DAYS [VRAD_KMS] is due",
        ),
        ("a.prof 1.5 0 600\nb.prof 2.5 0 600\n", "a first line `# file time_d vrad_kms exposure_s` names more columns"),
        (
            "# file time_d exposure_s\na.prof 1.5 600\nb.prof 2.5 long\n",
            "observations.txt:3: exposure time \"long\" is",
        ),
        (
            "# file time_d exposure_s\na.prof 1.5 -600\nb.prof 2.5 1\n",
            "observations.txt:2: exposure time -600 s must be",
        ),
    ] {
        let message = exposures(list).unwrap_err();
        assert!(message.contains(wanted) && !message.contains('\n'), "{message}");
    }
    // what is written reads back
    std::fs::write(dir.path().join("observations.txt"), "# file time_d exposure_s\na.prof 1.5 600\nb.prof 2.5\n")
        .unwrap();
    let all = lsd::read(&dir.path().join("observations.txt")).unwrap();
    for write in [0, 1] {
        let other = tempfile::tempdir().unwrap();
        match write {
            0 => lsd::write(other.path(), &all.observations).unwrap(),
            _ => lsd::write_as(other.path(), &all.observations, &all.labels, "again").unwrap(),
        }
        let again = lsd::read(&other.path().join("observations.txt")).unwrap();
        let seconds = |all: &Observations| all.profiles.iter().map(|p| p.exposure_s).collect::<Vec<_>>();
        assert_eq!(seconds(&again.observations), seconds(&all.observations));
    }
}
