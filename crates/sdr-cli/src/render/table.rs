//! Tables: columns as wide as their widest cell, the last one as wide as what is left.

use super::units::shorten;

/// Rows under a head.
#[derive(Debug)]
pub(crate) struct Table<const N: usize> {
    rows: Vec<[String; N]>,
}

impl<const N: usize> Table<N> {
    /// An empty table with this head.
    pub(crate) fn new(head: [&str; N]) -> Self {
        Self { rows: vec![head.map(Into::into)] }
    }

    /// Appends a row.
    pub(crate) fn row(&mut self, cells: [String; N]) {
        self.rows.push(cells);
    }

    /// The lines, each at most `columns` wide; the last cell is shortened to fit.
    pub(crate) fn lines(&self, columns: usize) -> Vec<String> {
        let widths: [usize; N] = std::array::from_fn(|column| {
            self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0)
        });
        let line = |row: &[String; N]| {
            let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
            let line = cells.collect::<Vec<_>>().join("  ");
            shorten(line.trim_end(), columns)
        };
        self.rows.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_lines_end_at_the_bar() {
        let mut table = Table::new(["ROBOT", "NOTE"]);
        table.row(["robot-1".into(), "short".into()]);
        table.row(["r".into(), "a note that is longer than the line".into()]);
        let lines = table.lines(24);
        assert_eq!(lines, ["ROBOT    NOTE", "robot-1  short", "r        a note that..."]);
    }
}
