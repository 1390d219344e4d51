//! The page as HTML.

use super::chapter::{Chapter, Table, Tone};
use super::citation;
use crate::figures::drawing::{COLUMN_MM, Figure, plain};
use serde_json::Value;
use std::fmt::Write as _;

const STYLE: &str = include_str!("style.css");

/// What every page begins with.
pub(super) const BEGINNING: &str = "<!doctype html>\n";

/// Points in the width of a column, and some: figures that are not wider fit a phone.
const NARROW_PT: f64 = 1.3 * COLUMN_MM * 72.0 / 25.4;

/// The page.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// Name of the folder.
    pub title: String,
    /// Star and data, label and text a line.
    pub subject: Vec<(String, String)>,
    /// What the folder holds, kind by kind.
    pub chapters: Vec<Chapter>,
    /// All figures.
    pub figures: Vec<Figure>,
    /// The config with all defaults filled in, where a file has it.
    pub config: Option<Value>,
    /// Version of the program and fingerprint of the data, where a file has them.
    pub provenance: Vec<(String, String)>,
}

/// The whole page.
pub(super) fn page(page: &Page) -> String {
    let title = escape(&page.title);
    let mut html = format!(
        "{BEGINNING}<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n<title>{title}: dimcmc \
         report</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>\n<h1>{title}</h1>\n<p>{}</p>\n",
        escape(&subtitle(page))
    );
    if !page.subject.is_empty() {
        html += "<dl class=\"subject\">";
        for (label, text) in &page.subject {
            let _ = write!(html, "<dt>{}</dt><dd>{}</dd>", escape(label), markup(text));
        }
        html += "</dl>\n";
    }
    html += "<nav>";
    for (k, chapter) in page.chapters.iter().enumerate() {
        let _ = write!(html, "<a href=\"#chapter{k}\">{}</a> ", escape(&chapter.heading));
    }
    html += "<a href=\"#figures\">Figures</a> ";
    if page.config.is_some() {
        html += "<a href=\"#config\">Config</a> ";
    }
    html += "<a href=\"#cite\">How to cite</a></nav>\n</header>\n<main>\n";
    for (k, one) in page.chapters.iter().enumerate() {
        chapter(&mut html, k, one);
    }
    html += "<section id=\"figures\">\n<h2>Figures</h2>\n";
    page.figures.iter().for_each(|one| figure(&mut html, one));
    html += "</section>\n";
    config(&mut html, page);
    html += "</main>\n";
    footer(&mut html, page);
    html + "</body>\n</html>\n"
}

fn subtitle(page: &Page) -> String {
    let kinds: Vec<String> = page.chapters.iter().map(|chapter| chapter.heading.to_lowercase()).collect();
    format!("Report of dimcmc: {}", kinds.join(", "))
}

fn chapter(html: &mut String, k: usize, chapter: &Chapter) {
    let _ = writeln!(html, "<section id=\"chapter{k}\">\n<h2>{}</h2>", escape(&chapter.heading));
    for (tone, sentence) in chapter.shown_verdicts() {
        let class = match tone {
            Tone::Good => "verdict good",
            Tone::Neutral => "verdict",
            Tone::Doubt => "verdict doubt",
        };
        let _ = writeln!(html, "<p class=\"{class}\">{}</p>", markup(sentence));
    }
    list(html, "Warnings", "warnings", &chapter.warnings);
    list(html, "Notes", "notes", &chapter.notes);
    for (caption, one) in &chapter.tables {
        let filled = one.without_empty_columns();
        if !filled.rows.is_empty() {
            table(html, caption, &filled);
        }
    }
    html.push_str("</section>\n");
}

fn list(html: &mut String, heading: &str, class: &str, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    let _ = writeln!(html, "<h3>{heading}</h3>\n<ul class=\"{class}\">");
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

fn config(html: &mut String, page: &Page) {
    let Some(config) = &page.config else { return };
    let _ = writeln!(
        html,
        "<section id=\"config\">\n<h2>Config</h2>\n<p class=\"source\">As it was resolved, defaults filled \
         in.</p>\n<details>\n<summary>Show</summary>\n<pre>{}</pre>\n</details>\n</section>",
        escape(&format!("{config:#}"))
    );
}

fn footer(html: &mut String, page: &Page) {
    let (program, version) = citation::program();
    let paper = citation::paper();
    html.push_str("<footer id=\"cite\">\n<h2>How to cite</h2>\n");
    let _ = writeln!(
        html,
        "<p>The method: P. Petit, J.-F. Donati, E. Hébrard, et al. (2015), <i>{}</i>, {} {}, {}, <a \
         href=\"https://doi.org/{doi}\">doi:{doi}</a>.</p>",
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

/// Control characters but the line feed, which HTML does not know, are written as escapes.
fn escape(text: &str) -> String {
    let is_odd = |c: char| c.is_control() && c != '\n';
    let shown = |c: char| if is_odd(c) { c.escape_default().to_string() } else { c.to_string() };
    let text: String = text.chars().map(shown).collect();
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The markup of figures as HTML: `*italic*`, `_{subscript}`, `^{superscript}`.
fn markup(text: &str) -> String {
    // a lone star or brace is a character like any other
    if text.matches('*').count() % 2 == 1 {
        return escape(&plain(text));
    }
    let mut html = String::new();
    let (mut italic, mut script) = (false, None);
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        match character {
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
    assert_eq!(markup("a_b {c} `d`"), "a_b {c} `d`");
}
