//! `plot` as users run it: every folder gives its figures, and injected values are drawn at their place.

use crate::desk::{Desk, says, two_spots};
use crate::shared;
use crate::svg::{extent, middle, paths, placed, texts};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde_json::{Value, json};

const CONFIG: &str = "config.json";

/// A star with static spots, for figures of one map, and for chains of K and phase that tests write.
fn unchanging() -> Value {
    let mut config = two_spots(json!({ "ensembles": 4, "walkers": 8, "steps": 30, "ess": 100, "rhat": 1.1 }));
    config["observations"]["simulate"]["spots"][1] = json!([250, 10, 15, 0.9]);
    config
}

const FIGURES: [(&str, &[&str]); 7] = [
    ("simulate", &["map", "profiles"]),
    ("map", &["maps", "maps_mollweide", "changes", "profiles", "residuals", "rv"]),
    ("periodogram", &["periodogram", "rv"]),
    ("optimise", &["optimum"]),
    ("grid", &["landscape"]),
    ("sample", &["corner", "traces", "autocorrelation"]),
    ("compare", &["comparison"]),
];

#[test]
fn every_folder_has_its_figures() {
    let desk = shared::desk();
    for (folder, figures) in FIGURES {
        let said = desk.succeed(&["plot", folder]);
        let files: Vec<String> = figures.iter().flat_map(|f| [format!("{f}.svg"), format!("{f}.png")]).collect();
        says(&said, &[&format!("written  {folder}/figures: {}", files.join(", "))]);
        // the same bytes again, whatever the number of threads
        desk.succeed(&["plot", folder, "--out", "again", "--threads", "1", "--force"]);
        for file in &files {
            let read = |folder: &str| std::fs::read(desk.path(&format!("{folder}/{file}"))).unwrap();
            let bytes = read(&format!("{folder}/figures"));
            assert!(bytes == read("again"), "{folder}: {file}");
            let starts = if file.ends_with("png") { &b"\x89PNG"[..] } else { b"<svg" };
            assert!(bytes.starts_with(starts), "{folder}: {file}");
        }
        // every figure describes its content, in names that a reader knows
        for figure in figures {
            let svg = desk.read(&format!("{folder}/figures/{figure}.svg"));
            assert!(svg.contains("<title>") && !svg.contains("NaN") && !svg.contains("_kms"), "{folder}: {figure}");
        }
    }
    for (file, labels) in [
        ("sample/figures/corner.svg", &["K (m/s)", "φ (cycles to max. RV)", "spot lifetime (d)", "injected"][..]),
        ("sample/figures/traces.svg", &["step", "ensemble 2", "burn-in"]),
        (
            "map/figures/rv.svg",
            &[
                "RV (km/s)",
                "spot-corrected RV (m/s)",
                "residual (m/s)",
                "time (d)",
                "rotation cycle",
                "model",
                "assumed orbit",
            ],
        ),
        ("map/figures/rv.svg", &["orbital phase (0: maximal RV)", "K = 200 m/s, P = 5.100 d = 1.700 Prot"]),
        ("map/figures/residuals.svg", &["velocity (km/s)", "rotation phase", "uncertainties (σ)"]),
        (
            "simulate/figures/map.svg",
            &["phase 0", "rotation", "longitude", "latitude", "observed phases", "+60°", "spot filling factor"],
        ),
        ("map/figures/maps.svg", &["0.62 d", "mean standard deviation", "phase 0", "rotation", "spot filling factor"]),
        ("map/figures/maps_mollweide.svg", &["0.62 d", "mean standard deviation", "−30°", "270°"]),
        ("map/figures/changes.svg", &["observed − static map", "observed − evolving maps", "time (d)"]),
        ("periodogram/figures/periodogram.svg", &["period (d)", "Δ ln L", "window", "0.1 %", "Prot/2", "injected"]),
        ("grid/figures/landscape.svg", &["√Δχ2", "Δχ2 = 2.30, 5.99", "paraboloid"]),
        ("compare/figures/comparison.svg", &["chain", "paraboloid", "landscape", "injected"]),
    ] {
        let svg = desk.read(file);
        for label in labels {
            assert!(texts(&svg).contains(label), "{file}: {label} is not among {:?}", texts(&svg));
        }
    }

    figures_say_what_the_files_do(&desk);

    // over the likelihood grid, the chain
    desk.succeed(&["plot", "grid", "--with", "sample", "--out", "with"]);
    let (with, without) = (desk.read("with/landscape.svg"), desk.read("grid/figures/landscape.svg"));
    assert!(paths(&without, "chain").is_empty() && paths(&with, "chain").len() >= 2);
    // 2.30 and 5.99 above the minimum: their roots times as wide as the error bars of the vertex
    let (ellipses, bars) = (paths(&with, "paraboloid"), paths(&with, "vertex"));
    assert_eq!((ellipses.len(), bars.len()), (2, 2));
    for (line, level) in ellipses.iter().zip([2.30_f64, 5.99]) {
        for (k, bar) in bars.iter().enumerate() {
            let width = |[low, high]: [f64; 2]| high - low;
            let (ellipse, bar) = (width(extent(line)[k]), width(extent(bar)[k]));
            // hundredths of a point in the file
            assert!((ellipse - level.sqrt() * bar).abs() < 0.3, "{level}: {ellipse} {bar}");
        }
    }
}

/// The figures of the shared star, compared with their files.
fn figures_say_what_the_files_do(desk: &Desk) {
    let near = |a: f64, b: f64| (a - b).abs() < 0.03;
    // the highest place of a smooth curve is the highest peak, whose period is written beside it; the day is marked
    let svg = desk.read("periodogram/figures/periodogram.svg");
    let peak = &desk.json("periodogram/periodogram.json")["peaks"][0];
    let [period_d, sigma_d] = ["period_d", "sigma_period_d"].map(|key| peak[key].as_f64().unwrap());
    let digits = (1.0 - sigma_d.log10().floor()) as usize;
    let period = format!("highest: {period_d:.digits$} d");
    assert!(texts(&svg).contains(&period.as_str()) && texts(&svg).contains(&"1 d"), "{period}: {:?}", texts(&svg));
    let curve = svg.split("<path class=\"delta-ln-l\" d=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!(curve.contains('C'), "straight lines from period to period");
    let (points, marker) = (paths(&svg, "delta-ln-l"), middle(&paths(&svg, "highest")[0]));
    let top = points[0].iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
    // the curve goes from trial period to trial period, the summit lies between two, and the spots of the best orbit
    // are those beside the planet, which moves its period by a part of its error
    let [low, high] = extent(&points[0])[0];
    let range = |key: &str| desk.json("periodogram/periodogram.json")["search"][key].as_f64().unwrap();
    let error = (high - low) * (sigma_d / period_d) / (range("max_period_d") / range("min_period_d")).ln();
    let apart = (top[0] - marker[0]).abs();
    assert!(apart < 0.5 * error && near(top[1], marker[1]), "{top:?} {marker:?} {error}");
    // only thresholds that the program uses are drawn, and they are labelled
    let svg = desk.read("sample/figures/autocorrelation.svg");
    assert!(!texts(&svg).contains(&"steps/50"));
    let said = if desk.json("sample/summary.json")["converged"] == true { "converged" } else { "not converged" };
    let criterion = format!("{said}: R-hat ≤ 1.1, ESS ≥ 80");
    assert!(texts(&svg).contains(&criterion.as_str()), "{:?}", texts(&svg));
    // blue below zero, white, red above it, and grey where nothing was observed
    let svg = desk.read("map/figures/residuals.svg");
    let scale: Vec<&str> =
        svg.split("<path class=\"scale\"").skip(1).map(|rest| rest.split("/>").next().unwrap()).collect();
    assert!(scale.last().unwrap().contains("#67001f") && scale.iter().any(|cell| cell.contains("#ffffff")));
    assert_eq!(paths(&svg, "not-observed").len(), 3);
    // zero is in the middle of the residual velocities
    let svg = desk.read("map/figures/rv.svg");
    let (zero, frames) = (middle(&paths(&svg, "zero")[0]), paths(&svg, "frame"));
    assert!(frames.iter().any(|frame| near(middle(frame)[1], zero[1])), "{zero:?}");
    // the contours of the likelihood grid lie under all lines, and no line hides them
    let svg = desk.read("grid/figures/landscape.svg");
    let place = |class: &str| svg.find(&format!("<path class=\"{class}\""));
    assert!(svg.rfind("<path class=\"contour\"") < place("paraboloid") && place("paraboloid") < place("truth-point"));
    let width = |class: &str| -> f64 {
        let rest = &svg[place(class).unwrap()..];
        rest.split("stroke-width=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    assert!(width("contour") > 2.0 * width("paraboloid") && place("paraboloid-ground").is_none());
}

/// A run of which K, a period with a log-uniform prior, and a phase that may be anything are known.
#[test]
fn corners_have_titles_of_their_width_logarithmic_axes_and_numbers_that_do_not_touch() {
    let desk = Desk::new(unchanging());
    let free = json!({ "k_kms": { "prior": "uniform", "min": 0.0, "max": 2.0 }, "phi": { "prior": "periodic" },
                       "porb_over_prot": { "prior": "log-uniform", "min": 0.4, "max": 9.0 } });
    desk.set("/parameters", free);
    // convergence is irrelevant here
    crate::desk::dimcmc(&["sample", CONFIG, "--out", "run"], &desk.path(""));
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut text = String::new();
    for step in 0..60 {
        for (ensemble, walker) in (0..4).flat_map(|e| (0..8).map(move |w| (e, w))) {
            let [k, ratio, phi]: [f64; 3] = rng.random();
            let line = json!({
                "ensemble": ensemble, "step": step, "walker": walker, "accepted": true,
                "log_prob": -1.0, "k_kms": 0.4 + 1.5 * k,
                "porb_over_prot": 0.4 * (9.0_f64 / 0.4).powf(ratio), "phi": phi, "spottedness": 0.05, "chi2": 1.0,
                "status": "converged", "proposed": "converged", "model_applications": 10
            });
            text += &format!("{line}\n");
        }
    }
    desk.write("run/chain.jsonl", &text);
    desk.succeed(&["plot", "run", "--out", "out"]);
    let svg = desk.read("out/corner.svg");
    assert!(texts(&svg).contains(&"Porb (d)"), "{:?}", texts(&svg));
    let all = placed(&svg);
    // titles: above the panel, no wider than it, and no number where none means anything
    let is_title = |text: &str| text.contains("unconstrained") || text.contains('±') || text.contains('+');
    let titles: Vec<_> = all.iter().filter(|one| is_title(one.text)).collect();
    assert_eq!((titles.len(), titles[2].text.contains("unconstrained")), (3, true), "{:?}", texts(&svg));
    let frames = paths(&svg, "frame");
    let side = extent(&frames[0])[0][1] - extent(&frames[0])[0][0];
    for title in &titles {
        let [left, right] = title.x;
        assert!(right - left < side + 1.0, "{}: {left} {right}", title.text);
    }
    // 5, 10 and 20 d are as far from each other
    let baseline = all.iter().map(|one| one.y).filter(|y| all.iter().filter(|one| one.y == *y).count() > 4);
    let baseline = baseline.fold(0.0, f64::max);
    let numbers: Vec<_> = all.iter().filter(|one| one.y == baseline).collect();
    let centre = |text: &str| {
        let found = numbers.iter().find(|one| one.text == text && one.x[0] > extent(&frames[0])[0][1]);
        let found = found.unwrap_or_else(|| panic!("{text} is not among {:?}", texts(&svg)));
        0.5 * (found.x[0] + found.x[1])
    };
    let (first, second) = (centre("10") - centre("5"), centre("20") - centre("10"));
    assert!((first - second).abs() < 1.0, "{first} {second}");
    // numbers do not overlap
    let mut ends: Vec<[f64; 2]> = numbers.iter().map(|one| one.x).collect();
    ends.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert!(ends.windows(2).all(|pair| pair[0][1] + 2.0 < pair[1][0]), "{ends:?}");
}

/// Two seasons 300 d apart have a panel each in every row, and no orbit is drawn through the gap between them.
#[test]
fn gaps_between_seasons_are_gaps() {
    let desk = Desk::new(unchanging());
    let mut cycles = unchanging()["observations"]["simulate"]["cycles"].as_array().unwrap().clone();
    cycles.truncate(6);
    let later: Vec<Value> = cycles.iter().map(|cycle| json!(cycle.as_f64().unwrap() + 100.0)).collect();
    cycles.extend(later);
    desk.set("/observations/simulate/cycles", json!(cycles));
    desk.succeed(&["map", CONFIG, "--out", "map"]);
    desk.succeed(&["plot", "map"]);
    let svg = desk.read("map/figures/rv.svg");
    // three rows of two, and two that are folded
    let (frames, orbits) = (paths(&svg, "frame"), paths(&svg, "orbit"));
    assert_eq!((frames.len(), orbits.len()), (8, 3));
    let [first, second] = [0, 1].map(|k| extent(&frames[k])[0]);
    assert!(first[1] + 5.0 < second[0], "{first:?} {second:?}");
    for (orbit, frame) in orbits.iter().zip([first, second]) {
        let [left, right] = extent(orbit)[0];
        assert!(left >= frame[0] - 0.1 && right <= frame[1] + 0.1, "{left} {right} {frame:?}");
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let desk = shared::desk();
    says(&desk.refusal(&["plot", "absent"]), &["absent", "no such folder"]);
    std::fs::create_dir(desk.path("empty")).unwrap();
    says(&desk.refusal(&["plot", "empty"]), &["empty", "nothing to draw", "map.json", "manifest.json"]);
    desk.write("map/figures", "mine");
    says(&desk.refusal(&["plot", "map"]), &["map/figures", "not a folder"]);
    says(
        &desk.refusal(&["plot", "map", "--with", "run", "--out", "out"]),
        &["--with run: map holds no likelihood grid"],
    );
    desk.succeed(&["plot", "map", "--out", "out"]);
    desk.write("out/mine.txt", "precious");
    desk.refusal(&["plot", "map", "--out", "out"]);
    desk.succeed(&["plot", "map", "--out", "out", "--force"]);
    assert_eq!(desk.read("out/mine.txt"), "precious");
    // a run that has only begun has figures nevertheless
    std::fs::remove_file(desk.path("sample/summary.json")).unwrap();
    let lines: Vec<String> = desk.read("sample/chain.jsonl").lines().map(|line| format!("{line}\n")).collect();
    for steps in [1, 2, 5] {
        desk.write("sample/chain.jsonl", &lines[..shared::ENSEMBLES * shared::WALKERS * steps].concat());
        desk.succeed(&["plot", "sample", "--out", "begun", "--force"]);
    }
    desk.write("sample/chain.jsonl", "");
    says(&desk.refusal(&["plot", "sample", "--out", "new"]), &["sample/chain.jsonl", "no complete step"]);
    // files that are wrong, by name and line
    let profiles = desk.read("map/profiles.csv");
    desk.write("map/profiles.csv", &crate::desk::with_line(&profiles, 5, "0,1,2"));
    says(&desk.refusal(&["plot", "map", "--out", "new"]), &["map/profiles.csv:5:", "3 columns instead of 9"]);
    desk.write("map/profiles.csv", &profiles.replacen("sigma", "error", 1));
    says(&desk.refusal(&["plot", "map", "--out", "new"]), &["map/profiles.csv", "no column sigma"]);
    desk.edit("map/map.json", |map| map.replace("\"ring_pixels\"", "\"rings\""));
    says(&desk.refusal(&["plot", "map", "--out", "new"]), &["map/map.json", "ring_pixels"]);
}

#[test]
fn a_spot_is_drawn_at_its_longitude() {
    let desk = Desk::new(unchanging());
    desk.succeed(&["map", CONFIG, "--out", "map"]);
    let map = desk.json("map/map.json");
    let numbers =
        |key: &str| -> Vec<f64> { map[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect() };
    let (longitude, latitude) = (numbers("longitude_deg"), numbers("latitude_deg"));
    for (at, east) in [(90.0, [1.0, 0.0]), (180.0, [0.0, -1.0]), (270.0, [-1.0, 0.0])] {
        // one pixel of a mid-latitude
        let distance = |k: &usize| (longitude[*k] - at).abs() + (latitude[*k] - 30.0).abs();
        let dark = (0..longitude.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        let mut map = map.clone();
        map["spot_filling"] = (0..longitude.len()).map(|k| if k == dark { 1.0 } else { 0.0 }).collect();
        desk.write("map/map.json", &map.to_string());
        desk.succeed(&["plot", "map", "--out", "out", "--force"]);
        let svg = desk.read("out/map.svg");
        // the first star is the reconstructed one, in polar projection
        let star = extent(&paths(&svg, "star")[0]);
        let (pole, radius) = (star.map(|[low, high]| 0.5 * (low + high)), 0.5 * (star[0][1] - star[0][0]));
        let spot = middle(&paths(&svg, "pixels")[0]);
        // latitude -30 is at the edge
        let r = radius * (90.0 - latitude[dark]) / 120.0;
        let (sin, cos) = longitude[dark].to_radians().sin_cos();
        let found = [spot[0] - pole[0], spot[1] - pole[1]];
        // the middle of a pixel's outline is not quite its centre, which is 8 degrees wide
        assert!((found[0] - r * sin).hypot(found[1] - r * cos) < 0.02 * radius, "{at}: {found:?}");
        // 90 degrees are to the right, where the star recedes from an observer below
        assert!(found[0] * east[0] + found[1] * east[1] > 0.9 * r, "{at}: {found:?}");
    }
    // the injected spot at longitude 30 and latitude 40
    let svg = desk.read("out/map.svg");
    let star = middle(&paths(&svg, "star")[0]);
    let rim = middle(&paths(&svg, "injected-spot")[0]);
    let angle = (rim[0] - star[0]).atan2(rim[1] - star[1]).to_degrees();
    assert!((angle - 30.0).abs() < 2.0, "{angle}");
}

/// A run whose chain is a Gaussian of known centre and spread, correlated by 0.6; the phase is wrapped to [0, 1).
fn gaussian_run(desk: &Desk, centre: [f64; 2], sd: [f64; 2]) {
    desk.succeed(&["sample", CONFIG, "--out", "run", "--force"]);
    let mut manifest = desk.json("run/manifest.json");
    manifest["truth"]["k_kms"] = json!(centre[0]);
    manifest["truth"]["phi"] = json!(centre[1].rem_euclid(1.0));
    desk.write("run/manifest.json", &manifest.to_string());
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut text = String::new();
    for step in 0..400 {
        for (ensemble, walker) in (0..4).flat_map(|e| (0..8).map(move |w| (e, w))) {
            let [u, v]: [f64; 2] = [rng.sample(StandardNormal), rng.sample(StandardNormal)];
            let (k, phi) = (centre[0] + sd[0] * u, centre[1] + sd[1] * (0.6 * u + 0.8 * v));
            let line = json!({
                "ensemble": ensemble, "step": step, "walker": walker, "accepted": true,
                "log_prob": -0.5 * (u * u + v * v),
                "k_kms": k, "phi": phi.rem_euclid(1.0), "spottedness": 0.05, "chi2": 1.0, "status": "converged",
                "proposed": "converged", "model_applications": 10
            });
            text += &format!("{line}\n");
        }
    }
    desk.write("run/chain.jsonl", &text);
}

#[test]
fn a_known_gaussian_has_its_contours_and_a_phase_wraps() {
    let desk = Desk::new(unchanging());
    for centre in [[0.3, 0.5], [0.3, 0.99]] {
        gaussian_run(&desk, centre, [0.02, 0.03]);
        desk.succeed(&["plot", "run", "--out", "out", "--force"]);
        let svg = desk.read("out/corner.svg");
        let (inner, outer) = (paths(&svg, "area68"), paths(&svg, "area95"));
        assert_eq!((inner.len(), outer.len()), (1, 1), "one pair of parameters");
        // the injected values are those of the centre: 12,800 independent draws place it to a hundredth of its width,
        // their noise on a contour is some hundredths
        let truth = middle(&paths(&svg, "truth-point")[0]);
        let (found, [x, y]) = (middle(&inner[0]), extent(&inner[0]));
        assert!((found[0] - truth[0]).abs() < 0.06 * (x[1] - x[0]), "{centre:?}: {found:?} {truth:?}");
        assert!((found[1] - truth[1]).abs() < 0.06 * (y[1] - y[0]), "{centre:?}: {found:?} {truth:?}");
        // 68 % of two Gaussian parameters reach to 1.510 standard deviations, 95 % to 2.448, the interval of one to 1
        // (0.994)
        let interval = extent(&paths(&svg, "interval68")[0])[0];
        let width = |[low, high]: [f64; 2]| high - low;
        let (one, inner, outer) = (width(interval), width(x), width(extent(&outer[0])[0]));
        assert!((inner / one / (1.510 / 0.994) - 1.0).abs() < 0.08, "{centre:?}: {}", inner / one);
        assert!((outer / inner / (2.448 / 1.510) - 1.0).abs() < 0.08, "{centre:?}: {}", outer / inner);
    }
    // around 0.99 the axis runs on beyond 1, or below 0, in one piece
    let svg = desk.read("out/corner.svg");
    assert!(texts(&svg).iter().any(|text| ["1.00", "1.0"].contains(text)), "{:?}", texts(&svg));
    assert!(texts(&svg).iter().any(|text| text.starts_with("1.0") && *text > "1.00"), "{:?}", texts(&svg));
}
