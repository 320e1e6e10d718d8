//! Pieces of HTML that are well-formed XML, too.

use std::fmt::Write;

/// Text as it may stand between tags and in attributes. Characters that XML forbids are left out.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\t' => out.push(character),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => out.push(c),
        }
    }
    out
}

/// A table; the first cell of a row names it. Nothing without rows.
pub fn table(headings: &[&str], rows: &[Vec<String>]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let mut out = String::from("<table>\n");
    if !headings.is_empty() {
        let cells: String = headings.iter().map(|h| format!("<th scope=\"col\">{}</th>", escape(h))).collect();
        let _ = writeln!(out, "<thead><tr>{cells}</tr></thead>");
    }
    out.push_str("<tbody>\n");
    for row in rows {
        out.push_str("<tr>");
        for (k, cell) in row.iter().enumerate() {
            let cell = escape(cell);
            let _ = if k == 0 { write!(out, "<th scope=\"row\">{cell}</th>") } else { write!(out, "<td>{cell}</td>") };
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody>\n</table>\n");
    out
}

/// A list; nothing without items.
pub fn list(items: &[String]) -> String {
    let items: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
    if items.is_empty() { items } else { format!("<ul>\n{items}</ul>\n") }
}

/// A section with its heading; nothing without a body.
pub fn section(name: &str, heading: &str, body: &str) -> String {
    if body.is_empty() {
        return String::new();
    }
    format!("<section id=\"{name}\">\n<h2>{}</h2>\n{body}</section>\n", escape(heading))
}

/// A number with up to four digits, a dash where there is none.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "\u{2013}".into()
    } else if value == 0.0 {
        "0".into()
    } else if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    } else {
        format!("{value:.3e}")
    }
}

/// A number and its unit.
pub fn quantity(value: f64, unit: &str) -> String {
    if value.is_finite() { format!("{} {unit}", number(value)) } else { number(value) }
}

/// A time in hours, minutes and seconds.
pub fn duration(seconds: f64) -> String {
    if !(seconds.is_finite() && seconds >= 0.0) {
        return number(f64::NAN);
    }
    let whole = seconds as u64;
    let (hours, minutes) = (whole / 3600, whole / 60 % 60);
    match (hours, minutes) {
        (0, 0) => format!("{seconds:.1} s"),
        (0, _) => format!("{minutes} min {} s", whole % 60),
        _ => format!("{hours} h {minutes} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_break_a_page_is_escaped() {
        assert_eq!(escape("a < b & \"c\" > d\u{0}\u{1b}[1m\n"), "a &lt; b &amp; &quot;c&quot; &gt; d[1m\n");
        assert!(table(&["a"], &[vec!["<script>".into(), "&".into()]]).contains("&lt;script&gt;</th><td>&amp;</td>"));
        assert_eq!((table(&["a"], &[]), list(&[]), section("a", "b", "")), Default::default());
    }

    #[test]
    fn numbers_have_up_to_four_digits_and_times_are_readable() {
        let numbers = [0.0, 1.23456, 0.0123456, -2600.0, 0.0072, 1e-9, f64::NAN].map(number);
        assert_eq!(numbers, ["0", "1.235", "0.01235", "-2600", "0.0072", "1.000e-9", "\u{2013}"]);
        assert_eq!([0.25, 75.0, 7322.0, -1.0].map(duration), ["0.2 s", "1 min 15 s", "2 h 2 min", "\u{2013}"]);
    }
}
