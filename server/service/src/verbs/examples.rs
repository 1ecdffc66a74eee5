//! The operation that returns problems to begin with.

use schemars::JsonSchema;
use serde::Serialize;
use solver::problem::Problem;

use crate::error::ApiError;

/// The name and JSON of each problem of chapter 4 of the thesis.
pub const OF_THE_THESIS: [(&str, &str); 5] = [
    (
        "rectangular_punch",
        include_str!("../../../../examples/rectangular_punch.json"),
    ),
    (
        "cylinder",
        include_str!("../../../../examples/cylinder.json"),
    ),
    (
        "annular_punch",
        include_str!("../../../../examples/annular_punch.json"),
    ),
    (
        "cylinder_on_end",
        include_str!("../../../../examples/cylinder_on_end.json"),
    ),
    ("sheet", include_str!("../../../../examples/sheet.json")),
];

/// The name and JSON of further problems: of practice, and of what else the service solves.
const OTHERS: [(&str, &str); 8] = [
    ("hertz", include_str!("../../../../docs/gallery/hertz.json")),
    (
        "known_load",
        include_str!("../../../../docs/gallery/known_load.json"),
    ),
    (
        "press_fit",
        include_str!("../../../../docs/gallery/press_fit.json"),
    ),
    (
        "fretting",
        include_str!("../../../../docs/gallery/fretting.json"),
    ),
    (
        "measured",
        include_str!("../../../../docs/gallery/measured.json"),
    ),
    (
        "tool_under_load",
        include_str!("../../../../examples/tool_under_load.json"),
    ),
    (
        "roller_on_block",
        include_str!("../../../../examples/roller_on_block.json"),
    ),
    (
        "two_bodies",
        include_str!("../../../../examples/press_fit.json"),
    ),
];

/// Problems to begin with.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Examples {
    /// The examples: those of the thesis first.
    pub examples: Vec<Example>,
}

/// A problem to begin with.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Example {
    /// The name of the example.
    pub name: String,
    /// Its title.
    pub title: String,
    /// The problem in words.
    pub description: String,
    /// The problem.
    pub problem: Problem,
}

/// Returns all examples, which are the same for everybody.
pub fn examples() -> Result<Examples, ApiError> {
    let all = OF_THE_THESIS.iter().chain(&OTHERS);
    let example = |(name, text): &(&str, &str)| {
        let problem: Problem = serde_json::from_str(text).map_err(ApiError::internal)?;
        Ok(Example {
            name: (*name).to_owned(),
            title: problem.title.clone().unwrap_or_default(),
            description: files::plot::description(&problem),
            problem,
        })
    };
    let examples = all.map(example).collect::<Result<_, ApiError>>()?;
    Ok(Examples { examples })
}
