//! Tests of reading light curves.

use super::*;

/// Times and fluxes that are read, and remarks.
fn read(text: &str) -> (Vec<(f64, f64)>, Vec<String>) {
    let Measurements { fluxes, remarks, .. } = parse(text, Of::LightCurve).unwrap();
    assert!(fluxes.iter().all(|one| (one.sigma - 0.5e-3).abs() < 1e-9), "{fluxes:?}");
    (fluxes.iter().map(|one| (one.time_d, one.flux)).collect(), remarks)
}

fn refusal(text: &str, parts: &[&str]) {
    let (line, problem) = parse(text, Of::LightCurve).unwrap_err();
    let said = format!("line {line}: {problem}");
    assert!(parts.iter().all(|part| said.contains(part)), "{said}");
}

#[test]
fn one_light_curve_however_it_is_written() {
    let rows = [(9000.5, 0.99), (9000.6, 0.98)];
    for text in [
        "time,flux,sigma\n9000.5,0.99,0.0005\n9000.6,0.98,0.0005\n",
        "\u{feff}TIME;FLUX;SIGMA\n9000.5;0.99;0.0005\n9000.6;0.98;0.0005\n",
        "# TIC 1\n# sector 2\n\nTime (d)\tFlux\tFlux Error\n9000.5\t0.99\t0.0005\n9000.6\t0.98\t0.0005\n",
        "# BJD_TDB rel_flux e_rel_flux\n9000.5 0.99 5e-4\n9000.6 0.98 5.0D-04\n",
        "hjd,camera,flux(mJy),flux_err,mag,mag_err\n9000.5,be,0.99,0.0005,11,0.1\n9000.6,bf,0.98,0.0005,11,0.1\n",
        "cadence,time,flux,flux_err,note,pos\n1,9000.5,0.99,0.0005,,\n2,9000.6,0.98,0.0005,a b,\n",
        "time,flux,error\n9000.6,0.98,5e-4\n9000.5,0.99,5e-4\n",
    ] {
        assert_eq!(read(text), (rows.to_vec(), Vec::new()), "{text}");
    }
}

#[test]
fn rows_without_numbers_are_counted() {
    let rows = "9000.4,,5e-4\n9000.5,0.99,5e-4\n,0.9,5e-4\n9000.6,nan,5e-4\n9000.7,0.98,0\n9000.8,0.97,5e-4\n";
    let more = (0..20).map(|k| format!("{},1,5e-4\n", 9001 + k)).collect::<String>();
    let (found, remarks) = read(&format!("time,flux,sigma\n{rows}{more}9030,-1,5e-4\n"));
    assert_eq!(found.len(), 22);
    let due = "5 of 27 rows left out, whose numbers are missing or make no sense, line 2 the first: flux: \"\"";
    assert!(remarks.len() == 1 && remarks[0].contains(due), "{remarks:?}");
    refusal("time,flux,sigma\n9000.5,nan,1e-3\n", &["line 2: flux", "nan"]);
    refusal("time,flux,sigma\nnoon,1,1e-3\n", &["line 2: time", "noon"]);
    refusal("time;flux;sigma\n9000,5;0,99;0,001\n", &["line 2", "decimal comma"]);
}

#[test]
fn flagged_rows_are_counted() {
    for [name, good, bad] in [["quality", "0", "128"], ["SAP_QUALITY", "0", "2"], ["Quality", "G", "B"]] {
        let text =
            format!("time,flux,sigma,{name}\n9000.5,0.99,5e-4,{good}\n9000.6,5,5e-4,{bad}\n9000.7,1,5e-4,{good}\n");
        let (found, remarks) = read(&text);
        assert_eq!(found, [(9000.5, 0.99), (9000.7, 1.0)]);
        assert_eq!(remarks, [format!("1 of 3 rows left out that the column {name} flags")]);
    }
    refusal("time,flux,sigma,quality\n9000.5,0.99,5e-4,1\n", &["quality", "every row"]);
}

#[test]
fn magnitudes_become_fluxes_or_are_named() {
    for name in ["mag,mag_err", "Magnitude,Uncertainty", "Vmag,e_Vmag"] {
        let text = format!("HJD,{name}\n9000.5,11.2,0.01\n9000.6,>15.5,99.99\n9000.7,11.3,0.01\n9000.8,11.4,0.01\n");
        let Measurements { fluxes, remarks, .. } = parse(&text, Of::LightCurve).unwrap();
        let [first, middle] = [fluxes[0], fluxes[1]];
        assert!((first.flux / middle.flux - 10f64.powf(0.04)).abs() < 1e-12 && middle.flux == 1.0);
        assert!((middle.sigma - 0.009_210_34).abs() < 1e-7, "{middle:?}");
        assert!(remarks.len() == 2 && remarks[1].contains("magnitudes"), "{remarks:?}");
    }
    let numbers = "\n9000.5,11.2,0.01\n9000.6,11.3,0.01\n";
    refusal(&format!("time,flux,sigma{numbers}"), &["flux", "11.2 to 11.3", "magnitudes", "mag", "mJy"]);
    assert_eq!(parse(&format!("time,flux (mJy),sigma{numbers}"), Of::LightCurve).unwrap().fluxes[0].flux, 11.2);
    assert_eq!(parse(&format!("time,flux_mjy,sigma{numbers}"), Of::LightCurve).unwrap().fluxes[0].flux, 11.2);
    // instrumental ones, and changes of the flux
    refusal("time,flux,sigma\n1,-7.2,0.1\n2,-7.1,0.1\n", &["line 2", "-7.2 must be above 0", "mag"]);
    refusal("time,flux,sigma\n1,0.02,0.1\n2,-0.01,0.1\n", &["line 3", "Add them to 1"]);
}

#[test]
fn zero_points_are_read_from_names() {
    let zero = |name: &str| parse(&format!("{name},flux,sigma\n9000.5,1,0.1\n"), Of::LightCurve).unwrap().zero_jd;
    for name in ["btjd", "BTJD", "time (BTJD)", "BJD - 2457000", "time_btjd", "Time [BJD-2457000]"] {
        assert_eq!(zero(name), Some(2_457_000.0), "{name}");
    }
    assert_eq!(
        ["bkjd", "MJD", "JD-2400000.5", "HJD-2450000"].map(zero),
        [Some(2_454_833.0), Some(2_400_000.5), Some(2_400_000.5), Some(2_450_000.0)]
    );
    assert_eq!(["time", "BJD_TDB", "JD", "time (d)"].map(zero), [None; 4]);
    refusal("time (s),flux,sigma\n1,1,0.1\n", &["time (s)", "days"]);
}

#[test]
fn indicators_have_values_of_either_sign_by_any_name() {
    for text in [
        "time,value,sigma\n9000.5,-0.25,0.1\n9000.6,12,0.1\n",
        "BJD;S_MW;e_S_MW\n9000.5;-0.25;0.1\n9000.6;12;0.1\n",
        "# run 2\nmjd\tBl (G)\tsigma\tflag\n9000.5\t-0.25\t0.1\t0\n9000.55\t9\t0.1\t1\n9000.6\t12\t0.1\t0\n",
        "jd err halpha\n9000.6 0.1 12\n9000.5 0.1 -0.25\n",
        "9000.5 -0.25 0.1\n9000.6 12 0.1\n",
    ] {
        let Measurements { fluxes, .. } = parse(text, Of::Indicator).unwrap();
        let found: Vec<[f64; 3]> = fluxes.iter().map(|one| [one.time_d, one.flux, one.sigma]).collect();
        assert_eq!(found, [[9000.5, -0.25, 0.1], [9000.6, 12.0, 0.1]], "{text}");
    }
    let several = parse("time,halpha,halpha_err,bis\n1,2,0.1,3\n", Of::Indicator).unwrap();
    assert_eq!((several.fluxes[0].flux, &*several.remarks[0]), (2.0, "its value is the column halpha, not bis"));
    let (line, problem) = parse("time,halpha\n1,2\n", Of::Indicator).unwrap_err();
    assert!(line == 0 && problem.contains("no column sigma (the error of halpha)"), "{problem}");
}

#[test]
fn one_flux_of_several_and_one_band() {
    let text = "TIME,SAP_FLUX,SAP_FLUX_ERR,PDCSAP_FLUX,PDCSAP_FLUX_ERR\n9000.5,900,2,0.99,0.0005\n";
    let (found, remarks) = read(text);
    assert_eq!((found, remarks.len()), (vec![(9000.5, 0.99)], 1));
    assert!(remarks[0].contains("PDCSAP_FLUX, not SAP_FLUX"), "{remarks:?}");
    let text = "JD,flux,flux_err,Filter\n9000.5,1,0.1,V\n9000.6,2,0.1,g\n";
    refusal(text, &["Filter", "V, g", "photometry"]);
    refusal("time,flux\n1,2\n", &["no column sigma", "time, flux, sigma"]);
}
