//! Pages that open from disk: one file each, without network.

mod charts;
mod plot;
mod report;
mod scrubber;
mod trade;

use std::fmt::Write;

const STYLE: &str = include_str!("style.css");

/// A page around `body`. Nothing may be fetched: the policy in its head forbids it.
fn document(title: &str, heading: &str, body: &str) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'; \
         script-src 'unsafe-inline'\">\
         <title>{}</title><style>{STYLE}</style></head><body><main>\n<h1>{}</h1>\n{body}</main></body></html>\n",
        escaped(title),
        escaped(heading),
    );
    page
}

/// A table; cells hold markup.
fn table(titles: &[String], rows: &[Vec<String>]) -> String {
    let head: String = titles.iter().map(|title| format!("<th scope=\"col\">{title}</th>")).collect();
    let row = |row: &Vec<String>| {
        let cells: String = row.iter().map(|cell| format!("<td>{cell}</td>")).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let rows: String = rows.iter().map(row).collect();
    // Wide tables scroll, and whoever has no mouse must be able to get there.
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"group\" aria-label=\"table\"><table><thead><tr>{head}</tr></thead>\
         <tbody>\n{rows}</tbody></table></div>"
    )
}

/// Names come from files: they must not become markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The last part of a path as the user wrote it.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

fn percent(part: u64, whole: u64) -> String {
    format!("{:.2} %", 100.0 * part as f64 / whole.max(1) as f64)
}

/// 1234567 as `1,234,567`.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_names_escaped() {
        assert_eq!([file_name("/a/b.gltf"), file_name("b.gltf"), file_name("")], ["b.gltf", "b.gltf", ""]);
        assert_eq!(["0", "999", "1,000", "12,345,678"], [0, 999, 1000, 12_345_678].map(grouped));
        let page = document("<t>", "a & \"b\"", "<p>body</p>");
        assert!(page.contains("<title>&lt;t&gt;</title>") && page.contains("<h1>a &amp; &quot;b&quot;</h1>"));
        assert!(page.contains("<p>body</p>"));
    }

    #[test]
    fn cells_may_hold_markup() {
        let text = table(&["a".into()], &[vec!["<b>1</b>".into()]]);
        assert!(text.contains("<th scope=\"col\">a</th>") && text.contains("<td><b>1</b></td>"));
    }
}
