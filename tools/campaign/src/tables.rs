//! Tables in Parquet files: required columns of text, integers and real numbers; NaN marks a
//! missing value.

use crate::CampaignError;
use navfuse_core::files::WholeFile;
use navfuse_core::input::{self, Input};
use parquet::basic::{Compression, ZstdLevel};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use parquet::{basic::LogicalType, basic::Repetition, basic::Type as Physical};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows of a row group, the unit that is held in memory.
const ROWS: usize = 8192;

/// Names of a table's columns, grouped by type in this order.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Columns of text.
    pub text: Vec<String>,
    /// Columns of integers.
    pub whole: Vec<String>,
    /// Columns of real numbers.
    pub real: Vec<String>,
}

/// Rows of a table, column by column.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    pub text: Vec<Vec<ByteArray>>,
    pub whole: Vec<Vec<i64>>,
    pub real: Vec<Vec<f64>>,
}

impl Rows {
    fn like(names: &Names) -> Self {
        Self {
            text: vec![Vec::new(); names.text.len()],
            whole: vec![Vec::new(); names.whole.len()],
            real: vec![Vec::new(); names.real.len()],
        }
    }

    /// Returns the number of rows.
    pub fn count(&self) -> usize {
        let lengths = [
            self.text.first().map(Vec::len),
            self.whole.first().map(Vec::len),
            self.real.first().map(Vec::len),
        ];
        lengths.into_iter().flatten().next().unwrap_or(0)
    }
}

/// A file that is summed up as it is written.
struct Summed {
    file: WholeFile,
    sum: crc32fast::Hasher,
}

impl Write for Summed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.sum.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// The CRC-32 of a file, in hexadecimal digits.
pub fn checksum(path: &Path) -> io::Result<String> {
    let mut file = input::open(path)?;
    let mut sum = crc32fast::Hasher::new();
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(format!("{:08x}", sum.finalize())),
            count => sum.update(&block[..count]),
        }
    }
}

/// Writes a table.
pub struct TableWriter {
    path: PathBuf,
    file: SerializedFileWriter<Summed>,
    rows: Rows,
}

impl TableWriter {
    /// Creates an empty table in a new file, which takes its name when the table is complete.
    ///
    /// # Errors
    /// Returns an error if the file cannot be created.
    pub fn create(path: &Path, names: &Names) -> Result<Self, CampaignError> {
        let fail = |e: ParquetError| CampaignError::file(path, e);
        let column = |name: &String, physical: Physical, logical: Option<LogicalType>| {
            let built = Type::primitive_type_builder(name, physical)
                .with_repetition(Repetition::REQUIRED)
                .with_logical_type(logical)
                .build();
            built.map(Arc::new)
        };
        let text =
            names.text.iter().map(|n| column(n, Physical::BYTE_ARRAY, Some(LogicalType::String)));
        let whole = names.whole.iter().map(|n| column(n, Physical::INT64, None));
        let real = names.real.iter().map(|n| column(n, Physical::DOUBLE, None));
        let fields = text.chain(whole).chain(real).collect::<Result<Vec<_>, _>>().map_err(fail)?;
        let schema =
            Type::group_type_builder("schema").with_fields(fields).build().map_err(fail)?;
        // measured numbers hardly repeat: a dictionary or statistics would only enlarge the file
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .build();
        let file = WholeFile::create(path).map_err(|e| CampaignError::file(path, e))?;
        let file = Summed { file, sum: crc32fast::Hasher::new() };
        let file = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))
            .map_err(fail)?;
        Ok(Self { path: path.to_path_buf(), file, rows: Rows::like(names) })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn push<'a>(
        &mut self,
        text: &[&str],
        whole: &[i64],
        real: impl IntoIterator<Item = &'a f64>,
    ) -> Result<(), CampaignError> {
        self.rows
            .text
            .iter_mut()
            .zip(text)
            .for_each(|(column, v)| column.push(ByteArray::from(*v)));
        self.rows.whole.iter_mut().zip(whole).for_each(|(column, v)| column.push(*v));
        self.rows.real.iter_mut().zip(real).for_each(|(column, v)| column.push(*v));
        if self.rows.count() == ROWS { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), CampaignError> {
        self.write_group().map_err(|e| CampaignError::file(&self.path, e))
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.rows.count() == 0 {
            return Ok(());
        }
        let mut group = self.file.next_row_group()?;
        macro_rules! write {
            ($columns:expr, $kind:ty) => {
                for values in $columns {
                    if let Some(mut column) = group.next_column()? {
                        column.typed::<$kind>().write_batch(values, None, None)?;
                        column.close()?;
                        values.clear();
                    }
                }
            };
        }
        write!(&mut self.rows.text, ByteArrayType);
        write!(&mut self.rows.whole, Int64Type);
        write!(&mut self.rows.real, DoubleType);
        group.close()?;
        Ok(())
    }

    /// Completes the file, and returns its [`checksum`].
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn finish(mut self) -> Result<String, CampaignError> {
        self.flush()?;
        let path = self.path;
        let Summed { file, sum } =
            self.file.into_inner().map_err(|e| CampaignError::file(&path, e))?;
        file.finish().map_err(|e| CampaignError::file(&path, e))?;
        Ok(format!("{:08x}", sum.finalize()))
    }
}

/// Reads a table of integers and real numbers, a row group at a time.
pub struct TableReader {
    path: PathBuf,
    file: SerializedFileReader<File>,
    /// The open file, which no result replaces meanwhile.
    _input: Input,
    names: Names,
}

impl TableReader {
    /// Opens a table that has exactly these columns.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or has other columns.
    pub fn open(path: &Path, names: &Names) -> Result<Self, CampaignError> {
        const AGAIN: &str = "the file is not complete; make it again with the same command";
        let input = input::open(path).map_err(|e| CampaignError::file_with(path, e, AGAIN))?;
        let file = input.try_clone().map_err(|e| CampaignError::file(path, e))?;
        let file = SerializedFileReader::new(file)
            .map_err(|e| CampaignError::file_with(path, e, AGAIN))?;
        let found = file
            .metadata()
            .file_metadata()
            .schema_descr()
            .columns()
            .iter()
            .map(|c| c.name().to_owned());
        let wanted: Vec<&String> =
            names.text.iter().chain(&names.whole).chain(&names.real).collect();
        let found: Vec<String> = found.collect();
        if !found.iter().eq(wanted) {
            return Err(CampaignError::content(
                path,
                "the columns differ from campaign.json in the same folder",
            ));
        }
        Ok(Self { path: path.to_path_buf(), file, _input: input, names: names.clone() })
    }

    /// Passes the rows to `each`, a row group at a time.
    ///
    /// # Errors
    /// Returns an error if the rows cannot be read or `each` fails.
    pub fn groups(
        &self,
        mut each: impl FnMut(&Rows) -> Result<(), CampaignError>,
    ) -> Result<(), CampaignError> {
        for group in 0..self.file.num_row_groups() {
            let rows = self.group(group).map_err(|e| CampaignError::file(&self.path, e))?;
            each(&rows)?;
        }
        Ok(())
    }

    fn group(&self, group: usize) -> Result<Rows, ParquetError> {
        let reader = self.file.get_row_group(group)?;
        let count = reader.metadata().num_rows() as usize;
        let mut rows = Rows::like(&self.names);
        let (mut whole, mut real, mut text) = (0, 0, 0);
        for column in 0..reader.num_columns() {
            match reader.get_column_reader(column)? {
                ColumnReader::Int64ColumnReader(mut r) => {
                    r.read_records(count, None, None, &mut rows.whole[whole])?;
                    whole += 1;
                }
                ColumnReader::DoubleColumnReader(mut r) => {
                    r.read_records(count, None, None, &mut rows.real[real])?;
                    real += 1;
                }
                ColumnReader::ByteArrayColumnReader(mut r) => {
                    r.read_records(count, None, None, &mut rows.text[text])?;
                    text += 1;
                }
                _ => return Err(ParquetError::General("unexpected column type".into())),
            }
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_any_length_reads_back_as_written() -> Result<(), CampaignError> {
        let folder = tempfile::tempdir().map_err(|e| CampaignError::file(Path::new("."), e))?;
        let path = folder.path().join("t.parquet");
        let names = Names {
            text: vec!["a".into()],
            whole: vec!["b".into()],
            real: vec!["c.d".into(), "e".into()],
        };
        for count in [0, 1, ROWS, 2 * ROWS + 3] {
            let mut table = TableWriter::create(&path, &names)?;
            for k in 0..count {
                table.push(&[&k.to_string()], &[k as i64], &[k as f64, f64::NAN])?;
            }
            table.finish()?;
            let mut next = 0;
            TableReader::open(&path, &names)?.groups(|rows| {
                for k in 0..rows.count() {
                    assert_eq!(rows.whole[0][k], next);
                    assert_eq!(rows.real[0][k], next as f64);
                    assert_eq!(rows.text[0][k].as_utf8().ok(), Some(next.to_string().as_str()));
                    assert!(rows.real[1][k].is_nan());
                    next += 1;
                }
                Ok(())
            })?;
            assert_eq!(next as usize, count);
        }
        Ok(())
    }

    #[test]
    fn a_truncated_table_is_rejected_with_the_remedy() -> Result<(), std::io::Error> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("cut.parquet");
        std::fs::write(&path, b"PAR1 and no more")?;
        let error = TableReader::open(&path, &Names::default())
            .err()
            .map_or_else(String::new, |e| e.to_string());
        assert!(error.contains("cut.parquet") && error.contains("make it again"), "{error}");
        Ok(())
    }
}
