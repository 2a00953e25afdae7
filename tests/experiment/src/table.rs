//! Tables, as Markdown for pages and as CSV for programs.

/// The value of a table cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Text.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A number with its decimals for people.
    Number(f64, usize),
    /// No value.
    Missing,
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl Value {
    /// A number with about three digits, or a plain 0; missing if there is none.
    pub fn number(value: impl Into<Option<f64>>) -> Self {
        let Some(value) = value.into().filter(|value| value.is_finite()) else {
            return Self::Missing;
        };
        let decimals = match value.abs() {
            0.0 => 0,
            ..0.1 => 3,
            ..9.995 => 2,
            ..99.95 => 1,
            _ => 0,
        };
        Self::Number(value, decimals)
    }

    /// A number with fixed decimals; missing if there is none.
    pub fn decimals(value: impl Into<Option<f64>>, decimals: usize) -> Self {
        match value.into().filter(|value| value.is_finite()) {
            Some(value) => Self::Number(value, decimals),
            None => Self::Missing,
        }
    }

    /// For people.
    pub fn to_text(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => with_separators(&count.to_string()),
            Self::Number(value, decimals) => {
                let text = format!("{value:.decimals$}");
                // No "-0.0".
                let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
                with_separators(if is_zero {
                    text.trim_start_matches('-')
                } else {
                    &text
                })
            }
            Self::Missing => "–".to_owned(),
        }
    }

    /// For programs.
    fn to_csv(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(value, _) => csv_number(*value),
            Self::Missing => String::new(),
        }
    }

    fn is_number(&self) -> bool {
        matches!(self, Self::Count(_) | Self::Number(..))
    }
}

/// A number for CSV with six significant digits, more than any measurement here has.
pub fn csv_number(value: f64) -> String {
    if !value.is_finite() {
        return String::new();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = usize::try_from(5 - magnitude).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Commas between thousands.
pub fn with_separators(number: &str) -> String {
    let (sign, rest) = number.strip_prefix('-').map_or(("", number), |rest| ("-", rest));
    let (whole, fraction) = rest.split_at(rest.find('.').unwrap_or(rest.len()));
    let mut text = String::from(sign);
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text + fraction
}

/// A table with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name of its CSV file, without extension.
    pub file: &'static str,
    /// Title.
    pub title: String,
    /// Names of the columns.
    pub header: Vec<String>,
    /// The rows, each as long as the header.
    pub rows: Vec<Vec<Value>>,
}

impl Table {
    /// An empty table.
    pub fn new<H: Into<String>>(
        file: &'static str,
        title: impl Into<String>,
        header: impl IntoIterator<Item = H>,
    ) -> Self {
        Self {
            file,
            title: title.into(),
            header: header.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn push(&mut self, row: Vec<Value>) {
        debug_assert_eq!(row.len(), self.header.len(), "a row of {}", self.file);
        self.rows.push(row);
    }

    /// Whether a column has only numbers.
    pub fn is_numeric(&self, column: usize) -> bool {
        let mut values = self
            .rows
            .iter()
            .map(|row| &row[column])
            .filter(|value| **value != Value::Missing);
        values.all(Value::is_number)
    }

    /// As Markdown, without the title.
    pub fn to_markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = String>| {
            let cells: Vec<_> = cells.map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let mut text = line(&mut self.header.iter().cloned());
        text += &line(&mut (0..self.header.len()).map(|column| {
            let marker = if self.is_numeric(column) { "--:" } else { "---" };
            marker.to_owned()
        }));
        for row in &self.rows {
            text += &line(&mut row.iter().map(Value::to_text));
        }
        text
    }

    /// As CSV with a header.
    pub fn to_csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let records = std::iter::once(self.header.clone()).chain(
            self.rows
                .iter()
                .map(|row| row.iter().map(Value::to_csv).collect()),
        );
        for record in records {
            // Writing to memory fails only for rows of different lengths.
            writer
                .write_record(record)
                .expect("rows are as long as the header");
        }
        let bytes = writer.into_inner().expect("memory can be written");
        String::from_utf8(bytes).expect("text stays text")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new("names", "Names", ["name", "count", "share"]);
        table.push(vec!["a, \"b\" | c".into(), 1_234_567.into(), Value::number(0.5)]);
        table.push(vec!["d".into(), 999.into(), Value::number(f64::NAN)]);
        table
    }

    #[test]
    fn text_has_separators_and_few_digits() {
        assert_eq!(Value::Count(456_287).to_text(), "456,287");
        assert_eq!(Value::Number(-1_234_567.891, 1).to_text(), "-1,234,567.9");
        assert_eq!(Value::number(12.345).to_text(), "12.3");
        assert_eq!(Value::number(9.999).to_text(), "10.0");
        assert_eq!(Value::Number(-0.01, 1).to_text(), "0.0");
        assert_eq!(Value::number(0.0).to_text(), "0");
        assert_eq!(Value::number(0.0004).to_text(), "0.000");
        assert_eq!(Value::number(None).to_text(), "–");
    }

    #[test]
    fn csv_has_plain_numbers() {
        assert_eq!(csv_number(456_287.0), "456287");
        assert_eq!(csv_number(0.000_123_456_78), "0.000123457");
        assert_eq!(csv_number(-2.5), "-2.5");
        assert_eq!(csv_number(100.0), "100");
        assert_eq!(csv_number(f64::INFINITY), "");
    }

    #[test]
    fn csv_round_trips() {
        let text = table().to_csv();
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        assert_eq!(
            reader.headers().expect("a header"),
            &["name", "count", "share"][..]
        );
        let rows: Vec<_> = reader.records().map(|row| row.expect("a row")).collect();
        assert_eq!(&rows[0][0], "a, \"b\" | c");
        assert_eq!(&rows[0][1], "1234567");
        assert_eq!(&rows[1][2], "");
    }

    #[test]
    fn markdown_aligns_numbers_and_keeps_its_columns() {
        let text = table().to_markdown();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[1], "| --- | --: | --: |");
        assert_eq!(lines[2], "| a, \"b\" \\| c | 1,234,567 | 0.50 |");
        assert_eq!(lines[3], "| d | 999 | – |");
    }
}
