//! Load levels: how far a load history has progressed.

use crate::problem::Step;

/// A load level: factors on the values of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The factor on every indentation.
    pub indentation: f64,
    /// The factor on every tangential displacement of an obstacle.
    pub tangential_displacement: f64,
    /// The factor on all loads.
    pub loads: f64,
    /// The factor on all prescribed displacements.
    pub supports: f64,
}

impl Level {
    /// The level with no loads and no motion.
    pub const ZERO: Level = Level {
        indentation: 0.0,
        tangential_displacement: 0.0,
        loads: 0.0,
        supports: 0.0,
    };

    /// The level at the end of a load step.
    pub fn end_of(step: &Step) -> Level {
        Level {
            indentation: step.indentation,
            tangential_displacement: step.tangential_displacement,
            loads: step.loads,
            supports: step.supports,
        }
    }

    /// The level with all values as given.
    pub const FULL: Level = Level {
        indentation: 1.0,
        tangential_displacement: 1.0,
        loads: 1.0,
        supports: 1.0,
    };
}
