//! NumPy's archive: a zip of arrays with names. The `.npy` header of an array is a dozen lines and is written here: the
//! crates for it bring a whole matrix library (`ndarray-npy`) or five compression methods with their C code (`npyz`).

use std::io::{Cursor, Write};

use zip::write::{SimpleFileOptions, ZipWriter};
use zip::{CompressionMethod, result::ZipResult};

use crate::number::Number;
use crate::table::{Table, Values};

/// An archive that is being written. `numpy.load` reads the archive as arrays by name.
pub struct Npz {
    zip: ZipWriter<Cursor<Vec<u8>>>,
}

/// The number of values that are converted to bytes at a time.
const CHUNK: usize = 1 << 16;

impl Default for Npz {
    fn default() -> Self {
        Npz::new()
    }
}

impl Npz {
    /// An archive without arrays.
    pub fn new() -> Npz {
        Npz {
            zip: ZipWriter::new(Cursor::new(Vec::new())),
        }
    }

    /// Adds an array of `rows` × `width` numbers, row by row; a vector when `width` is 1. `rows` follows from the
    /// number of values.
    ///
    /// # Errors
    ///
    /// The reason in words, if the numbers cannot be split into rows of that width, or the archive becomes too large
    /// for its format.
    pub fn array<T: Number>(
        &mut self,
        name: &str,
        values: &[T],
        width: usize,
    ) -> Result<(), String> {
        if width == 0 || !values.len().is_multiple_of(width) {
            return Err(format!(
                "{name}: {} numbers cannot be split into rows of {width}",
                values.len()
            ));
        }
        let shape = match width {
            1 => format!("({},)", values.len()),
            _ => format!("({}, {width})", values.len() / width),
        };
        self.begin(name, T::NUMPY, &shape).map_err(failed)?;
        let mut bytes = Vec::with_capacity(CHUNK * size_of::<T>());
        for chunk in values.chunks(CHUNK) {
            bytes.clear();
            chunk.iter().for_each(|value| value.put(&mut bytes));
            self.zip.write_all(&bytes).map_err(failed)?;
        }
        Ok(())
    }

    /// Adds a vector of words, each as wide as the longest word, in NumPy's type `<U`, which needs no pickle.
    ///
    /// # Errors
    ///
    /// The reason in words, if the archive becomes too large for its format.
    pub fn words<S: AsRef<str>>(&mut self, name: &str, words: &[S]) -> Result<(), String> {
        let width = words.iter().map(|word| word.as_ref().chars().count()).max();
        let width = width.unwrap_or(0).max(1);
        self.begin(name, &format!("<U{width}"), &format!("({},)", words.len()))
            .map_err(failed)?;
        let mut bytes = Vec::new();
        for word in words {
            let letters = word
                .as_ref()
                .chars()
                .map(u32::from)
                .chain(std::iter::repeat(0));
            letters
                .take(width)
                .for_each(|letter| letter.put(&mut bytes));
            if bytes.len() >= CHUNK {
                self.zip.write_all(&bytes).map_err(failed)?;
                bytes.clear();
            }
        }
        self.zip.write_all(&bytes).map_err(failed)
    }

    /// Adds the columns of a table, each as an array named `prefix` and the column's name; a missing number is NaN.
    ///
    /// # Errors
    ///
    /// The reason in words, if the columns have different lengths, or the archive becomes too large for its format.
    pub fn table(&mut self, prefix: &str, table: &Table) -> Result<(), String> {
        table.rows()?;
        for column in &table.columns {
            let name = format!("{prefix}{}", column.name);
            match &column.values {
                Values::Real(values) => self.array(&name, values, 1)?,
                Values::Whole(values) => self.array(&name, values, 1)?,
                Values::Text(values) => self.words(&name, values)?,
            }
        }
        Ok(())
    }

    /// Returns the bytes of the archive.
    ///
    /// # Errors
    ///
    /// The reason in words, if the archive became too large for its format.
    pub fn finish(self) -> Result<Vec<u8>, String> {
        Ok(self.zip.finish().map_err(failed)?.into_inner())
    }

    /// Starts an array: magic, version 1.0, and the header padded so that the data begin at a
    /// multiple of 64 bytes.
    fn begin(&mut self, name: &str, descr: &str, shape: &str) -> ZipResult<()> {
        // no time of writing, so that the same result gives the same bytes
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(1)) // computed digits compress little at any level
            .last_modified_time(zip::DateTime::default())
            .large_file(true);
        self.zip.start_file(format!("{name}.npy"), options)?;
        let mut header =
            format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
        const BEFORE: usize = 10;
        let end = (BEFORE + header.len() + 1).next_multiple_of(64);
        header.push_str(&" ".repeat(end - BEFORE - header.len() - 1));
        header.push('\n');
        self.zip.write_all(b"\x93NUMPY\x01\x00")?;
        self.zip.write_all(&(header.len() as u16).to_le_bytes())?;
        self.zip.write_all(header.as_bytes())?;
        Ok(())
    }
}

/// Writes a table as an archive of its columns.
///
/// # Errors
///
/// The errors of [`Npz::table`].
pub fn file(table: &Table) -> Result<Vec<u8>, String> {
    let mut npz = Npz::new();
    npz.table("", table)?;
    npz.finish()
}

impl std::fmt::Debug for Npz {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Npz")
    }
}

fn failed(error: impl std::fmt::Display) -> String {
    error.to_string()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::table::tests::{history, profile};
    use std::collections::BTreeMap;
    use std::io::Read;

    /// The header and data of every array, by name.
    pub(crate) fn read(bytes: Vec<u8>) -> BTreeMap<String, (String, Vec<u8>)> {
        let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let mut arrays = BTreeMap::new();
        for i in 0..archive.len() {
            let mut file = archive.by_index(i).unwrap();
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).unwrap();
            assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
            let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
            assert_eq!((10 + length) % 64, 0);
            let header = String::from_utf8(bytes[10..10 + length].to_vec()).unwrap();
            assert!(header.ends_with('\n'));
            let name = file
                .name()
                .unwrap()
                .strip_suffix(".npy")
                .unwrap()
                .to_owned();
            arrays.insert(name, (header, bytes.split_off(10 + length)));
        }
        arrays
    }

    #[test]
    fn arrays_have_their_type_shape_and_bytes() {
        let mut npz = Npz::new();
        npz.array("a/b", &[1.5, -0.0, f64::NAN, 4.0], 2).unwrap();
        npz.array("n", &[7u32, 8], 1).unwrap();
        npz.array("i", &[-1i8, 2], 1).unwrap();
        npz.words("w", &["öpen", "x"]).unwrap();
        npz.array::<f64>("none", &[], 8).unwrap();
        let arrays = read(npz.finish().unwrap());
        let (header, data) = &arrays["a/b"];
        assert!(
            header.contains("'<f8'") && header.contains("'shape': (2, 2)"),
            "{header}"
        );
        assert_eq!(&data[8..16], (-0.0f64).to_le_bytes());
        assert_eq!(arrays["n"].1, [7, 0, 0, 0, 8, 0, 0, 0]);
        assert_eq!(
            (&arrays["i"].1[..], arrays["i"].0.contains("'|i1'")),
            (&[255, 2][..], true)
        );
        let (header, data) = &arrays["w"];
        assert!(header.contains("'<U4'"), "{header}");
        assert_eq!((data.len(), data[0], data[16]), (32, 0xf6, b'x'));
        assert!(arrays["none"].0.contains("(0, 8)") && arrays["none"].1.is_empty());
    }

    #[test]
    fn a_table_always_gives_the_same_archive_of_its_columns() {
        let table = Table::of_history(&history());
        let bytes = file(&table).unwrap();
        assert_eq!(bytes, file(&table).unwrap());
        let arrays = read(bytes);
        assert_eq!(arrays.len(), 17);
        assert!(f64::from_le_bytes(arrays["r_f"].1[..8].try_into().unwrap()).is_nan());
        let mut npz = Npz::new();
        npz.table("top/", &Table::of_profile(&profile())).unwrap();
        assert!(read(npz.finish().unwrap()).contains_key("top/normal_stress"));
    }

    #[test]
    fn incomplete_rows_and_repeated_names_are_errors() {
        let mut npz = Npz::new();
        assert!(npz.array("a", &[1.0, 2.0, 3.0], 2).is_err());
        npz.array("b", &[1.0], 1).unwrap();
        assert!(npz.array("b", &[1.0], 1).is_err());
    }
}
