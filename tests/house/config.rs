//! Configs: those that ship resolve, their resolved form is stable, and every mistake gets one line that names file and
//! key.

use dimcmc::internals::data::calibrated::star_for;
use dimcmc::internals::data::config::{self, Config, ConfigError, ObservationSource, SPECTROGRAPHS, Settings};
use dimcmc::internals::model::{Parameter, Prior};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn load(path: &Path) -> Result<Settings, ConfigError> {
    Config::load(path)?.settings()
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name)
}

fn demo() -> Value {
    serde_json::from_slice(&std::fs::read(shipped("demo.json")).unwrap()).unwrap()
}

fn lopeg() -> Value {
    serde_json::from_slice(&std::fs::read(shipped("lopeg.json")).unwrap()).unwrap()
}

fn resolve(config: &Value) -> Result<Settings, String> {
    config::from_json(config.to_string().as_bytes(), Path::new("dir/x.json")).map_err(|e| e.to_string())
}

/// `config` with the value at `pointer` replaced, inserted, or (by `Value::Null`) taken away.
fn with(mut config: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = config.pointer_mut(parent).unwrap_or_else(|| panic!("{pointer}"));
    match (parent, value) {
        (Value::Object(map), Value::Null) => drop(map.remove(key)),
        (Value::Object(map), value) => drop(map.insert(key.into(), value)),
        (Value::Array(items), value) => items[key.parse::<usize>().unwrap()] = value,
        _ => panic!("{pointer}"),
    }
    config
}

fn message(config: &Value) -> String {
    let Err(message) = resolve(config) else { panic!("accepted: {config}") };
    assert!(!message.contains('\n'), "{message}");
    message.strip_prefix("dir/x.json").unwrap_or_else(|| panic!("{message}")).to_string()
}

#[test]
fn the_demo_resolves() {
    let settings = load(&shipped("demo.json")).unwrap();
    let parameters: Vec<Parameter> = settings.free.iter().map(|f| f.parameter).collect();
    assert_eq!(parameters, [Parameter::K, Parameter::PorbOverProt, Parameter::Phi]);
    assert_eq!(settings.free[2].prior, Prior::Periodic);
    assert_eq!(settings.values[Parameter::OmegaEq], std::f64::consts::TAU / 3.0);
    // Planck at 550 nm, 3500 K over 5500 K, and 2.5 km/s with c / 65000 / 2.3548 = 1.9586 km/s in quadrature.
    assert!((settings.star.contrast - 0.0654).abs() < 1e-3, "{}", settings.star.contrast);
    assert!((settings.star.line.sigma_kms - 3.1759).abs() < 1e-3);
    let ObservationSource::Simulate(simulation) = &settings.sets[0].source else { panic!() };
    assert_eq!((simulation.spots.len(), simulation.times_d.len(), simulation.bins), (12, 50, 57));
    assert!((simulation.times_d[49] - 2.94 * 3.0).abs() < 1e-12);
    assert_eq!(simulation.truth, settings.values);
    let plan = settings.require_grid().unwrap();
    let period = &plan.grid.axes[1];
    assert_eq!((plan.grid.len(), period.value(0), period.value(14)), (3375, 1.2, 2.2));
    assert_eq!(plan.free, settings.free, "the landscape and the chain have the same reference");
}

#[test]
fn the_seven_dimensional_config_starts_off_the_truth() {
    let settings = load(&shipped("paper_7d.json")).unwrap();
    assert_eq!(settings.free.len(), 7);
    let ObservationSource::Simulate(simulation) = &settings.sets[0].source else { panic!() };
    let demo = load(&shipped("demo.json")).unwrap();
    assert_eq!(simulation.truth, demo.values);
    // Widths of `docs/method.md` section 5; gamma times Omega_eq for the shear.
    let sigma = [0.0106, 0.073, 0.041, 0.00038 * 2.0944, 0.00093 * 2.0944, 0.46, 0.022];
    for (free, sigma) in settings.free.iter().zip(sigma) {
        let p = free.parameter;
        let off = (settings.values[p] - simulation.truth[p]) / sigma;
        assert!((off - 3.0).abs() < 0.01, "{}: {off}", p.name());
    }
}

#[test]
fn the_landscape_of_the_paper_is_of_the_same_data() {
    let settings = load(&shipped("paper_grid.json")).unwrap();
    let seven = load(&shipped("paper_7d.json")).unwrap();
    assert_eq!((&settings.sets[0].source, &settings.star), (&seven.sets[0].source, &seven.star));
    let ObservationSource::Simulate(simulation) = &settings.sets[0].source else { panic!() };
    assert_eq!(settings.values, simulation.truth);
    let plan = settings.require_grid().unwrap();
    assert_eq!((plan.grid.len(), settings.imaging.pixels), (3375, 5000));
    assert_eq!(plan.free, settings.free, "chain and landscape have the same reference");
}

#[test]
fn lo_peg_resolves() {
    let settings = load(&shipped("lopeg.json")).unwrap();
    assert_eq!(settings.sets[0].star.line.equivalent_width_kms, None);
    let ObservationSource::Files { path, velocity_range_kms, sigma_scale, .. } = &settings.sets[0].source else {
        panic!()
    };
    assert!(path.ends_with("configs/../../shared/data/lopeg/observations.txt"));
    assert_eq!((*velocity_range_kms, *sigma_scale), (Some((-68.0, 68.0)), 1.0));
    let list = &Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/lopeg/observations.txt");
    if list.exists() {
        let data = dimcmc::internals::data::io::lsd::read(list).unwrap().within(*velocity_range_kms, 1.0).unwrap();
        assert!((star_for(&settings, &settings.sets[0], &data).unwrap().line.strength_kms() - 2.6700).abs() < 1e-3);
    }
}

#[test]
fn the_resolved_form_is_a_config_with_the_same_fingerprint() {
    let minimal = json!({
        "star": { "rotation_period_d": 3, "inclination_deg": 38, "vsini_kms": 40, "contrast": 0.1,
                  "line": { "sigma_kms": 2.5, "equivalent_width_kms": "auto" } },
        "observations": { "path": "observations.txt" },
        "parameters": { "inclination_deg": { "prior": "isotropic" },
                        "k_kms": { "prior": "normal", "mean": 0.1, "sd": 0.1 } }
    });
    for config in [minimal.clone(), demo(), lopeg()] {
        let settings = resolve(&config).unwrap();
        let again = resolve(&settings.resolved).unwrap();
        assert_eq!(again.resolved, settings.resolved);
        assert_eq!(again.sha256, settings.sha256);
        assert_eq!(again.free, settings.free);
    }
    let resolved = resolve(&minimal).unwrap().resolved;
    assert_eq!(resolved["imaging"]["chi2_target"], 0.97);
    assert_eq!(resolved["imaging"]["objective"], "marginal-likelihood");
    assert_eq!(resolved["imaging"]["unresolved_spots"], "fitted");
    assert_eq!(resolved["sampler"]["walkers"], 16);
    let observations = json!({ "path": "observations.txt", "sigma_scale": 1.0, "velocity_jitter_kms": "fitted" });
    assert_eq!(resolved["observations"], observations);
    let unchanging = resolve(&with(minimal, "/imaging", json!({ "objective": "spottedness" }))).unwrap().resolved;
    assert_eq!(unchanging["sampler"]["walkers"], 32);
    assert_eq!(unchanging["observations"], json!({ "path": "observations.txt", "sigma_scale": 1.0 }));
    assert_eq!(resolved["parameters"]["inclination_deg"]["max"], 90.0);
}

/// The contract with users, word for word.
const INTERFACE_EXAMPLE: &str = r#"{
  "star": {
    "rotation_period_d": 3.0, "epoch_d": 0.0,
    "inclination_deg": 38.0, "vsini_kms": 40.0, "vsys_kms": 0.0, "domega_rad_d": 0.0,
    "limb_darkening": { "law": "linear", "coefficients": [0.65] },
    "photosphere_k": 5500.0, "spot_k": 3500.0, "wavelength_nm": 550.0,
    "line": { "shape": "gaussian", "sigma_kms": 2.5, "equivalent_width_kms": 5.8 }
  },
  "instrument": { "resolving_power": 65000.0 },
  "planet": { "k_kms": 0.1, "porb_over_prot": 1.7, "phi": 0.5 },
  "observations": { "path": "observations.txt", "velocity_range_kms": [-50.4, 50.4] },
  "imaging": { "pixels": 5000, "default_spot": 1e-4, "chi2_target": 0.97, "objective": "spottedness" },
  "parameters": {
    "k_kms":          { "prior": "uniform", "min": 0.0, "max": 0.3 },
    "porb_over_prot": { "prior": "uniform", "min": 0.5, "max": 4.0 },
    "phi":            { "prior": "periodic" }
  },
  "sampler": { "ensembles": 4, "walkers": 32, "steps": 2000, "seed": 1, "rhat": 1.01, "ess": 1000 },
  "grid": { "axes": { "k_kms": [0.0, 0.2, 15], "porb_over_prot": [1.2, 2.2, 15], "phi": [0.3, 0.7, 15] } }
}"#;

#[test]
fn the_example_of_the_interface_resolves() {
    let settings = config::from_json(INTERFACE_EXAMPLE.as_bytes(), Path::new("dir/x.json")).unwrap();
    let is_there = |path: &Path| path == Path::new("dir/observations.txt");
    assert!(matches!(&settings.sets[0].source, ObservationSource::Files { path, .. } if is_there(path)));
    assert_eq!((settings.imaging.pixels, settings.free.len()), (5000, 3));
}

#[test]
fn only_what_may_change_on_resuming_leaves_the_fingerprint() {
    let before = resolve(&demo()).unwrap().sha256;
    let after = |pointer: &str, value: Value| resolve(&with(demo(), pointer, value)).unwrap().sha256;
    for (pointer, value) in [
        ("/sampler/steps", json!(5000)),
        ("/sampler/rhat", json!(1.1)),
        ("/sampler/ess", json!(10)),
        ("/grid", Value::Null),
        ("/star/wavelength_nm", json!(550)),
        ("/star/name", json!("LO Peg")),
    ] {
        assert_eq!(after(pointer, value), before, "{pointer}");
    }
    for (pointer, value) in [
        ("/sampler/walkers", json!(34)),
        ("/sampler/seed", json!(2)),
        ("/imaging/objective", json!("entropy")),
        ("/parameters/k_kms/max", json!(0.4)),
        ("/observations/simulate/snr", json!(900)),
    ] {
        assert_ne!(after(pointer, value), before, "{pointer}");
    }
}

/// A name gives what is not given beside it, and a new name takes both numbers.
#[test]
fn a_spectrograph_has_a_name() {
    let instrument = |value: Value| resolve(&with(demo(), "/instrument", value));
    let resolved = |value: Value| {
        let Settings { star, stability_kms, resolved, .. } = instrument(value).unwrap();
        (star.line.sigma_kms, stability_kms, resolved["instrument"].clone())
    };
    for row in &SPECTROGRAPHS {
        let (sigma_kms, stability_kms, written) = resolved(json!({ "name": row.name.to_lowercase() }));
        assert_eq!(sigma_kms, resolved(json!({ "resolving_power": row.resolving_power })).0, "{row:?}");
        assert_eq!(stability_kms, Some(row.stability_ms / 1e3));
        assert_eq!(written["resolving_power"], row.resolving_power);
    }
    let (_, stability_kms, written) = resolved(json!({ "resolving_power": 50_000 }));
    assert_eq!((stability_kms, written), (None, json!({ "resolving_power": 50_000.0 })));
    let (_, stability_kms, written) =
        resolved(json!({ "name": "HARPS", "resolving_power": 80_000, "stability_ms": 10 }));
    assert_eq!((stability_kms, &written["resolving_power"]), (Some(0.01), &json!(80_000.0)));
    assert_eq!(resolved(json!({ "name": "Mine", "resolving_power": 5e4, "stability_ms": 0 })).1, Some(1e-4));
    assert_eq!(resolved(json!({ "stability_ms": 5 })).1, Some(0.005));
    for number in ["resolving_power", "stability_ms"] {
        let message = instrument(json!({ "name": "Mine", number: 50 })).unwrap_err();
        assert!(message.contains("instrument.name: \"Mine\" is none of ESPaDOnS, "), "{message}");
    }
    // the wavelength is that of the config, and names of the same spectrograph are one
    let shas = ["harps-n", "HARPS-N"].map(|name| {
        let settings = instrument(json!({ "name": name })).unwrap();
        assert_eq!(settings.resolved["star"]["wavelength_nm"], 550.0);
        settings.sha256
    });
    assert_eq!(shas[0], shas[1]);
}

#[test]
fn a_star_has_a_name_in_one_line() {
    let named = |name: Value| resolve(&with(demo(), "/star/name", name));
    assert_eq!(named(json!("AU Mic")).unwrap().resolved["star"]["name"], "AU Mic");
    for (name, problem) in [
        (json!(""), "must not be empty"),
        (json!("a\nb"), "one line"),
        (json!("x".repeat(81)), "81 characters, at most 80"),
    ] {
        let message = named(name).unwrap_err().to_string();
        assert!(message.contains("star.name") && message.contains(problem), "{message}");
    }
}

#[test]
fn accepted_spellings() {
    for (pointer, value) in [
        ("/imaging/objective", json!("regularized-likelihood")),
        ("/imaging/objective", json!("regularised-likelihood")),
        ("/$schema", json!("dimcmc.schema.json")),
        ("/instrument", Value::Null),
        ("/star/limb_darkening", json!({ "law": "quadratic", "coefficients": [0.4, 0.3] })),
        ("/grid/axes/phi", json!([0.8, 1.2, 9])),
        ("/grid/axes/phi", json!([-3, -2, 2])),
        ("/parameters/phi", json!({ "prior": "uniform", "min": 0.2, "max": 0.8 })),
    ] {
        resolve(&with(demo(), pointer, value)).unwrap_or_else(|e| panic!("{e}"));
    }
    let noiseless = demo().to_string().replace("\"snr\":1000.0", "\"snr\":null");
    let settings = config::from_json(noiseless.as_bytes(), Path::new("x")).unwrap();
    assert!(matches!(&settings.sets[0].source, ObservationSource::Simulate(s) if s.snr.is_none()));
    assert!(settings.resolved["observations"]["simulate"]["snr"].is_null());
}

#[test]
fn the_text_of_errors() {
    let cases = [
        ("/star/vsinni_kms", json!(40), ": unknown key star.vsinni_kms: did you mean vsini_kms?"),
        ("/plannet", json!({}), ": unknown key plannet: did you mean planet?"),
        ("/parameters/vsini", json!({}), ": unknown key parameters.vsini: did you mean vsini_kms?"),
        ("/sampler/walker", json!(32), ": unknown key sampler.walker: did you mean walkers?"),
        (
            "/imaging/objective",
            json!("spotedness"),
            ": imaging.objective: unknown value spotedness: did you mean spottedness?",
        ),
        ("/star/vsini_kms", json!("forty"), ": star.vsini_kms: expected a number, found string \"forty\""),
        ("/star/vsini_kms", Value::Null, ": star.vsini_kms: missing"),
        (
            "/imaging/pixels",
            json!(2000.5),
            ": imaging.pixels: expected a whole number, 0 or more, found floating point `2000.5`",
        ),
        ("/imaging/pixels", json!(-5), ": imaging.pixels: expected a whole number, 0 or more, found integer `-5`"),
        ("/planet", json!(3), ": planet: expected an object in braces, found integer `3`"),
        (
            "/observations/simulate/spots/2",
            json!([1, 2, 3]),
            ": observations.simulate.spots[2]: 3 numbers must be 4, [longitude, latitude, radius, filling], or 6, with \
            the time of the largest area and the lifetime",
        ),
        ("/grid/axes/phi", json!([0.1, 0.2]), ": grid.axes.phi: expected an array of length 3, found length 2"),
        ("/grid/axes/k_km", json!([0, 1, 5]), ": unknown key grid.axes.k_km: did you mean k_kms?"),
        ("/grid/axis", json!({}), ": unknown key grid.axis: did you mean axes?"),
        (
            "/grid/axes/k_kms",
            json!([0, 1, 2.5]),
            ": grid.axes.k_kms[2]: expected a whole number, 0 or more, found floating point `2.5`",
        ),
        ("/grid/axes/k_kms", json!([-0.1, 0.1, 5]), ": grid.axes.k_kms: -0.1 must be 0 or more"),
        ("/grid/axes/k_kms", json!([0.2, 0.1, 5]), ": grid.axes.k_kms: min 0.2 must be below max 0.1"),
        ("/grid/axes/phi", json!([0, 1.2, 5]), ": grid.axes.phi: from 0 to 1.2 is more than the period, which is 1"),
        (
            "/grid/axes/k_kms",
            json!([0.1, 0.2, 1]),
            ": grid.axes.k_kms: 1 nodes must be 2 or more; a parameter without an axis is fixed",
        ),
        ("/grid/axes/k_kms", json!([0, 1, 1000000]), ": grid.axes: 225000000 nodes exceed 1000000"),
        ("/planet/k_kms", json!(0.5), ": planet.k_kms: 0.5 is outside its prior, [0, 0.3] by parameters.k_kms"),
        (
            "/parameters/k_kms/min",
            json!(-0.1),
            ": parameters.k_kms.min: -0.1 must not be below 0 while phi is free: -K at phi is K at phi + 0.5",
        ),
        ("/parameters/k_kms/min", Value::Null, ": parameters.k_kms.min: missing, a uniform prior needs it"),
    ];
    for (pointer, value, expected) in cases {
        assert_eq!(message(&with(demo(), pointer, value)), expected);
    }
}

const LIFETIME: &str = "observations.simulate.random_spots.lifetime_d";

/// Random spots with this value of a key.
fn random(key: &str, value: Value) -> Value {
    json!({ "number": 5, key: value })
}

/// Times drawn at random in place of those of the demo.
#[test]
fn senseless_schedules_name_their_key() {
    let cases = [
        ("nights", json!({ "nights": 0 })),
        ("nights", json!({ "nights": 1000, "seasons": 100, "season_spacing_d": 1000 })),
        ("seasons", json!({ "seasons": 0 })),
        ("season_spacing_d", json!({ "seasons": 2, "season_spacing_d": 9 })),
        ("season_spacing_d", json!({ "seasons": 2, "season_spacing_d": 1e300 })),
        ("per_night", json!({ "per_night": [0, 3] })),
        ("per_night", json!({ "per_night": [4, 3] })),
        ("night_hours", json!({ "night_hours": 0 })),
        ("night_hours", json!({ "night_hours": 25 })),
        ("clouds", json!({ "clouds": 1 })),
        ("clouds", json!({ "nights": 1, "clouds": 0.999999 })),
    ];
    for (key, schedule) in cases {
        let mut config = with(demo(), "/observations/simulate/schedule", schedule.clone());
        config["observations"]["simulate"].as_object_mut().unwrap().remove("cycles");
        let message = message(&config);
        assert!(message.starts_with(&format!(": observations.simulate.schedule.{key}: ")), "{schedule}: {message}");
    }
}

#[test]
fn senseless_values_name_their_key() {
    let cases = [
        ("/star/vsini_kms", json!(0), "star.vsini_kms"),
        ("/star/vsini_kms", json!(-40), "star.vsini_kms"),
        ("/star/inclination_deg", json!(0), "star.inclination_deg"),
        ("/star/inclination_deg", json!(90.1), "star.inclination_deg"),
        ("/star/rotation_period_d", json!(0), "star.rotation_period_d"),
        ("/star/rotation_period_d", json!(1e-310), "star.rotation_period_d"),
        ("/star/omega_eq_rad_d", json!(-2), "star.omega_eq_rad_d"),
        ("/star/contrast", json!(0.1), "star.contrast"),
        ("/star/spot_k", json!(6000), "star.spot_k"),
        ("/star/spot_k", json!(0), "star.spot_k"),
        ("/star/photosphere_k", Value::Null, "star.photosphere_k"),
        ("/star/wavelength_nm", json!(0), "star.wavelength_nm"),
        ("/star/line/sigma_kms", json!(0), "star.line.sigma_kms"),
        ("/star/line/equivalent_width_kms", json!(-1), "star.line.equivalent_width_kms"),
        ("/star/line/equivalent_width_kms", json!("auto"), "star.line.equivalent_width_kms"),
        ("/star/line/equivalent_width_kms", json!("Auto"), "star.line.equivalent_width_kms"),
        ("/star/limb_darkening/coefficients", json!([0.3, 0.3]), "star.limb_darkening.coefficients"),
        ("/star/limb_darkening/coefficients", json!([1.2]), "star.limb_darkening.coefficients"),
        ("/star/line/gamma_kms", json!(1), "star.line.gamma_kms"),
        ("/star/line/shape", json!("voigt"), "star.line.gamma_kms"),
        (
            "/star/line",
            json!({ "shape": "voigt", "sigma_kms": 2, "gamma_kms": 0, "equivalent_width_kms": 5 }),
            "star.line.gamma_kms",
        ),
        ("/star/limb_darkening/law", json!("linea"), "star.limb_darkening.law"),
        ("/instrument/resolving_power", json!(0), "instrument.resolving_power"),
        ("/instrument/name", json!("espadon"), "instrument.name"),
        ("/instrument/name", json!(" "), "instrument.name"),
        ("/instrument/stability_ms", json!(-1), "instrument.stability_ms"),
        ("/instrument/stability_ms", json!(1.1e5), "instrument.stability_ms"),
        ("/planet/k_kms", json!(-0.1), "planet.k_kms"),
        ("/planet/porb_over_prot", json!(0), "planet.porb_over_prot"),
        ("/imaging/pixels", json!(99), "imaging.pixels"),
        ("/imaging/pixels", json!(3_000_000), "imaging.pixels"),
        ("/imaging/default_spot", json!(0.5), "imaging.default_spot"),
        ("/imaging/chi2_target", json!(0), "imaging.chi2_target"),
        ("/imaging/brightness", json!("bright"), "imaging.brightness"),
        ("/observations/simulate/faculae", json!([[0, 91, 5, 0.1]]), "observations.simulate.faculae[0]"),
        ("/observations/simulate/faculae", json!([[0, 9, 5, 0.1], [0, 9, 0, 0.1]]), "observations.simulate.faculae[1]"),
        ("/observations/simulate/truth", json!({ "t_conjunction2_d": 5 }), "observations.simulate.truth"),
        ("/observations/simulate/faculae", json!([[0, 9, 5, 0]]), "observations.simulate.faculae[0]"),
        ("/observations/simulate/faculae", json!([[0, 9, 5, 1e9]]), "observations.simulate.faculae[0]"),
        ("/imaging/nuisances", json!({ "continuum_offset": -1e-3 }), "imaging.nuisances.continuum_offset"),
        ("/imaging/nuisances", json!({ "equivalent_width": 11 }), "imaging.nuisances.equivalent_width"),
        ("/parameters/contrast", json!({ "prior": "uniform", "min": 0, "max": 1.5 }), "parameters.contrast.max"),
        (
            "/parameters/limb_darkening",
            json!({ "prior": "uniform", "min": 0.7, "max": 1 }),
            "star.limb_darkening.coefficients",
        ),
        (
            "/parameters/line_sigma_kms",
            json!({ "prior": "uniform", "min": -1, "max": 5 }),
            "parameters.line_sigma_kms.min",
        ),
        ("/parameters/k_kms/min", json!(0.3), "parameters.k_kms.min"),
        ("/parameters/k_kms/min", json!(0.5), "parameters.k_kms.min"),
        ("/parameters/k_kms/prior", json!("periodic"), "parameters.k_kms.prior"),
        ("/parameters/k_kms/prior", json!("isotropic"), "parameters.k_kms.prior"),
        ("/parameters/k_kms/prior", json!("log-uniform"), "parameters.k_kms.min"),
        ("/parameters/k_kms/sd", json!(1), "parameters.k_kms.sd"),
        ("/parameters/phi/prior", json!("normal"), "parameters.phi.prior"),
        ("/parameters/phi/min", json!(0), "parameters.phi.min"),
        ("/parameters/k_kms", json!({ "prior": "normal", "mean": 0.1, "sd": 0 }), "parameters.k_kms.sd"),
        ("/parameters/k_kms", json!({ "prior": "normal", "sd": 0.1 }), "parameters.k_kms.mean"),
        ("/parameters/k_kms", json!({ "prior": "normal", "mean": -9, "sd": 0.1 }), "parameters.k_kms.mean"),
        ("/parameters/k_kms", json!({ "prior": "normal", "mean": 1e308, "sd": 1e-308 }), "planet.k_kms"),
        ("/sampler/walkers", json!(31), "sampler.walkers"),
        ("/sampler/walkers", json!(4), "sampler.walkers"),
        ("/sampler/ensembles", json!(0), "sampler.ensembles"),
        ("/sampler/steps", json!(0), "sampler.steps"),
        ("/grid/axes/k_kms", json!([0.2, 0.1, 5]), "grid.axes.k_kms"),
        ("/grid/axes/k_kms", json!([0.1, 0.2, 0]), "grid.axes.k_kms"),
        ("/grid/axes/k_kms", json!([0.2, 0.2, 5]), "grid.axes.k_kms"),
        ("/grid/axes/k_kms", json!([0, 1e-320, 15]), "grid.axes.k_kms"),
        ("/grid/axes/phi", json!([1e15, 1e15 + 0.5, 3]), "grid.axes.phi"),
        ("/grid/axes/porb_over_prot", json!([0, 2, 5]), "grid.axes.porb_over_prot"),
        ("/grid/axes", json!({ "inclination_deg": [30, 100, 5] }), "grid.axes.inclination_deg"),
        ("/grid/axes", json!({ "vsys_kms": [-1e308, 1e308, 5] }), "grid.axes.vsys_kms"),
        ("/grid/axes/phi", json!([0, 1, 18446744073709551615u64]), "grid.axes"),
        ("/grid/axes/vsini_kms", json!([39, 41, 5]), "grid.axes"),
        ("/grid/axes", json!({}), "grid.axes"),
        ("/observations/path", json!("observations.txt"), "observations"),
        ("/observations/sigma_scale", json!(0.4), "observations.sigma_scale"),
        ("/observations/simulate", Value::Null, "observations"),
        ("/observations/simulate/spots/1", json!([0, 0, 10, 1.1]), "observations.simulate.spots[1]"),
        ("/observations/simulate/spots/1", json!([0, 0, 10, 0.5, 1e300, 5]), "observations.simulate.spots[1]"),
        ("/observations/simulate/spots/1", json!([0, 0, 10, 0.5, 3, 0]), "observations.simulate.spots[1]"),
        ("/observations/simulate/spots/1", json!([0, 0, 10, 0.5, 3]), "observations.simulate.spots[1]"),
        ("/observations/simulate/random_spots", json!({ "number": 0 }), "observations.simulate.random_spots.number"),
        ("/observations/simulate/random_spots", random("lifetime_d", json!(0)), LIFETIME),
        ("/observations/simulate/random_spots", random("lifetime_d", json!(1e-6)), LIFETIME),
        ("/observations/simulate/random_spots", random("lifetime_d", json!(1e300)), LIFETIME),
        (
            "/observations/simulate/random_spots",
            random("radius_deg", json!([0, 5])),
            "observations.simulate.random_spots.radius_deg",
        ),
        (
            "/observations/simulate/random_spots",
            random("radius_deg", json!([9, 5])),
            "observations.simulate.random_spots.radius_deg",
        ),
        (
            "/observations/simulate/random_spots",
            random("filling", json!([0.5, 1.1])),
            "observations.simulate.random_spots.filling",
        ),
        (
            "/observations/simulate/random_spots",
            random("latitude_deg", json!([-91, 0])),
            "observations.simulate.random_spots.latitude_deg",
        ),
        ("/observations/simulate/schedule", json!({ "nights": 9 }), "observations.simulate.schedule"),
        ("/observations/simulate/cycles", Value::Null, "observations.simulate.cycles"),
        ("/observations/simulate/cycles", json!([]), "observations.simulate.cycles"),
        ("/observations/simulate/cycles/1", json!(1e308), "observations.simulate.cycles[1]"),
        ("/observations/simulate/snr", json!(0), "observations.simulate.snr"),
        ("/observations/simulate/pixels", json!(10), "observations.simulate.pixels"),
        ("/observations/simulate/velocity_kms/min", json!(60), "observations.simulate.velocity_kms.min"),
        ("/observations/simulate/velocity_kms/step", json!(90), "observations.simulate.velocity_kms.step"),
        ("/observations/simulate/truth", json!({ "vsini_kms": -1 }), "observations.simulate.truth.vsini_kms"),
        ("/observations/simulate/truth", json!({ "contrast": 1 }), "observations.simulate.truth.contrast"),
        ("/observations/simulate/continuum", json!({ "slope": -1 }), "observations.simulate.continuum.slope"),
    ];
    for (pointer, value, key) in cases {
        let message = message(&with(demo(), pointer, value));
        assert!(message.starts_with(&format!(": {key}: ")), "{pointer}: {message}");
    }
    let brightness = with(demo(), "/imaging/brightness", json!("bright-and-dark"));
    let contrast = json!({ "prior": "uniform", "min": 0, "max": 1 });
    assert!(message(&with(brightness, "/parameters/contrast", contrast)).starts_with(": parameters.contrast: "));
    for (pointer, value, key) in [
        ("/observations/velocity_range_kms", json!([90, -90]), "observations.velocity_range_kms"),
        ("/observations/sigma_scale", json!(0), "observations.sigma_scale"),
        ("/observations/path", json!(""), "observations.path"),
    ] {
        let message = message(&with(lopeg(), pointer, value));
        assert!(message.starts_with(&format!(": {key}: ")), "{message}");
    }
}

#[test]
fn phase_and_period_mean_nothing_without_a_planet() {
    let fixed = with(with(demo(), "/planet/k_kms", json!(0)), "/parameters/k_kms", Value::Null);
    assert!(message(&with(fixed.clone(), "/parameters/porb_over_prot", Value::Null)).starts_with(": parameters.phi: "));
    let none = with(fixed, "/parameters", Value::Null);
    assert!(message(&with(none.clone(), "/grid/axes/k_kms", Value::Null)).starts_with(": grid.axes.porb_over_prot: "));
    let error = resolve(&none).unwrap().require_free().unwrap_err().to_string();
    assert!(error.starts_with("dir/x.json: parameters: no parameter is free"), "{error}");
    let error = resolve(&with(none, "/grid", Value::Null)).unwrap().require_grid().unwrap_err().to_string();
    assert!(error.starts_with("dir/x.json: grid: missing"), "{error}");
}

#[test]
fn text_that_is_no_config() {
    let error = |text: &[u8]| config::from_json(text, Path::new("x.json")).unwrap_err().to_string();
    assert_eq!(error(b"{\n  \"star\": {,\n}"), "x.json:2:12: invalid JSON: key must be a string");
    assert!(error(b"").starts_with("x.json:1:0: invalid JSON: EOF"));
    assert!(error(format!("{} x", demo()).as_bytes()).contains("trailing characters"));
    assert!(error(b"[1]").starts_with("x.json: "));
    let twice = demo().to_string().replacen("\"star\":{", "\"star\":{\"epoch_d\":1,", 1);
    assert_eq!(error(twice.as_bytes()), "x.json: star.epoch_d: given twice");
    assert!(
        error(b"{\"star\": {\"a\\n\\u0007b\": 1}}")
            .starts_with("x.json: unknown key star.a\\n\\u{7}b: must be one of ")
    );
    assert!(error(&b"[".repeat(100_000)).len() < 500);
    let absent = load(Path::new("/nowhere/x.json")).unwrap_err().to_string();
    assert!(absent.starts_with("/nowhere/x.json: cannot read: No such file"), "{absent}");
}

#[test]
fn no_text_makes_it_panic() {
    let pieces =
        ["", "1e308", "-1", "0", "null", "\"auto\"", "{}", "[]", "\n", "é", "1e-320", "18446744073709551615", "}"];
    let bases = [demo().to_string(), lopeg().to_string()];
    for k in 0..4000usize {
        let base = &bases[k % 2].as_bytes();
        let (at, piece) = ((k * 7919 + k / 5) % base.len(), pieces[k % pieces.len()].as_bytes());
        let text = match k / 2 % 3 {
            0 => base[..at].to_vec(),
            1 => [&base[..at], piece, &base[(at + k % 9).min(base.len())..]].concat(),
            _ => replace_number(base, at, piece),
        };
        if let Err(error) = config::from_json(&text, Path::new("x.json")) {
            let error = error.to_string();
            assert!(error.starts_with("x.json") && !error.contains('\n') && error.len() < 1000, "{error}");
        }
    }
}

/// Replaces the first number after `at` by `piece`: texts that are still JSON, and reach the checks of the values.
fn replace_number(base: &[u8], at: usize, piece: &[u8]) -> Vec<u8> {
    let part_of_number = |b: &u8| b.is_ascii_digit() || b"-.".contains(b);
    let starts = |k: &usize| b":,[".contains(&base[*k]) && base.get(k + 1).is_some_and(part_of_number);
    let Some(start) = (at..base.len()).find(starts) else { return base.to_vec() };
    let end = (start + 1..base.len()).find(|k| !part_of_number(&base[*k])).unwrap_or(base.len());
    [&base[..=start], piece, &base[end..]].concat()
}

/// A key that was renamed is refused with its new name, and the changelog tells it.
#[test]
fn an_old_key_names_the_new_one() {
    let text = std::fs::read_to_string(shipped("demo.json")).unwrap().replace("unresolved_spots", "spots_left");
    let error = config::from_json(text.as_bytes(), Path::new("old.json")).unwrap_err().to_string();
    assert_eq!(error, "old.json: unknown key imaging.spots_left: it is now called unresolved_spots");
    assert!(include_str!("../../CHANGELOG.md").contains("`imaging.spots_left` -> `imaging.unresolved_spots`"));
}
