//! Reads the problems of the members of a sweep, one after another. Where a member differs from the previous one only
//! in numbers of a friction law or of the motion of an obstacle, its text is not read: the numbers are changed in the
//! last problem.

use solver::error::Violation;
use solver::problem::Problem;

use super::plan::Plan;

/// Reads the problems of the members of a sweep one after another.
pub struct Problems<'a> {
    plan: &'a Plan,
    last: Option<Last<'a>>,
}

/// The problem that was read last.
struct Last<'a> {
    /// For each path of the sweep: that the member's value is a number that can be changed, else the value's text.
    values: Vec<Known<'a>>,
    problem: Problem,
}

#[derive(Clone, Copy, PartialEq)]
enum Known<'a> {
    Text(Option<&'a str>),
    Number,
}

/// The problem of a member, as [`Problems::read`] returns it.
pub struct Read<'a> {
    /// The problem, as [`Plan::problem`] gives it.
    pub problem: &'a Problem,
    /// Whether the member differs from the previous one only in numbers of laws and motions: both have the same body.
    pub same_body: bool,
}

impl<'a> Problems<'a> {
    /// Starts reading the members of a sweep.
    pub fn new(plan: &'a Plan) -> Self {
        Problems { plan, last: None }
    }

    /// Returns the problem of a member.
    ///
    /// # Errors
    ///
    /// The violations of the member, as [`Plan::problem`] gives them.
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

/// The number that a value is, if it can be changed in a problem that was read already.
fn exchanged(path: &str, text: Option<&str>) -> Option<f64> {
    field(path)?;
    serde_json::from_str(text?).ok()
}

/// The contact and the field that a pointer names, if the field is a number that can be changed.
fn field(path: &str) -> Option<(usize, &str)> {
    let (contact, name) = path.strip_prefix("/contacts/")?.split_once('/')?;
    let number: usize = contact.parse().ok()?;
    // without a leading zero or a sign
    (number.to_string() == contact && NAMES.contains(&name)).then_some((number, name))
}

/// The fields of a contact whose numbers affect neither the body nor the structure of a problem.
const NAMES: [&str; 11] = [
    "indentation",
    "gap/interference",
    "tangential_displacement",
    "normal_force",
    "tangential_force",
    "moment",
    "friction/coefficient",
    "friction/nonlocal_radius",
    "friction/elastic_slip",
    "friction/cohesion",
    "friction/shear_cap",
];

/// Changes the number at `path` in a problem; false if the problem has no such number.
fn set(problem: &mut Problem, path: &str, number: f64) -> bool {
    let Some((contact, name)) = field(path) else {
        return false;
    };
    let Some(contact) = problem.contacts.get_mut(contact) else {
        return false;
    };
    match (name, &mut contact.friction) {
        ("indentation", _) => contact.indentation = number,
        ("gap/interference", _) => match &mut contact.gap {
            Some(gap) if gap.interference.is_some() => gap.interference = Some(number),
            _ => return false,
        },
        ("tangential_displacement", _) => contact.tangential_displacement = number,
        ("normal_force", _) if contact.normal_force.is_some() => {
            contact.normal_force = Some(number)
        }
        ("tangential_force", _) if contact.tangential_force.is_some() => {
            contact.tangential_force = Some(number);
        }
        ("moment", _) if contact.moment.is_some() => contact.moment = Some(number),
        ("friction/coefficient", Some(law)) => law.coefficient = Some(number),
        ("friction/nonlocal_radius", Some(law)) => law.nonlocal_radius = Some(number),
        ("friction/elastic_slip", Some(law)) => law.elastic_slip = number,
        ("friction/cohesion", Some(law)) => law.cohesion = number,
        ("friction/shear_cap", Some(law)) => law.shear_cap = Some(number),
        _ => return false,
    }
    true
}
