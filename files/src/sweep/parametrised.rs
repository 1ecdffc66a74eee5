//! A problem of which some numbers are given later: what a model of UM-Bridge evaluates.

use solver::error::{Findings, Reason, Violation};
use solver::problem::Problem;

use super::{
    path::{are_apart, path},
    read::leads_nowhere,
    template::Template,
    values::number,
};
use crate::{
    json::parse,
    pointer::{Place, locate},
    schema::quoted,
};

/// A problem of which some numbers are given later.
#[derive(Clone, Debug)]
pub struct Parametrised {
    template: Template,
    own: Vec<f64>,
}

impl Parametrised {
    /// Makes a problem whose numbers at `pointers` are given later. `text` is a problem that was read and written
    /// again; each pointer comes with its place in the request.
    ///
    /// # Errors
    ///
    /// A violation for each pointer that does not lead to a number of the problem.
    pub fn new<'a>(
        text: &str,
        pointers: impl IntoIterator<Item = (String, &'a str)>,
    ) -> Result<Parametrised, Vec<Violation>> {
        let mut found = Findings::default();
        let (mut paths, mut places, mut own) = (vec![], vec![], vec![]);
        for (at, pointer) in pointers {
            let Some(path) = path(at, pointer, &mut found) else {
                continue;
            };
            match locate(text, &path.tokens) {
                Ok(Place::Value(range)) => {
                    let value = text.get(range.clone()).unwrap_or_default();
                    match serde_json::from_str(value) {
                        Ok(number) => own.push(number),
                        Err(_) => found.add(Violation::new(
                            path.at.clone(),
                            Reason::WrongType,
                            format!("{}, which leads to {}", quoted(pointer), quoted(value)),
                            "a pointer to a number",
                            "Point to each number by itself, such as /supports/0/ux/1.",
                        )),
                    }
                    places.push(Place::Value(range));
                }
                Ok(Place::Absent { .. }) => found.add(Violation::new(
                    path.at.clone(),
                    Reason::UnknownName,
                    quoted(pointer),
                    "a pointer to a number that the problem has",
                    "Check the spelling, or write the number in the problem: its size tells how large a change of it is.",
                )),
                Err(nowhere) => found.add(leads_nowhere(&path, &nowhere)),
            }
            paths.push(path);
        }
        are_apart(&paths, &mut found);
        let template = Template::new(text, places);
        found.into_result(Parametrised { template, own })
    }

    /// The numbers that the problem itself has, in the order of the pointers.
    pub fn own(&self) -> &[f64] {
        &self.own
    }

    /// Returns the problem with these numbers, in the order of the pointers.
    ///
    /// # Errors
    ///
    /// The violations of the problem with these numbers.
    pub fn problem(&self, numbers: &[f64]) -> Result<Problem, Vec<Violation>> {
        let texts: Vec<String> = numbers.iter().map(|value| number(*value)).collect();
        let texts: Vec<Option<&str>> = texts.iter().map(|text| Some(text.as_str())).collect();
        parse(&self.template.filled(&texts))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TEXT: &str = r#"{
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2], "y": [-1, 0]}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "circle", "radius": 8}, "indentation": 0.1}]
    }"#;

    fn with(pointers: &[&str]) -> Result<Parametrised, Vec<Violation>> {
        let problem = parse(TEXT).unwrap();
        let text = serde_json::to_string(&problem).unwrap();
        let placed = pointers.iter().enumerate();
        Parametrised::new(
            &text,
            placed.map(|(k, one)| (format!("/inputs/0/{k}"), *one)),
        )
    }

    #[test]
    fn numbers_take_the_places_of_those_of_the_problem() {
        let model = with(&[
            "/contacts/0/indentation",
            "/materials/0/youngs_modulus",
            "/mesh/grid/x/2",
        ]);
        let model = model.unwrap();
        assert_eq!(model.own(), [0.1, 1000.0, 2.0]);
        assert_eq!(model.problem(model.own()), parse(TEXT));
        let other = model.problem(&[0.25, 2e300, 3.0]).unwrap();
        assert_eq!(other.contacts[0].indentation, 0.25);
        let text = serde_json::to_value(&other).unwrap();
        assert_eq!(text["materials"][0]["youngs_modulus"], 2e300);
        assert_eq!(text["mesh"]["grid"]["x"][2], 3.0);
    }

    /// Bit by bit, as if a client had written it.
    #[test]
    fn a_number_is_the_one_that_was_given() {
        let model = with(&["/contacts/0/indentation"]).unwrap();
        for number in [
            0.1,
            1.0 / 3.0,
            5e-324,
            -0.0,
            1e22,
            9_007_199_254_740_993.0,
            123.0,
        ] {
            let problem = model.problem(&[number]).unwrap();
            let read = problem.contacts[0].indentation;
            assert_eq!(read, number);
        }
    }

    #[test]
    fn what_a_number_may_not_be_is_told_as_for_any_problem() {
        let model = with(&["/mesh/refine"]).unwrap();
        assert!(
            model.problem(&[1.0]).is_ok(),
            "a whole number is written as one"
        );
        let refused = model.problem(&[0.5]).unwrap_err();
        assert_eq!(refused[0].pointer, "/mesh/refine");
    }

    #[test]
    fn all_pointers_that_lead_to_no_number_are_told_at_their_places() {
        let refused = with(&[
            "contacts",
            "/contacts/0",
            "/contacts/3/indentation",
            "/contacts/0/indentatoin",
            "/analysis/kind",
            "/contacts/0/indentation",
            "/contacts/0/indentation",
        ]);
        let refused = refused.unwrap_err();
        let told: Vec<(&str, Reason)> = refused
            .iter()
            .map(|v| (v.pointer.as_str(), v.reason))
            .collect();
        assert_eq!(
            told,
            [
                ("/inputs/0/0", Reason::Malformed),
                ("/inputs/0/1", Reason::WrongType),
                ("/inputs/0/2", Reason::UnknownName),
                ("/inputs/0/3", Reason::UnknownName),
                ("/inputs/0/4", Reason::WrongType),
                ("/inputs/0/3", Reason::Conflict),
                ("/inputs/0/5", Reason::Conflict),
                ("/inputs/0/6", Reason::Conflict),
                ("/inputs/0/6", Reason::DuplicateName),
            ]
        );
    }
}
