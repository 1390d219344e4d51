//! The page as HTML.

use super::chapter::{Table, Tone};
use super::citation;
use super::section::{Folded, Kind, Section};
use crate::figures::drawing::{COLUMN_MM, Figure, plain};
use serde_json::Value;
use std::fmt::Write as _;

const STYLE: &str = include_str!("style.css");

/// The beginning of every page.
pub(super) const BEGINNING: &str = "<!doctype html>\n";

/// Slightly more than the width of a column in points: figures up to this width fit a phone.
const NARROW_PT: f64 = 1.3 * COLUMN_MM * 72.0 / 25.4;

/// The page.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Page {
    /// Name of the star.
    pub title: String,
    pub subtitle: String,
    /// Star and data, one label and text per line.
    pub subject: Vec<(String, String)>,
    /// The maps that the script rotates.
    pub turning: Option<Value>,
    /// The conclusions of the results.
    pub statements: Vec<Statement>,
    /// Caveats and warnings.
    pub warnings: Vec<String>,
    pub sections: Vec<Section>,
    /// The assumptions: tables, each with a caption.
    pub assumed: Vec<(String, Table)>,
    /// Quantities measured from the observations beforehand.
    pub measured: Vec<String>,
    /// The config with all defaults filled in, if a file contains it.
    pub config: Option<Value>,
    /// Version of the program and fingerprint of the data, if a file contains them.
    pub provenance: Vec<(String, String)>,
}

/// The conclusion of a result, in one sentence.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Statement {
    pub kind: Kind,
    pub tone: Tone,
    pub sentence: String,
}

/// The whole page.
pub(super) fn page(page: &Page) -> String {
    let title = escape(&page.title);
    let mut html = format!(
        "{BEGINNING}<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n<title>{title}: dimcmc \
         report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<div>\n<h1>{title}</h1>\n<p>{}</p>\n",
        escape(&page.subtitle)
    );
    if !page.subject.is_empty() {
        html += "<dl class=\"subject\">";
        for (label, text) in &page.subject {
            let _ = write!(html, "<dt>{}</dt><dd>{}</dd>", escape(label), markup(text));
        }
        html += "</dl>\n";
    }
    let is_assumed = page.assumed.iter().any(|(_, table)| !table.rows.is_empty());
    html += "<nav>";
    for section in &page.sections {
        let (id, heading) = section.kind.names();
        let _ = write!(html, "<a href=\"#{id}\">{heading}</a> ");
    }
    if is_assumed {
        html += "<a href=\"#assumed\">Assumptions</a> ";
    }
    html += "<a href=\"#cite\">How to cite</a></nav>\n</div>\n";
    if page.turning.is_some() {
        html += STAR;
    }
    html += "</header>\n<main>\n";
    verdict(&mut html, page);
    page.sections.iter().for_each(|one| section(&mut html, one));
    if is_assumed {
        assumed(&mut html, page);
    }
    html += "</main>\n";
    footer(&mut html, page);
    if let Some(turning) = &page.turning {
        let data = turning.to_string().replace('<', "\\u003c");
        let _ = writeln!(html, "<script type=\"application/json\" id=\"star-data\">{data}</script>");
        let _ = writeln!(html, "<script>\n{TURN}</script>");
    }
    html + "</body>\n</html>\n"
}

/// The rotating star.
const STAR: &str = "<div class=\"star\">\n<canvas id=\"star\" width=\"260\" height=\"260\" role=\"img\" \
aria-label=\"The star as it turns, with the spots of the map\"></canvas>\n<p><button id=\"star-play\" \
type=\"button\">Rotate</button> <input id=\"star-time\" type=\"range\" min=\"0\" max=\"1000\" step=\"any\" value=\"0\" \
aria-label=\"Time\"></p>\n<p id=\"star-told\"></p>\n\
<noscript><p>The maps below show the same.</p></noscript>\n</div>\n";

const TURN: &str = include_str!("star.js");

fn verdict(html: &mut String, page: &Page) {
    if page.statements.is_empty() && page.warnings.is_empty() {
        return;
    }
    html.push_str("<section id=\"verdict\">\n<h2>Verdict</h2>\n");
    for Statement { kind, tone, sentence } in &page.statements {
        let class = match tone {
            Tone::Good => "verdict good",
            Tone::Neutral => "verdict",
            Tone::Doubt => "verdict doubt",
        };
        let (id, heading) = kind.names();
        let sentence = markup(sentence);
        let _ = writeln!(html, "<p class=\"{class}\">{sentence} <a href=\"#{id}\">{heading}</a></p>");
    }
    list(html, "Warnings", "warnings", &page.warnings);
    html.push_str("</section>\n");
}

fn section(html: &mut String, section: &Section) {
    let (id, heading) = section.kind.names();
    let _ = writeln!(html, "<section id=\"{id}\">\n<h2>{heading}</h2>");
    section.figures.iter().for_each(|one| figure(html, one));
    tables(html, &section.tables);
    list(html, "", "notes", &section.notes);
    let Folded { summary, figures, tables: folded } = &section.folded;
    if !(figures.is_empty() && folded.is_empty()) {
        let _ = writeln!(html, "<details>\n<summary>{summary}</summary>");
        tables(html, folded);
        figures.iter().for_each(|one| figure(html, one));
        html.push_str("</details>\n");
    }
    html.push_str("</section>\n");
}

fn assumed(html: &mut String, page: &Page) {
    html.push_str("<section id=\"assumed\">\n<h2>Assumptions</h2>\n<div class=\"beside\">\n");
    tables(html, &page.assumed);
    html.push_str("</div>\n");
    list(html, "Measured on the observations", "notes", &page.measured);
    if let Some(config) = &page.config {
        let text = escape(&format!("{config:#}"));
        let _ =
            writeln!(html, "<details>\n<summary>Config, defaults filled in</summary>\n<pre>{text}</pre>\n</details>");
    }
    html.push_str("</section>\n");
}

/// The tables that are not empty.
fn tables(html: &mut String, tables: &[(String, Table)]) {
    for (caption, one) in tables {
        let filled = one.without_empty_columns();
        if !filled.rows.is_empty() {
            table(html, caption, &filled);
        }
    }
}

fn list(html: &mut String, heading: &str, class: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    if !heading.is_empty() {
        let _ = writeln!(html, "<h3>{heading}</h3>");
    }
    let _ = writeln!(html, "<ul class=\"{class}\">");
    for line in lines {
        let _ = writeln!(html, "<li>{}</li>", markup(line));
    }
    html.push_str("</ul>\n");
}

fn table(html: &mut String, caption: &str, table: &Table) {
    let class = if table.head.is_empty() { " class=\"pairs\"" } else { "" };
    let _ = writeln!(html, "<div class=\"scroll\"><table{class}>\n<caption>{}</caption>", escape(caption));
    if !table.head.is_empty() {
        let cells: String = table.head.iter().map(|text| format!("<th scope=\"col\">{}</th>", markup(text))).collect();
        let _ = writeln!(html, "<thead><tr>{cells}</tr></thead>");
    }
    html.push_str("<tbody>\n");
    for row in &table.rows {
        let cells: String = row.iter().map(|text| format!("<td>{}</td>", markup(text))).collect();
        let _ = writeln!(html, "<tr>{cells}</tr>");
    }
    html.push_str("</tbody></table></div>\n");
}

fn figure(html: &mut String, figure: &Figure) {
    let class = if figure.width <= NARROW_PT { "narrow" } else { "wide" };
    let caption = markup(&figure.caption);
    let _ = writeln!(html, "<figure class=\"{class}\">\n<div class=\"scroll\">\n{}</div>", figure.svg());
    let _ = writeln!(html, "<figcaption>{caption}</figcaption>\n</figure>");
}

fn footer(html: &mut String, page: &Page) {
    let (program, version) = citation::program();
    let paper = citation::paper();
    html.push_str("<footer id=\"cite\">\n<h2>How to cite</h2>\n");
    let _ = writeln!(
        html,
        "<p>Static maps with an orbit inside, on which the method builds: P. Petit, J.-F. Donati, E. Hébrard, et al. \
         (2015), <i>{}</i>, {} {}, {}, <a href=\"https://doi.org/{doi}\">doi:{doi}</a>.</p>",
        escape(paper.title),
        escape(paper.journal),
        paper.volume,
        paper.start,
        doi = paper.doi
    );
    let commit = env!("DIMCMC_COMMIT");
    let _ = writeln!(html, "<p>The program: <i>{}</i>, version {version}{commit}.</p>", escape(program));
    if !page.provenance.is_empty() {
        html.push_str("<p class=\"source\">");
        for (label, value) in &page.provenance {
            let _ = write!(html, "{} {}<br>", escape(label), escape(value));
        }
        html.push_str("</p>\n");
    }
    html.push_str("</footer>\n");
}

/// Escapes text, and control characters except the line feed, which HTML does not allow.
fn escape(text: &str) -> String {
    let is_odd = |c: char| c.is_control() && c != '\n';
    let shown = |c: char| if is_odd(c) { c.escape_default().to_string() } else { c.to_string() };
    let text: String = text.chars().map(shown).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The markup of figures as HTML: `*italic*`, `_{subscript}`, `^{superscript}`; and text between backticks as code.
fn markup(text: &str) -> String {
    // an unpaired star or brace is an ordinary character
    if text.matches('*').count() % 2 == 1 {
        return escape(&plain(text));
    }
    let has_code = text.matches('`').count().is_multiple_of(2);
    let mut html = String::new();
    let (mut italic, mut script, mut code) = (false, None, false);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
            '`' if has_code => {
                html += if code { "</code>" } else { "<code>" };
                code = !code;
            }
            '*' => {
                html += if italic { "</i>" } else { "<i>" };
                italic = !italic;
            }
            '_' | '^' if script.is_none() && characters.next_if_eq(&'{').is_some() => {
                let tag = if character == '_' { "sub" } else { "sup" };
                let _ = write!(html, "<{tag}>");
                script = Some(tag);
            }
            '}' if script.is_some() => {
                let _ = write!(html, "</{}>", script.take().unwrap_or_default());
            }
            character => html += &escape(&character.to_string()),
        }
    }
    html
}

#[test]
fn markup_is_html_and_nothing_else_is() {
    assert_eq!(markup("*P*_{orb} < 1"), "<i>P</i><sub>orb</sub> &lt; 1");
    assert_eq!(markup("a_b {c} `d` e"), "a_b {c} <code>d</code> e");
    assert_eq!(markup("a lone ` stays"), "a lone ` stays");
}
