//! What the tests share.
#![allow(clippy::unwrap_used, clippy::panic)] // a test that fails should say so at once

pub mod fuzzing;
pub mod harness;

use serde_json::{Value, json};

/// The names of the five problems of the thesis.
pub const EXAMPLES: [&str; 5] = [
    "rectangular_punch",
    "cylinder",
    "annular_punch",
    "cylinder_on_end",
    "sheet",
];

/// One of the five problems on meshes of the thesis's size, as text; `examples/` has them on refined meshes.
pub fn example(name: &str) -> String {
    let path = format!("{}/data/thesis/{name}.json", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// One of the problems in `examples/`, as text.
pub fn shipped_example(name: &str) -> String {
    let path = format!("{}/../examples/{name}.json", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// One of the five problems on meshes of the thesis's size, as JSON.
pub fn example_json(name: &str) -> Value {
    serde_json::from_str(&example(name)).unwrap()
}

/// A cylinder pressed on the top of the plate with the fillet (`data/gmsh`), and dragged.
pub fn pressed(mesh: Value) -> Value {
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": mesh,
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "parabola", "radius": 5, "center": 1},
            "indentation": 0.05, "tangential_displacement": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4}}],
    })
}
