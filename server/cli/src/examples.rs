//! The five problems of chapter 4 of the thesis, compiled into the program.

/// The name and JSON of each example.
pub const ALL: [(&str, &str); 5] = [
    (
        "rectangular_punch",
        include_str!("../../../examples/rectangular_punch.json"),
    ),
    ("cylinder", include_str!("../../../examples/cylinder.json")),
    (
        "annular_punch",
        include_str!("../../../examples/annular_punch.json"),
    ),
    (
        "cylinder_on_end",
        include_str!("../../../examples/cylinder_on_end.json"),
    ),
    ("sheet", include_str!("../../../examples/sheet.json")),
];
