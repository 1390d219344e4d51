//! `report` as users run it: one self-contained page, for browsers on desktops and phones.

use crate::desk::{Desk, says, text, two_spots};
use crate::shared;
use serde_json::json;
use std::io::Write as _;
use std::process::Command;

const CONFIG: &str = "config.json";

#[test]
fn a_run_has_a_page() {
    let desk = shared::desk();
    says(&desk.succeed(&["report", "sample"]), &["written  sample/report.html"]);
    let page = desk.read("sample/report.html");
    let summary = desk.json("sample/summary.json");
    let [median, sd] = ["median", "sd"].map(|key| summary["parameters"]["k_kms"][key].as_f64().unwrap());
    // two digits of the error, in m/s
    let (median, digits) = (1e3 * median, (1.0 - (1e3 * sd).log10().floor()).max(0.0) as usize);
    assert_eq!(summary["converged"], true);
    for part in [
        "Converged: max R-hat = ",
        "R-hat",
        &format!("<td>{median:.digits$}</td>"),
        "vsini_kms",
        "10.1051/0004-6361/201525993",
        concat!("version ", env!("CARGO_PKG_VERSION"), env!("DIMCMC_COMMIT"), ".</p>"),
        "Posterior of the sampled parameters",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // three figures, and nothing from elsewhere but a link to the paper
    assert_eq!(page.matches("<svg").count(), 3);
    for part in ["<script", "src=", "@import", "<link rel=\"stylesheet"] {
        assert!(!page.contains(part), "{part}");
    }
    let addresses: Vec<&str> =
        page.match_indices("http").map(|(at, _)| page[at..].split(['"', '<', ' ']).next().unwrap()).collect();
    for address in addresses {
        let allowed = ["http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink", "https://doi.org/"];
        assert!(allowed.iter().any(|a| address.starts_with(a)), "{address}");
    }
    // nothing is overwritten, and the same bytes come out again
    says(&desk.refusal(&["report", "sample"]), &["sample/report.html", "--force"]);
    says(&desk.refusal(&["report", "sample", "--out", "sample"]), &["sample", "is a folder"]);
    desk.succeed(&["report", "sample", "--force"]);
    assert!(page == desk.read("sample/report.html"));
    desk.refusal(&["report", "absent"]);
    // a chain that has not converged is reported as such
    let mut manifest = desk.json("sample/manifest.json");
    manifest["config"]["sampler"]["ess"] = json!(1_000_000);
    desk.write("sample/manifest.json", &manifest.to_string());
    desk.succeed(&["report", "sample", "--out", "short.html"]);
    assert!(desk.read("short.html").contains("Not converged; criterion"));
}

/// What cannot be computed there, such as chi2 outside of the line, is null in the file.
#[test]
fn a_map_of_nothing_but_the_core_of_the_line_has_a_page() {
    let desk = Desk::new(two_spots(json!({})));
    desk.set("/observations/simulate/velocity_kms", json!({ "min": -6.0, "max": 6.0, "step": 1.0 }));
    desk.succeed(&["map", CONFIG, "--out", "map"]);
    assert!(desk.json("map/fit.json")["checks"]["chi2_per_datum_outside"].is_null());
    desk.succeed(&["report", "map"]);
    assert!(!desk.read("map/report.html").contains("NaN"));
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn every_folder_has_a_page_that_a_browser_shows() {
    let desk = shared::desk();
    for (folder, part) in [
        ("simulate", "Injected parameters"),
        ("map", "most probable spot filling factor"),
        ("periodogram", "Peaks of the periodogram"),
        ("optimise", "A well-defined maximum"),
        ("grid", "Axes and paraboloid"),
        ("sample", "Sampled parameters"),
        ("compare", "Chain and likelihood grid"),
    ] {
        desk.succeed(&["report", folder, "--out", &format!("{folder}.html")]);
        assert!(desk.read(&format!("{folder}.html")).contains(part), "{folder}: {part}");
    }
    for folder in ["simulate", "map", "periodogram", "optimise", "grid", "sample"] {
        let page = desk.read(&format!("{folder}.html"));
        assert!(page.contains("<dt>Star</dt>") && page.contains("12 profiles from"), "{folder}");
        told_in_order(folder, &page);
    }
    for (folder, file, pointer) in [
        ("periodogram", "periodogram.json", "/verdict/sentence"),
        ("optimise", "optimum.json", "/blind_search/verdict/sentence"),
        ("sample", "summary.json", "/verdict/sentence"),
    ] {
        let sentence = desk.json(&format!("{folder}/{file}")).pointer(pointer).unwrap().as_str().unwrap().to_owned();
        let page = desk.read(&format!("{folder}.html"));
        let first = page.split("<p class=\"verdict").nth(1).unwrap().split('>').nth(1).unwrap();
        let begin: String = sentence.chars().take(30).collect();
        assert!(first.starts_with(&begin), "{folder}: {first}");
    }
    // the same period as in the figure
    let peak = &desk.json("periodogram/periodogram.json")["peaks"][0];
    let [period, sigma] = ["period_d", "sigma_period_d"].map(|key| peak[key].as_f64().unwrap());
    let digits = (1.0 - sigma.log10().floor()) as usize;
    let (page, period) = (desk.read("periodogram.html"), format!("{period:.digits$}"));
    assert!(page.contains(&format!("<tr><td>{period}</td>")) && page.contains(&format!("highest: {period} d")));
    let Some(browser) = browser() else {
        assert!(std::env::var_os("CI").is_none(), "no chromium to look at pages with");
        // past the test's capture, so that it is seen
        let _ = writeln!(std::io::stderr(), "skipped: no chromium to look at pages with");
        return;
    };
    for folder in ["map", "sample", "periodogram"] {
        for width in [390, 1280] {
            shown(&desk, &browser, folder, width);
        }
    }
}

/// Warnings come before tables, and no column of a table is empty.
fn told_in_order(folder: &str, page: &str) {
    let table = page.find("<table").unwrap_or(page.len());
    assert!(page.find("class=\"warnings\"").is_none_or(|warnings| warnings < table), "{folder}");
    for table in page.split("<tbody>").skip(1) {
        let rows = table.split("</tbody>").next().unwrap().split("<tr>").skip(1);
        let empty = |cell: &str| cell.starts_with("–<");
        let cells = |row: &str| row.split("<td>").skip(1).map(empty).collect::<Vec<bool>>();
        let rows: Vec<Vec<bool>> = rows.map(cells).collect();
        let empty = |k: usize| rows.iter().all(|row| row[k]);
        assert!(!(0..rows[0].len()).any(empty), "{folder}: {table}");
    }
}

/// Names of sections in the order of the page.
fn sections(page: &str) -> Vec<&str> {
    page.split("<section id=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn folders_of_one_star_make_one_page() {
    let desk = shared::desk();
    let folders = ["sample", "map", "optimise", "periodogram"];
    says(&desk.succeed(&[&["report"][..], &folders].concat()), &["written  report.html"]);
    let page = desk.read("report.html");
    assert!(page.contains("<h1>Beta &amp; Co</h1>") && page.contains("<title>Beta &amp; Co: dimcmc report</title>"));
    // each once, in the order in which one asks, whatever that of the folders
    let all = ["verdict", "velocities", "spectra", "maps", "periodogram", "posterior", "optimum", "assumed"].as_slice();
    assert_eq!(sections(&page), all);
    for id in all.iter().skip(1).chain(&["cite"]) {
        assert_eq!(page.matches(&format!("<a href=\"#{id}\">")).count().min(1), 1, "{id}");
        assert_eq!(page.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
    }
    // what all folders have in common is reported once
    for file in ["periodogram/periodogram.json", "optimise/optimum.json", "sample/summary.json"] {
        let json = desk.json(file);
        let sentence = json.pointer("/verdict/sentence").or_else(|| json.pointer("/blind_search/verdict/sentence"));
        let begin: String = sentence.unwrap().as_str().unwrap().chars().take(30).collect();
        assert_eq!(page.matches(&format!("\">{begin}")).count(), 1, "{file}: {begin}");
    }
    // statistics of the sampler are folded, and so are the velocities of the map
    let folded: String = page.split("<details>").skip(1).map(|rest| rest.split("</details>").next().unwrap()).collect();
    for part in ["Sampler diagnostics", "R-hat</th>", "Traces of", "integrated autocorrelation", "assumed orbit"] {
        assert!(folded.contains(part), "{part}");
    }
    let shown = page.split("<details>").map(|rest| rest.split("</details>").last().unwrap()).collect::<String>();
    for part in ["R-hat</th>", "Traces of", "assumed orbit"] {
        assert!(!shown.contains(part), "{part}");
    }
    for part in ["best orbit", "Dynamic spectra:", "Mollweide projection", "Periodogram. Top", "Posterior of the"] {
        assert!(shown.contains(part), "{part}");
    }
    // no two parts of figures have the same address
    let mut ids: Vec<&str> = page.split(" id=\"").skip(1).map(|rest| rest.split('"').next().unwrap()).collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count);
    // the star turns, by a script of the page's own that asks whether it may move
    assert!(page.contains("<canvas id=\"star\"") && page.contains("prefers-reduced-motion"));
    assert!(!page.contains("<script src") && !page.contains("NaN"));
    let Some(browser) = browser() else { return };
    desk.write("star.html", &page);
    for width in [800, 1200] {
        shown_whole(&desk, &browser, "star", width);
    }
}

#[test]
fn folders_of_different_stars_have_no_page() {
    let desk = shared::desk();
    says(&desk.refusal(&["report", "map", "sample", "map"]), &["map: is given twice"]);
    let other = |name: Option<&str>, data: &str| {
        let mut fit = desk.json("map/fit.json");
        fit["data_sha256"] = json!(data);
        fit["config"]["star"].as_object_mut().unwrap().remove("name");
        if let Some(name) = name {
            fit["config"]["star"]["name"] = json!(name);
        }
        desk.write("map/fit.json", &fit.to_string());
    };
    let data = desk.json("sample/manifest.json")["data_sha256"].as_str().unwrap().to_owned();
    other(Some("AU Mic"), &data);
    let message = desk.refusal(&["report", "sample", "map"]);
    says(&message, &["map: is of another star (AU Mic) than sample (Beta & Co)"]);
    other(None, "0");
    says(&desk.refusal(&["report", "sample", "map"]), &["map: is of other observations than sample", "star.name"]);
    // other observations of the same star, and the same observations without a name
    for (name, sha) in [(Some("Beta & Co"), "0"), (None, data.as_str())] {
        other(name, sha);
        desk.succeed(&["report", "map", "sample", "--out", "page.html", "--force"]);
        assert!(desk.read("page.html").contains("<h1>Beta &amp; Co</h1>"));
    }
}

/// The name of a browser that is there.
fn browser() -> Option<String> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let there = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    names.into_iter().find(there).map(str::to_owned)
}

/// Opens the page in a frame of so many pixels: no error, and nothing wider than the frame.
fn shown(desk: &Desk, browser: &str, folder: &str, width: u32) {
    let numbers = seen(desk, browser, folder, width);
    println!("{folder} at {width}: {numbers:?}");
    assert!(numbers[0] <= width, "{folder}: {} pixels wide in {width}", numbers[0]);
    assert!(numbers[1] > 0 && numbers[2] > 0, "{folder}: {numbers:?}");
}

/// The same, and no figure or table has to be scrolled to be seen as a whole.
fn shown_whole(desk: &Desk, browser: &str, folder: &str, width: u32) {
    let numbers = seen(desk, browser, folder, width);
    println!("{folder} at {width}: {numbers:?}");
    assert!(numbers[0] <= width && numbers[3] == 0, "{folder} at {width}: {numbers:?}");
}

/// Width of the page in a frame of so many pixels, number of figures, of tables, and of parts that are cut off.
fn seen(desk: &Desk, browser: &str, folder: &str, width: u32) -> Vec<u32> {
    // a script of the test's own looks at the page
    let frame = format!(
        "<!doctype html><body><iframe id=f src=\"{folder}.html\" \
        style=\"width:{width}px;height:2000px;border:0\"></iframe>\
         <p id=out></p><script>f.onload=()=>{{const d=f.contentDocument;\
         const all=s=>[...d.querySelectorAll(s)];all('details').forEach(one=>one.open=true);\
         const cut=all('.scroll').filter(one=>one.scrollWidth>one.clientWidth+1).length;\
         out.textContent=['seen',d.documentElement.scrollWidth,all('svg').length,all('table').length,cut].join(' ')\
         }}</script>"
    );
    desk.write("frame.html", &frame);
    let profile = desk.path("browser");
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--allow-file-access-from-files",
            "--enable-logging=stderr",
        ])
        .arg(format!("--user-data-dir={}", profile.display()))
        .args(["--window-size=1400,2200", "--virtual-time-budget=10000", "--dump-dom"])
        .arg(format!("file://{}", desk.path("frame.html").display()))
        .output()
        .unwrap();
    let (page, log) = (text(&output.stdout), String::from_utf8_lossy(&output.stderr).into_owned());
    assert!(!log.contains("CONSOLE"), "{folder} at {width}: {log}");
    let seen = page.split("<p id=\"out\">seen ").nth(1).unwrap_or_else(|| panic!("{folder} at {width}: {page}"));
    seen.split('<').next().unwrap().split_whitespace().map(|number| number.parse().unwrap()).collect()
}
