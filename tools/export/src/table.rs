//! Tables of every state with its full covariance, written during a run.

use navfuse_core::files::WholeFile;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_csv::{Axes, EstimateColumns, Table as CsvTable};
use parquet::basic::{Compression, Repetition, Type as Physical, ZstdLevel};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Numbers of a row group, the unit that is held in memory: 8 MiB.
const NUMBERS: usize = 1 << 20;

/// A format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// CSV.
    Csv,
    /// Parquet, every column in double precision.
    Parquet,
}

impl Table {
    /// The ending of the file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
        }
    }
}

/// Sink that writes a table with a row for each epoch.
pub struct TableSink {
    path: PathBuf,
    format: Table,
    axes: Axes,
    columns: EstimateColumns,
    /// From the start of the run until the file is whole.
    writer: Option<Writer>,
    /// Number of epochs.
    pub epochs: u64,
    /// Set once the file is whole.
    pub whole: bool,
}

enum Writer {
    Csv(CsvTable),
    Parquet(Columns),
}

impl TableSink {
    /// A table in a new file, which the start of the run creates.
    pub fn new(path: &Path, format: Table, axes: Axes) -> Self {
        let columns = EstimateColumns::default();
        let path = path.to_path_buf();
        Self { path, format, axes, columns, writer: None, epochs: 0, whole: false }
    }
}

impl Sink for TableSink {
    fn wants(&self) -> Wants {
        Wants::EPOCHS
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.columns = EstimateColumns::new(run, true, self.axes);
        let headings = self.columns.headings();
        self.writer = Some(match self.format {
            Table::Csv => {
                let mut table = CsvTable::create(self.path.clone())?;
                table.row(headings.iter().map(String::as_str))?;
                Writer::Csv(table)
            }
            Table::Parquet => Writer::Parquet(
                Columns::create(&self.path, headings)
                    .map_err(|e| StreamError::write(&self.path, e))?,
            ),
        });
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let time = epoch.state.time;
        let row = self.columns.row(epoch);
        self.epochs += 1;
        match &mut self.writer {
            Some(Writer::Csv(table)) => {
                table.time(time)?;
                row.iter().try_for_each(|v| table.number(*v))?;
                table.end_row()
            }
            Some(Writer::Parquet(columns)) => {
                columns.push(time.seconds(), row).map_err(|e| StreamError::write(&self.path, e))
            }
            None => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        match self.writer.take() {
            Some(Writer::Csv(mut table)) => {
                if table.finish()?.is_none() {
                    return Ok(None);
                }
            }
            Some(Writer::Parquet(columns)) => {
                columns.finish().map_err(|e| StreamError::write(&self.path, e))?;
            }
            None => return Ok(None),
        }
        self.whole = true;
        Ok(Some(self.path.display().to_string()))
    }
}

/// A Parquet file of numbers; NaN marks a value that is missing.
struct Columns {
    file: SerializedFileWriter<WholeFile>,
    columns: Vec<Vec<f64>>,
}

impl Columns {
    fn create(path: &Path, headings: &[String]) -> Result<Self, ParquetError> {
        let field = |name: &String| {
            let column = Type::primitive_type_builder(name, Physical::DOUBLE)
                .with_repetition(Repetition::REQUIRED)
                .build();
            column.map(Arc::new)
        };
        let fields = headings.iter().map(field).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("schema").with_fields(fields).build()?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .build();
        let file =
            SerializedFileWriter::new(WholeFile::create(path)?, schema.into(), properties.into())?;
        Ok(Self { file, columns: vec![Vec::new(); headings.len()] })
    }

    fn push(&mut self, time: f64, row: &[f64]) -> Result<(), ParquetError> {
        let values = std::iter::once(time).chain(row.iter().copied());
        self.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        let rows = self.columns.first().map_or(0, Vec::len);
        if rows * self.columns.len() < NUMBERS { Ok(()) } else { self.flush() }
    }

    fn flush(&mut self) -> Result<(), ParquetError> {
        if self.columns.first().is_none_or(Vec::is_empty) {
            return Ok(());
        }
        let mut group = self.file.next_row_group()?;
        for values in &mut self.columns {
            if let Some(mut column) = group.next_column()? {
                column.typed::<DoubleType>().write_batch(values, None, None)?;
                column.close()?;
                values.clear();
            }
        }
        group.close()?;
        Ok(())
    }

    fn finish(mut self) -> Result<(), ParquetError> {
        self.flush()?;
        self.file.into_inner()?.finish()?;
        Ok(())
    }
}
