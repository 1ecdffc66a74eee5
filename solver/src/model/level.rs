//! Load levels: how far a load history has progressed.

use crate::problem::Step;

/// A load level: factors on the values of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The factors on the motions of every obstacle: indentation, tangential displacement and tilt.
    pub motions: [f64; 3],
    /// The factors on the loads of every obstacle: normal force, tangential force and moment.
    pub forces: [f64; 3],
    /// The factor on all loads.
    pub loads: f64,
    /// The factor on all prescribed displacements.
    pub supports: f64,
}

impl Level {
    /// The level with no loads and no motion.
    pub const ZERO: Level = Level::all(0.0);

    /// The level with all values as given.
    pub const FULL: Level = Level::all(1.0);

    const fn all(factor: f64) -> Level {
        Level {
            motions: [factor; 3],
            forces: [factor; 3],
            loads: factor,
            supports: factor,
        }
    }

    /// The level at the end of a load step.
    pub fn end_of(step: &Step) -> Level {
        Level {
            motions: [step.indentation, step.tangential_displacement, step.tilt],
            forces: [step.normal_force, step.tangential_force, step.moment],
            loads: step.loads,
            supports: step.supports,
        }
    }

    /// The level at the end of every step; without steps, the whole.
    pub fn ends_of(steps: &[Step]) -> Vec<Level> {
        match steps {
            [] => vec![Level::FULL],
            _ => steps.iter().map(Level::end_of).collect(),
        }
    }

    /// The level between two others, of which `part` (0 … 1) is passed.
    pub fn between(from: &Level, to: &Level, part: f64) -> Level {
        let between = |a: f64, b: f64| match part {
            1.0 => b,
            _ => a + part * (b - a),
        };
        let each = |a: &[f64; 3], b: &[f64; 3]| std::array::from_fn(|k| between(a[k], b[k]));
        Level {
            motions: each(&from.motions, &to.motions),
            forces: each(&from.forces, &to.forces),
            loads: between(from.loads, to.loads),
            supports: between(from.supports, to.supports),
        }
    }
}
