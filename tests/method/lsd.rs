//! LSD profiles in and out: the real formats, round trips, and one clear line for everything that can be wrong.

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
        ("-9.0 0.90 0.001", "-9.0 0.90", "b.prof:3: 2 columns instead of 3"),
        ("-9.0 0.90 0.001", "-9.0 0.9O 0.001", "b.prof:3: \"0.9O\" is not a number"),
        ("-9.0 0.90 0.001", "-9.0 NaN 0.001", "b.prof:3: intensity is NaN, not a finite number"),
        ("-9.0 0.90 0.001", "-9.0 0.9 inf", "b.prof:3: sigma is inf, not a finite number"),
        ("-9.0 0.90 0.001", "-9.0 0.9 0", "b.prof:3: sigma is 0, it must be above 0"),
        ("-9.0 0.90 0.001", "-9.0 0.9 -0.001", "b.prof:3: sigma is -0.001, it must be above 0"),
        (" 11 2", " 12 2", "b.prof:2: announces 12 points, but 11 rows follow"),
        (" 11 2", " 10 2", "b.prof:13: more rows than the 10 points announced"),
        (" 11 2", " 11 4", "b.prof:2: announces 4 columns after the velocity, not 2, 6 or 8"),
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
        (&[56886.4, 6887.4, 56888.4], 2, "time 6887.4 is 137 years from time 56886.4 in line 1: another zero point"),
        (&fortnight, 1, "the times span 3833 years from here on: days are due; if these are seconds (16.204 d in all)"),
        (&night, 1, "no two of the times are nearer than 1800 days to each other: days are due; if these are seconds"),
        (&[1.4e9, 1.4001e9], 1, "time 1.4e9 is beyond sense in days; divide seconds by 86400"),
        (&[0.0, 1.0, -1e300], 3, "is beyond sense in days"),
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
    assert!(message.contains("observations.txt:1: radial velocity -1.98e4 is beyond sense in km/s"), "{message}");
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
    ];
    for (name, text) in formats {
        let data = read_text(text).unwrap_or_else(|message| panic!("{name}: {message}"));
        assert_eq!(data.observations, expected.observations, "{name}");
        assert!(data.remarks.is_empty(), "{name}: {:?}", data.remarks);
    }
    let several = format!("    41     2   1000 1.0E+00\n{}    900 1.0E+00\n{}", ilsd(), ilsd().replace("E-03", "E-02"));
    let data = read_text(several).unwrap();
    assert_eq!(data.observations, expected.observations);
    assert_eq!(data.remarks, ["all of them: the first of 2 mean profiles in the file is used"]);
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
            "a.lsd:1: no row of numbers (with decimal points) here or below: \"-40;",
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
