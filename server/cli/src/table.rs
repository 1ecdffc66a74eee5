//! Formats rows of texts as a table.

use unicode_width::UnicodeWidthStr;

/// Makes a text from elsewhere safe for a terminal: without control characters.
pub(super) fn harmless(text: &str) -> String {
    text.replace(char::is_control, "\u{fffd}")
}

/// Writes a table with a line for each row, below the headings. Columns are as wide as their widest cell.
pub(super) fn table<const N: usize>(headings: [&str; N], rows: &[[String; N]]) -> String {
    let rows: Vec<[String; N]> = rows
        .iter()
        .map(|row| std::array::from_fn(|column| harmless(&row[column])))
        .collect();
    let widths: [usize; N] = std::array::from_fn(|column| {
        let cells = rows.iter().map(|row| row[column].width());
        cells
            .chain([headings[column].width()])
            .max()
            .unwrap_or_default()
    });
    let line = |cells: [&str; N]| {
        let padded = cells.iter().zip(widths);
        let padded =
            padded.map(|(cell, width)| cell.to_string() + &" ".repeat(width - cell.width()));
        let line: Vec<String> = padded.collect();
        line.join("  ").trim_end().to_owned() + "\n"
    };
    let rows = rows
        .iter()
        .map(|row| line(std::array::from_fn(|column| row[column].as_str())));
    [line(headings)].into_iter().chain(rows).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_stand_below_their_headings_whatever_their_characters() {
        let rows = [["σ_n", "1"], ["接触", "22"]].map(|row| row.map(String::from));
        let shown = table(["NAME", "N"], &rows);
        assert_eq!(shown, "NAME  N\nσ_n   1\n接触  22\n");
        let rows = [["a\n\x1b[2Jb".to_owned()]];
        assert_eq!(table(["NAME"], &rows), "NAME\na\u{fffd}\u{fffd}[2Jb\n");
    }
}
