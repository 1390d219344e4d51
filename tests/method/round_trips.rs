//! Files read back identically: profiles, lists, light curves, tables, configs, chains, likelihood grids, manifests. A
//! file of lines cut anywhere gives the complete blocks before the cut.

use dimcmc::internals::data::io::csv::{Columns, Table, Words, quoted};
use dimcmc::internals::data::io::journal::{self, Journal};
use dimcmc::internals::data::io::lines::LineFile;
use dimcmc::internals::data::io::lsd::{self, Label};
use dimcmc::internals::data::io::{landscape, light_curve};
use dimcmc::internals::runs::manifest::{FILE, Manifest};
use dimcmc::internals::sampling::chain::{Chain, MoveKind, Record, Shape};
use dimcmc::internals::sampling::landscape::{Axis, Grid, Landscape, Node};
use dimcmc::internals::surface::photometry::Flux;
use dimcmc::{Config, Evaluation, Observations, Parameter, Prior, Profile, Run, Scene, Status};
use proptest::collection::vec;
use proptest::prelude::*;
use serde_json::json;
use std::path::Path;

/// Each property is tried so often.
const CASES: u32 = 32;

/// Any number that results may hold.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3f64, (-99.0..99.0f64, 0.1..9.9f64).prop_map(|(power, x)| x * 10f64.powf(power)), Just(-0.0)]
}

/// Profiles of a line, in noise, on one axis, with or without exposure times; and VRAD of each.
fn profiles() -> impl Strategy<Value = (Observations, Vec<f64>)> {
    let axis = (8..30usize, -300.0..300.0f64, 0.3..4.0f64, any::<bool>());
    let of_each = (0.01..3.0f64, 0.0..0.8f64, vec(-1.0..1.0f64, 30), -30.0..30.0f64, 0.5e-3..2e-3f64, 0.0..2e3f64);
    (axis, vec(of_each, 2..6)).prop_map(|((bins, first_velocity_kms, step_kms, exposed), all)| {
        let mut time_d = 2_459_000.5;
        let mut profile = |(wait, depth, noise, _, sigma, exposure): &(f64, f64, Vec<f64>, f64, f64, f64)| {
            time_d += wait;
            let line = |j: usize| 1.0 - depth * (-(j as f64 - 0.5 * bins as f64).powi(2) / 9.0).exp();
            Profile {
                time_d,
                first_velocity_kms,
                step_kms,
                intensity: (0..bins).map(|j| line(j) + sigma * noise[j]).collect(),
                sigma: vec![*sigma; bins],
                exposure_s: exposed.then_some(*exposure),
            }
        };
        let vrad = all.iter().map(|one| one.3).collect();
        (Observations { profiles: all.iter().map(&mut profile).collect() }, vrad)
    })
}

fn same_profiles(a: &Observations, b: &Observations) {
    assert_eq!((a.profiles.len(), a.times_d()), (b.profiles.len(), b.times_d()));
    let near = |a: f64, b: f64, error: f64| assert!((a - b).abs() <= error, "{a} is not {b}");
    for (a, b) in a.profiles.iter().zip(&b.profiles) {
        assert_eq!((a.intensity.len(), a.exposure_s), (b.intensity.len(), b.exposure_s));
        near(a.first_velocity_kms, b.first_velocity_kms, 1e-8);
        near(a.step_kms, b.step_kms, 1e-9);
        a.intensity.iter().zip(&b.intensity).for_each(|(a, b)| near(*a, *b, 1e-12));
        a.sigma.iter().zip(&b.sigma).for_each(|(a, b)| near(*a, *b, 1e-14));
    }
}

fn status() -> impl Strategy<Value = Status> {
    prop_oneof![Just(Status::Converged), Just(Status::Unreachable), Just(Status::StoppedShort), Just(Status::NonFinite)]
}

/// What a line of a chain holds beside its place.
type Line = (f64, Vec<f64>, bool, Status, Status, u32, Option<MoveKind>);

/// A chain.
fn chain() -> impl Strategy<Value = Chain> {
    let by = prop_oneof![Just(None), proptest::sample::select(MoveKind::ALL.to_vec()).prop_map(Some)];
    let line = (number(), vec(number(), 5), any::<bool>(), status(), status(), any::<u32>(), by);
    let shape = (1..3usize, 1..4usize, 1..4usize, 0..3usize);
    (shape, vec(line, 40)).prop_map(|((ensembles, walkers, parameters, numbers), lines)| {
        let names = |n: usize, first: &str| (0..n).map(|k| format!("{first}{k}")).collect();
        let shape = Shape { names: names(parameters, "p"), numbers: names(numbers, "n"), ensembles, walkers };
        let mut chain = Chain::new(shape.clone());
        for (step, lines) in lines.chunks_exact(shape.size()).enumerate() {
            let record = |(k, line): (usize, &Line)| {
                let (log_prob, values, accepted, status, proposed, model_applications, by) = line.clone();
                Record {
                    ensemble: k / walkers,
                    step,
                    walker: k % walkers,
                    accepted,
                    log_prob,
                    theta: values[..parameters].to_vec(),
                    numbers: values[parameters..parameters + numbers].to_vec(),
                    status,
                    proposed,
                    model_applications,
                    by,
                }
            };
            chain.push_step(&lines.iter().enumerate().map(record).collect::<Vec<_>>()).unwrap();
        }
        chain
    })
}

/// The whole blocks of `text` up to `cut`, whose blocks have `lines` lines.
fn whole(text: &[u8], cut: usize, lines: usize) -> usize {
    text[..cut].iter().filter(|byte| **byte == b'\n').count() / lines
}

fn place(share: f64, file: &Path) -> (Vec<u8>, usize) {
    let text = std::fs::read(file).unwrap();
    let cut = (share * text.len() as f64) as usize;
    (text, cut)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn profiles_and_lists((observations, vrad) in profiles()) {
        let dir = tempfile::tempdir().unwrap();
        let list = dir.path().join("observations.txt");
        lsd::write(dir.path(), &observations).unwrap();
        same_profiles(&lsd::read(&list).unwrap().observations, &observations);
        let label = |(k, vrad_kms): (usize, &f64)| {
            Label { file: format!("n {k}"), path: None, vrad_kms: *vrad_kms, line: 0 }
        };
        let labels: Vec<Label> = vrad.iter().enumerate().map(label).collect();
        lsd::write_as(dir.path(), &observations, &labels, "again").unwrap();
        let read = lsd::read(&list).unwrap();
        same_profiles(&read.observations, &observations);
        prop_assert_eq!(read.labels.iter().map(|label| label.vrad_kms).collect::<Vec<_>>(), vrad);
    }

    #[test]
    fn light_curves(rows in vec((0.001..5.0f64, 0.5..1.5f64, 1e-5..1e-2f64), 1..40)) {
        let dir = tempfile::tempdir().unwrap();
        let mut time_d = 2_459_000.5;
        let curve = rows.iter().map(|(wait, flux, sigma)| {
            time_d += wait;
            Flux { time_d, flux: *flux, sigma: *sigma }
        });
        let curve: Vec<Flux> = curve.collect();
        light_curve::write_to(&dir.path().join("light.csv"), &curve).unwrap();
        prop_assert_eq!(light_curve::read(&dir.path().join("light.csv")).unwrap().fluxes, curve);
    }

    #[test]
    fn tables(rows in vec((number(), number()), 1..20), words in vec("[ -~\u{b1}\u{3b1}]{0,12}", 1..20)) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table.csv");
        let mut table = Table::new(&["first", "second"]);
        rows.iter().for_each(|(a, b)| table.row(&[*a, *b]));
        std::fs::write(&path, table.into_bytes()).unwrap();
        let table = Columns::read(&path).unwrap();
        let bits = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(f64::to_bits).collect::<Vec<u64>>();
        let read = |name: &str| bits(&mut table.column(name).unwrap().iter().copied());
        prop_assert_eq!(read("first"), bits(&mut rows.iter().map(|row| row.0)));
        prop_assert_eq!(read("second"), bits(&mut rows.iter().map(|row| row.1)));
        let lines: String = words.iter().map(|word| format!("1,{}\n", quoted(word.trim()))).collect();
        std::fs::write(&path, format!("number,word\n{lines}")).unwrap();
        let table = Words::read(&path).unwrap();
        prop_assert_eq!(table.column("word").unwrap(), words.iter().map(|word| word.trim()).collect::<Vec<_>>());
    }

    #[test]
    fn configs(
        star in (0.5..10.0f64, 30.0..90.0f64, 5.0..90.0f64, 0.01..0.9f64, 1.0..8.0f64),
        orbit in (0.0..3.0f64, 0.1..20.0f64, -1.0..2.0f64),
        sampler in (1..6usize, 8..40usize, 1..100_000usize, any::<u32>(), 1.01..1.5f64),
        name in "[a-z]\\PC{0,12}",
    ) {
        let (ensembles, walkers, steps, seed, rhat) = sampler;
        let config = Config::default()
            .with("star.name", name)
            .with("star.rotation_period_d", star.0)
            .with("star.inclination_deg", star.1)
            .with("star.vsini_kms", star.2)
            .with("star.contrast", star.3)
            .with("star.line", json!({ "sigma_kms": star.4, "equivalent_width_kms": 6.0 }))
            .with("planet", json!({ "k_kms": orbit.0, "porb_over_prot": orbit.1, "phi": orbit.2 }))
            .with("observations.path", "observations.txt")
            .with("sampler", json!({
                "ensembles": ensembles, "walkers": 2 * walkers, "steps": steps, "seed": seed, "rhat": rhat
            }))
            .free(Parameter::K, Prior::Uniform { min: 0.0, max: orbit.0 + 1.0 })
            .free(Parameter::Phi, Prior::Periodic);
        let text = config.to_json();
        let read = Config::from_json(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        prop_assert_eq!(&read, &config);
        // filled in, it is what it is filled in with
        let resolved = read.resolved().unwrap();
        let again = Config::from_json(&resolved.to_string()).unwrap().resolved().unwrap();
        prop_assert_eq!(again, resolved);
    }

    #[test]
    fn chains(chain in chain(), share in 0.0..1.0f64) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("chain.jsonl");
        let shape = chain.shape().clone();
        let mut file = Journal::create(&path, shape.clone(), false).unwrap();
        (0..chain.steps()).for_each(|step| file.append(chain.step(step).unwrap()).unwrap());
        drop(file);
        prop_assert_eq!(&journal::read(&path, &shape).unwrap(), &chain);
        let (text, cut) = place(share, &path);
        std::fs::write(&path, &text[..cut]).unwrap();
        let (_, recovered) = Journal::recover(&path, shape.clone()).unwrap();
        let steps = whole(&text, cut, shape.size());
        prop_assert_eq!(recovered.records(), &chain.records()[..steps * shape.size()]);
        prop_assert!(text.starts_with(&std::fs::read(&path).unwrap()));
        prop_assert_eq!(journal::read_to_end(&path, &shape).unwrap(), (recovered, true));
    }

    #[test]
    fn landscapes(
        axes in vec((-1.0..1.0f64, 0.1..2.0f64, 2..4usize, any::<bool>()), 1..4),
        values in vec((number(), number(), any::<u32>(), status()), 27),
        share in 0.0..1.0f64,
    ) {
        let axis = |(k, (min, width, nodes, periodic)): (usize, &(f64, f64, usize, bool))| {
            Axis { name: format!("p{k}"), min: *min, max: min + width, nodes: *nodes, periodic: *periodic }
        };
        let grid = Grid { axes: axes.iter().enumerate().map(axis).collect() };
        let numbers = vec!["chi2".to_owned()];
        let mut made = Landscape::new(grid.clone(), numbers.clone());
        for (index, value) in values.iter().copied().take(grid.len()).enumerate() {
            let (log_prob, chi2, model_applications, status) = value;
            let evaluation = match status.is_failure() {
                true => Evaluation { log_prob: f64::NEG_INFINITY, numbers: Vec::new(), model_applications, status },
                false => Evaluation { log_prob, numbers: vec![chi2], model_applications, status },
            };
            made.push(Node { index, theta: grid.theta(index), evaluation }).unwrap();
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("landscape.jsonl");
        let mut file = LineFile::create(&path, false).unwrap();
        landscape::append(&mut file, &made, made.nodes()).unwrap();
        drop(file);
        prop_assert_eq!(&landscape::read(&path, grid.clone(), &numbers).unwrap(), &made);
        let (text, cut) = place(share, &path);
        std::fs::write(&path, &text[..cut]).unwrap();
        let (_, recovered) = landscape::recover(&path, grid, &numbers).unwrap();
        prop_assert_eq!(recovered.nodes(), &made.nodes()[..whole(&text, cut, 1)]);
    }
}

#[test]
fn manifests() {
    let config = json!({
        "star": {
            "rotation_period_d": 3.0, "inclination_deg": 60.0, "vsini_kms": 20.0, "contrast": 0.3,
            "line": { "sigma_kms": 4.0, "equivalent_width_kms": 6.0 }
        },
        "planet": { "k_kms": 0.3, "porb_over_prot": 1.7, "phi": 0.5 },
        "observations": { "simulate": {
            "spots": [[40, 30, 15, 0.9]], "cycles": [0.0, 0.2, 0.45, 0.7, 0.95, 1.2], "snr": 300, "pixels": 200,
            "velocity_kms": { "min": -30.0, "max": 30.0, "step": 5.0 }
        } },
        "imaging": { "objective": "spottedness", "pixels": 100 },
        "sampler": { "ensembles": 2, "walkers": 4, "steps": 2 },
        "parameters": { "k_kms": { "prior": "uniform", "min": 0, "max": 1 } }
    });
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("run");
    let scene = Scene::new(&Config::from_json(&config.to_string()).unwrap()).unwrap();
    drop(Run::new_in(&folder, &scene).unwrap());
    let made = Manifest::read(&folder).unwrap();
    let shape = made.shape();
    let values =
        (vec(number(), shape.size() + 3), any::<u64>(), proptest::option::of(any::<u32>()), vec(any::<u64>(), 0..3));
    let config = ProptestConfig { cases: CASES, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(values in values)| {
        let (numbers, seed, extend_to, merged_seeds) = values;
        let extend_to = extend_to.map(|step| step as usize);
        let mut manifest = Manifest { seed, extend_to, merged_seeds, ..made.clone() };
        let mut numbers = numbers.into_iter();
        manifest.start.iter_mut().flatten().flatten().zip(&mut numbers).for_each(|(x, number)| *x = number);
        manifest.origin.optimum.parameters.values_mut().zip(&mut numbers).for_each(|(x, number)| *x = number);
        manifest.origin.optimum.log_prob = numbers.next().unwrap();
        manifest.write(&folder).unwrap();
        prop_assert_eq!(Manifest::read(&folder).unwrap(), manifest);
        prop_assert!(folder.join(FILE).is_file());
    });
}
