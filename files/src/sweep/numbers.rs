//! The problems of members, one after the other. Where members differ only in numbers that a law of friction or the
//! motion of an obstacle is made of, their text is read once: the numbers are put into the last problem.

use solver::error::Violation;
use solver::problem::Problem;

use super::plan::Plan;

/// The problems of members of a sweep.
pub struct Problems<'a> {
    plan: &'a Plan,
    last: Option<Last<'a>>,
}

/// The problem that was read last.
struct Last<'a> {
    /// By path: the text of the member's value, or that it is a number which can be exchanged.
    values: Vec<Known<'a>>,
    problem: Problem,
}

#[derive(Clone, Copy, PartialEq)]
enum Known<'a> {
    Text(Option<&'a str>),
    Number,
}

/// The problem of a member.
pub struct Read<'a> {
    /// As [`Plan::problem`] gives it.
    pub problem: &'a Problem,
    /// It differs from the one before in numbers of laws and motions alone: its body is the same.
    pub same_body: bool,
}

impl<'a> Problems<'a> {
    /// Of a sweep.
    pub fn new(plan: &'a Plan) -> Self {
        Problems { plan, last: None }
    }

    /// Returns the problem of a member.
    ///
    /// # Errors
    ///
    /// Its violations, as [`Plan::problem`] gives them.
    pub fn read(&mut self, number: usize) -> Result<Read<'_>, Vec<Violation>> {
        let texts = self.plan.values(number);
        let paths = || self.plan.paths().iter().zip(&texts);
        let numbers: Vec<Option<f64>> = paths().map(|(p, t)| exchanged(p, *t)).collect();
        let known = |(text, number): (&Option<&'a str>, &Option<f64>)| match number {
            Some(_) => Known::Number,
            None => Known::Text(*text),
        };
        let values: Vec<Known<'a>> = texts.iter().zip(&numbers).map(known).collect();
        let changed = self.last.take().and_then(|mut last| {
            let exchanged = last.values == values
                && paths()
                    .zip(&numbers)
                    .filter_map(|((path, _), number)| Some((path, (*number)?)))
                    .all(|(path, number)| set(&mut last.problem, path, number));
            exchanged.then_some(last)
        });
        let same_body = changed.is_some();
        let last = match changed {
            Some(last) => last,
            None => Last {
                values,
                problem: self.plan.problem(number)?,
            },
        };
        let problem = &self.last.insert(last).problem;
        Ok(Read { problem, same_body })
    }
}

/// The number that a value is, if it is one that can be exchanged in a problem.
fn exchanged(path: &str, text: Option<&str>) -> Option<f64> {
    field(path)?;
    serde_json::from_str(text?).ok()
}

/// The contact and the name of the number that a pointer leads to, if it can be exchanged.
fn field(path: &str) -> Option<(usize, &str)> {
    let (contact, name) = path.strip_prefix("/contacts/")?.split_once('/')?;
    let number: usize = contact.parse().ok()?;
    // without a leading zero or a sign
    (number.to_string() == contact && NAMES.contains(&name)).then_some((number, name))
}

/// Numbers that neither the body nor the structure of a problem depends on.
const NAMES: [&str; 7] = [
    "indentation",
    "tangential_displacement",
    "friction/coefficient",
    "friction/nonlocal_radius",
    "friction/elastic_slip",
    "friction/cohesion",
    "friction/shear_cap",
];

/// Puts a number into a problem; false if it has no such place.
fn set(problem: &mut Problem, path: &str, number: f64) -> bool {
    let Some((contact, name)) = field(path) else {
        return false;
    };
    let Some(contact) = problem.contacts.get_mut(contact) else {
        return false;
    };
    match (name, &mut contact.friction) {
        ("indentation", _) => contact.indentation = number,
        ("tangential_displacement", _) => contact.tangential_displacement = number,
        ("friction/coefficient", Some(law)) => law.coefficient = Some(number),
        ("friction/nonlocal_radius", Some(law)) => law.nonlocal_radius = Some(number),
        ("friction/elastic_slip", Some(law)) => law.elastic_slip = number,
        ("friction/cohesion", Some(law)) => law.cohesion = number,
        ("friction/shear_cap", Some(law)) => law.shear_cap = Some(number),
        _ => return false,
    }
    true
}
