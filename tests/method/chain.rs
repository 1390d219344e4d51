//! Journal and summary from outside: torn tails against corruption, exact floats, circular statistics, advice.

use dimcmc::internals::data::io::journal::{self, Journal};
use dimcmc::internals::sampling::chain::{
    Chain, Goals, MoveKind, ParameterKind, Record, Shape, Summary, summarise, table,
};
use dimcmc::internals::sampling::log_density::Status;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::collections::BTreeMap;
use std::path::Path;

const GOALS: Goals = Goals { rhat: 1.01, ess: 1000.0 };

/// A chain of draws made by `draw(rng, ensemble, walker, step)`.
fn chain(names: &[&str], size: [usize; 3], draw: &mut dyn FnMut(&mut ChaCha8Rng, [usize; 3]) -> Vec<f64>) -> Chain {
    let [ensembles, walkers, steps] = size;
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    let numbers = ["spottedness", "log_evidence"].map(str::to_owned).to_vec();
    let mut chain = Chain::new(Shape { names, numbers, ensembles, walkers });
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for step in 0..steps {
        let mut records = Vec::new();
        for ensemble in 0..ensembles {
            for walker in 0..walkers {
                let theta = draw(&mut rng, [ensemble, walker, step]);
                let proposed = if rng.random::<f64>() < 0.1 { Status::StoppedShort } else { Status::Converged };
                records.push(Record {
                    ensemble,
                    step,
                    walker,
                    accepted: rng.random(),
                    log_prob: -0.5 * theta[0] * theta[0],
                    theta,
                    numbers: vec![rng.random::<f64>() * 1e-3, 1.0 / rng.random::<f64>()],
                    status: Status::Converged,
                    proposed,
                    model_applications: rng.random_range(20..60),
                    by: (step > 0).then_some(MoveKind::Stretch),
                });
            }
        }
        chain.push_step(&records).unwrap();
    }
    chain
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

fn small() -> Chain {
    chain(&["k_kms", "phi"], [2, 3, 4], &mut |rng, _| vec![normal(rng) * 1e-300, -0.0 + rng.random::<f64>() / 3.0])
}

fn written(path: &Path, chain: &Chain) -> Vec<u8> {
    let mut journal = Journal::create(path, chain.shape().clone(), false).unwrap();
    for step in 0..chain.steps() {
        journal.append(chain.step(step).unwrap()).unwrap();
    }
    std::fs::read(path).unwrap()
}

#[test]
fn every_number_survives() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.jsonl");
    let chain = small();
    let bytes = written(&path, &chain);
    assert_eq!(journal::read(&path, chain.shape()).unwrap(), chain);
    let first = std::str::from_utf8(&bytes).unwrap().lines().next().unwrap().to_owned();
    assert!(first.starts_with(r#"{"ensemble":0,"step":0,"walker":0,"accepted":"#), "{first}");
    let line: BTreeMap<String, serde_json::Value> = serde_json::from_str(&first).unwrap();
    assert_eq!(line["status"], "converged");
    let keys = "accepted ensemble k_kms log_evidence log_prob model_applications phi proposed spottedness status step \
                walker";
    assert_eq!(line.keys().map(String::as_str).collect::<Vec<_>>().join(" "), keys);
}

#[test]
fn cut_at_every_byte_of_the_last_two_steps() {
    let folder = tempfile::tempdir().unwrap();
    let chain = small();
    let bytes = written(&folder.path().join("whole"), &chain);
    let path = folder.path().join("cut");
    let lines: Vec<usize> = bytes.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(i, _)| i + 1).collect();
    for cut in lines[lines.len() - 13]..=bytes.len() {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        let whole = lines.iter().filter(|end| **end <= cut).count() / 6;
        assert_eq!(journal::read(&path, chain.shape()).unwrap().steps(), whole, "cut at {cut}");
        let (mut journal, recovered) = Journal::recover(&path, chain.shape().clone()).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len() as usize, lines[whole * 6 - 1]);
        assert_eq!(recovered.last_step(), chain.step(whole - 1));
        for step in whole..chain.steps() {
            journal.append(chain.step(step).unwrap()).unwrap();
        }
        assert!(std::fs::read(&path).unwrap() == bytes, "cut at {cut}");
    }
}

#[test]
fn torn_tails_are_dropped_and_corruption_is_refused_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let chain = small();
    let path = folder.path().join("chain.jsonl");
    let text = String::from_utf8(written(&path, &chain)).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let read = |lines: &[&str], tail: &[u8]| {
        let mut bytes = lines.join("\n").into_bytes();
        bytes.push(b'\n');
        bytes.extend_from_slice(tail);
        std::fs::write(&path, bytes).unwrap();
        journal::read(&path, chain.shape()).map(|chain| chain.steps()).map_err(|error| error.to_string())
    };
    let tails: [&[u8]; 5] = [b"", b"{\"ens", b"{\"ens\n", b"\0\0\0\0", b"garbage\n{\"ensem"];
    for tail in tails {
        assert_eq!(read(&lines[..20], tail), Ok(3), "{tail:?}");
    }
    let refused = |at: usize, line: &str, wanted: &str| {
        let mut changed = lines.clone();
        changed[at] = line;
        let error = read(&changed, b"").unwrap_err();
        let place = format!("chain.jsonl, line {}: ", at + 1);
        assert!(error.contains(&place) && error.contains(wanted), "{error} lacks {wanted}");
    };
    refused(4, &lines[4][..30], "EOF");
    refused(4, "", "EOF");
    refused(22, "{\"ens", "EOF");
    refused(4, lines[5], "expected step 0, ensemble 1, walker 1 but found step 0, ensemble 1, walker 2");
    refused(5, lines[4], "expected step 0, ensemble 1, walker 2");
    refused(3, &lines[3].replace("\"phi\"", "\"psi\""), "unknown key `psi`");
    refused(23, &lines[23].replace("\"accepted\"", "\"phi\":0.5,\"accepted\""), "key `phi` twice");
    refused(7, &lines[7].replace("\"log_prob\":", "\"log_prob\":null,\"x\":"), "`log_prob`");
    refused(7, &lines[7].replace("\"log_prob\":", "\"log_prob\":1e999,\"x\":"), "out of range");
    refused(7, &lines[7].replace("converged\",\"p", "convinced\",\"p"), "`status`");
    let count = "\"model_applications\":";
    refused(7, &lines[7].replace(count, &format!("{count}-")), "`model_applications`");
    let end = lines[6].find(",\"model_applications\"").unwrap();
    refused(6, &format!("{}}}", &lines[6][..end]), "missing key `model_applications`");
    refused(7, &lines[7].replace("\"log_evidence\"", "\"chi2\""), "unknown key `chi2`");
    // Whole, but wrong: no torn tail, even on the last line.
    refused(23, lines[22], "expected step 3, ensemble 1, walker 2");
    std::fs::write(&path, "").unwrap();
    assert_eq!(journal::read(&path, chain.shape()).unwrap().steps(), 0);
    let error = journal::read(&folder.path().join("none"), chain.shape()).unwrap_err().to_string();
    assert!(error.contains("none"), "{error}");
    let taken = Shape { names: vec!["log_evidence".to_owned()], ..chain.shape().clone() };
    assert!(journal::read(&path, &taken).unwrap_err().to_string().contains("`log_evidence`"));
}

#[test]
fn a_journal_and_a_chain_take_the_next_whole_step_only() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chain.jsonl");
    let source = small();
    let mut journal = Journal::create(&path, source.shape().clone(), false).unwrap();
    let first = source.step(0).unwrap();
    assert!(journal.append(&first[..5]).is_err());
    assert!(journal.append(source.step(1).unwrap()).is_err());
    let mut infinite = first.to_vec();
    infinite[2].log_prob = f64::NEG_INFINITY;
    let error = journal.append(&infinite).unwrap_err().to_string();
    assert!(error.contains("`log_prob` is not finite"), "{error}");
    assert_eq!(std::fs::metadata(&path).unwrap().len(), 0);
    let mut chain = Chain::new(source.shape().clone());
    assert!(chain.push_step(&infinite).is_err() && chain.steps() == 0);
}

#[test]
fn a_good_chain_is_summarised() {
    let kinds = [ParameterKind::Amplitude, ParameterKind::Periodic, ParameterKind::Linear];
    let names = ["k_kms", "phi", "a_parameter_of_a_very_long_name"];
    let chain = chain(&names, [4, 16, 500], &mut |rng, _| {
        vec![0.02 * normal(rng).abs(), (0.99 + 0.04 * normal(rng)).rem_euclid(1.0), 100.0 + 3.0 * normal(rng)]
    });
    let summary = summarise(&chain, &kinds, &GOALS).unwrap();
    assert!(summary.converged, "{:?}", summary.advice);
    // 32,000 independent draws less a few: errors of 1/170 of a standard deviation, times 4 to 5.
    let k = &summary.parameters["k_kms"];
    assert!((k.upper95.unwrap() - 0.0392).abs() < 0.0007 && k.mode < 0.004, "{k:?}");
    assert!(k.hdi95[0] < 1e-4 && (k.hdi95[1] - 0.0392).abs() < 0.0007 && (k.median - 0.01349).abs() < 0.0004);
    let phi = &summary.parameters["phi"];
    assert!((phi.median - 0.99).abs() < 1e-3 && (phi.mean - 0.99).abs() < 1e-3 && (phi.sd - 0.04).abs() < 1e-3);
    assert!((phi.ci95[0] - 0.9116).abs() < 3e-3 && (phi.ci95[1] - 1.0684).abs() < 3e-3, "{phi:?}");
    assert!((phi.ci68[0] - 0.9502).abs() < 2e-3 && (phi.hdi68[1] - phi.hdi68[0] - 0.0796).abs() < 2e-3);
    assert!((phi.mode - 0.99).abs() < 0.01 && phi.upper95.is_none());
    let last = &summary.parameters[names[2]];
    assert!((last.mean - 100.0).abs() < 0.08 && (last.mode - 100.0).abs() < 0.8 && last.upper95.is_none());
    assert!(last.ess.unwrap() > 25_000.0 && last.rhat.unwrap() < 1.003 && (last.tau.unwrap() - 1.0).abs() < 0.1);
    assert!((summary.acceptance_fraction - 0.5).abs() < 0.01);
    assert_eq!((summary.steps, summary.evaluations), (499, 32_000));
    assert!(summary.discarded_steps < 15);
    assert!(summary.advice.iter().any(|line| line.contains("evaluations failed")), "{:?}", summary.advice);
    let back: Summary = serde_json::from_str(&serde_json::to_string_pretty(&summary).unwrap()).unwrap();
    assert_eq!(back, summary);
    let best = chain.records().iter().map(|record| record.log_prob).fold(f64::NEG_INFINITY, f64::max);
    assert_eq!(summary.best.log_prob, best);
    let json = serde_json::to_value(&summary).unwrap();
    assert!(json["best"]["k_kms"].is_number() && json["parameters"]["phi"]["hdi95"][1].is_number());
    assert!(json["parameters"]["phi"].get("upper95").is_none());

    let text = table(&summary, Some(&BTreeMap::from([("k_kms".to_owned(), 0.1)])));
    let rows: Vec<&str> = text.lines().take(4).collect();
    assert!(rows.iter().all(|row| row.chars().count() == rows[0].chars().count()), "{text}");
    assert!(
        rows[1].contains("0.100") && rows[0].contains("truth") && text.contains("k_kms is consistent with zero"),
        "{text}"
    );
    assert!(text.lines().last().unwrap().starts_with("Chain converged"), "{text}");
}

#[test]
fn whole_turns_of_a_periodic_parameter_mean_nothing() {
    let chain = chain(&["phi"], [4, 16, 300], &mut |rng, [ensemble, ..]| vec![ensemble as f64 + 0.02 * normal(rng)]);
    let summary = summarise(&chain, &[ParameterKind::Periodic], &GOALS).unwrap();
    assert!(summary.converged, "{:?}", summary.advice);
    let phi = &summary.parameters["phi"];
    // sd of 0.02 over sqrt(19200) draws: 1.4e-4.
    assert!((phi.median - 0.0).abs().min((phi.median - 1.0).abs()) < 1e-3 && (phi.sd - 0.02).abs() < 1e-3, "{phi:?}");
    assert!(phi.ci68[0] < phi.median && phi.median < phi.ci68[1] && (phi.ci68[1] - phi.ci68[0] - 0.0398).abs() < 2e-3);
    assert!(!summarise(&chain, &[ParameterKind::Linear], &GOALS).unwrap().converged);
}

#[test]
fn a_clear_amplitude_has_no_upper_limit() {
    let chain = chain(&["k_kms"], [4, 8, 200], &mut |rng, _| vec![0.1 + 0.01 * normal(rng)]);
    let summary = summarise(&chain, &[ParameterKind::Amplitude], &GOALS).unwrap();
    assert_eq!(summary.parameters["k_kms"].upper95, None);
}

#[test]
fn a_displaced_ensemble_and_a_stuck_walker_are_not_converged() {
    let displaced = chain(&["k_kms", "phi"], [4, 8, 400], &mut |rng, [ensemble, ..]| {
        let shift = if ensemble == 2 { 1.0 } else { 0.0 };
        vec![shift + normal(rng), rng.random()]
    });
    let kinds = [ParameterKind::Linear, ParameterKind::Periodic];
    let summary = summarise(&displaced, &kinds, &GOALS).unwrap();
    assert!(!summary.converged && summary.parameters["k_kms"].rhat.unwrap() > 1.05);
    assert!(summary.parameters["phi"].rhat.unwrap() < 1.01, "the other parameter is fine");
    let text = table(&summary, None);
    let last = text.lines().last().unwrap();
    assert!(
        last.starts_with("Not converged: do not quote intervals. k_kms: R-hat 1.") && last.contains("--extend"),
        "{last}"
    );

    // one number of steps for several parameters, that of the worst
    let slow = chain(&["a", "b", "c"], [4, 8, 400], &mut |rng, [ensemble, ..]| {
        vec![ensemble as f64 + normal(rng), 0.5 * ensemble as f64 + normal(rng), normal(rng)]
    });
    let advice = summarise(&slow, &[ParameterKind::Linear; 3], &GOALS).unwrap().advice;
    assert_eq!(advice.concat().matches("--extend").count(), 1, "{advice:?}");
    assert!(
        advice[0].contains("a: R-hat") && advice[0].contains("b: R-hat") && !advice[0].contains("c: R-hat"),
        "{advice:?}"
    );

    let good = chain(&["k_kms"], [4, 8, 400], &mut |rng, _| vec![normal(rng)]);
    let mut stuck = Chain::new(good.shape().clone());
    for step in 0..good.steps() {
        let mut records = good.step(step).unwrap().to_vec();
        records[11].theta = vec![0.5];
        records[11].accepted = false;
        stuck.push_step(&records).unwrap();
    }
    let summary = summarise(&stuck, &[ParameterKind::Linear], &GOALS).unwrap();
    assert!(!summary.converged);
    assert!(summary.advice.iter().any(|line| line.contains("ensemble 1 walker 3")), "{:?}", summary.advice);
}

#[test]
fn short_and_constant_chains_are_summarised_without_a_verdict() {
    for steps in 1..6 {
        let chain = chain(&["k_kms", "phi"], [2, 4, steps], &mut |rng, _| vec![0.1, rng.random()]);
        let summary = summarise(&chain, &[ParameterKind::Amplitude, ParameterKind::Periodic], &GOALS).unwrap();
        assert!(!summary.converged && summary.parameters["k_kms"].rhat.is_none());
        assert_eq!(summary.parameters["k_kms"].median, 0.1);
        let text = table(&summary, None);
        assert!(text.contains("Not converged"), "{text}");
        serde_json::to_string(&summary).unwrap();
    }
    let empty = Chain::new(small().shape().clone());
    assert!(summarise(&empty, &[ParameterKind::Linear; 2], &GOALS).is_err());
    assert!(summarise(&small(), &[ParameterKind::Linear], &GOALS).is_err());
}
