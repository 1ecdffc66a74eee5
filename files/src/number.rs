//! The types of numbers in binary files, with their names in each format.

/// A number with a fixed size.
pub trait Number: Copy {
    /// The type's name in a `.npy` header.
    const NUMPY: &'static str;
    /// The type's name in a VTK file.
    const VTK: &'static str;
    /// Appends the number's bytes, least significant first.
    fn put(self, bytes: &mut Vec<u8>);
}

macro_rules! numbers {
    ($($type:ty: $numpy:literal, $vtk:literal;)*) => { $(
        impl Number for $type {
            const NUMPY: &'static str = $numpy;
            const VTK: &'static str = $vtk;
            fn put(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )* };
}
numbers! {
    f64: "<f8", "Float64";
    i64: "<i8", "Int64";
    u32: "<u4", "UInt32";
    u8:  "|u1", "UInt8";
    i8:  "|i1", "Int8";
}
