//! A table as an Arrow IPC file with one record batch, which pandas, polars and DuckDB open without copying.

use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt32Array};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema};

use crate::table::{Table, Values};

/// Writes a table as an Arrow IPC file. A missing number is null.
///
/// # Errors
///
/// The reason in words, if the columns have different lengths.
pub fn file(table: &Table) -> Result<Vec<u8>, String> {
    written(table).map_err(|error| error.to_string())
}

fn written(table: &Table) -> Result<Vec<u8>, ArrowError> {
    let (fields, columns): (Vec<Field>, Vec<ArrayRef>) = table
        .columns
        .iter()
        .map(|column| {
            let (kind, values, nullable) = array(&column.values);
            (Field::new(column.name.clone(), kind, nullable), values)
        })
        .unzip();
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), columns)?;
    let mut writer = FileWriter::try_new(Vec::new(), &schema)?;
    writer.write(&batch)?;
    writer.into_inner()
}

/// A column as an Arrow array: its type, the array, and whether it may have missing numbers. That depends on the kind
/// of column and not on its values, so that the files of two jobs have the same schema.
fn array(values: &Values) -> (DataType, ArrayRef, bool) {
    match values {
        Values::Real(values) => {
            let present = values.iter().map(|v| v.is_finite().then_some(*v));
            let array = Float64Array::from_iter(present);
            (DataType::Float64, Arc::new(array), true)
        }
        Values::Whole(values) => {
            let array = UInt32Array::from_iter_values(values.iter().copied());
            (DataType::UInt32, Arc::new(array), false)
        }
        Values::Text(values) => {
            let array = StringArray::from_iter_values(values);
            (DataType::Utf8, Arc::new(array), false)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::tests::{history, profile};
    use arrow_array::Array;
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float64Type, UInt32Type};
    use arrow_ipc::reader::FileReader;

    fn read(table: &Table) -> RecordBatch {
        let bytes = file(table).unwrap();
        let mut reader = FileReader::try_new(std::io::Cursor::new(bytes), None).unwrap();
        let batch = reader.next().unwrap().unwrap();
        assert!(reader.next().is_none());
        batch
    }

    #[test]
    fn every_column_is_read_back_bit_for_bit() {
        let profile = profile();
        let batch = read(&Table::of_profile(&profile));
        assert_eq!((batch.num_rows(), batch.num_columns()), (3, 12));
        let stress = batch.column_by_name("tangential_stress").unwrap();
        let back: Vec<u64> = stress
            .as_primitive::<Float64Type>()
            .values()
            .iter()
            .map(|v| v.to_bits())
            .collect();
        let sent: Vec<u64> = profile
            .tangential_stress
            .iter()
            .map(|v| v.to_bits())
            .collect();
        assert_eq!(back, sent);
        let state = batch.column_by_name("state").unwrap();
        assert_eq!(state.as_string::<i32>().value(1), "slip");
    }

    #[test]
    fn a_missing_number_is_null_and_a_table_may_be_empty() {
        let batch = read(&Table::of_history(&history()));
        let r_f = batch.column_by_name("r_f").unwrap();
        assert!(r_f.is_null(0) && !r_f.is_null(1));
        let k = batch.column_by_name("k").unwrap();
        assert_eq!(k.as_primitive::<UInt32Type>().values(), &[1, 2]);
        assert_eq!(read(&Table::of_history(&[])).num_rows(), 0);
    }
}
