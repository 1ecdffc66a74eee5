//! Forces per volume: one that is the same everywhere, and those of the body's mass.

use serde::Serialize;

/// The force per volume on a body: a constant one, and the density of each material times an acceleration that is a
/// linear function of the place, as gravity and the centrifugal acceleration of a rotating body are.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct BodyForce {
    /// The force per volume along x and y, without that of the mass.
    pub constant: [f64; 2],
    /// The acceleration along x and y at the origin.
    pub acceleration: [f64; 2],
    /// How much the acceleration along x grows with x, and that along y with y (1/time²).
    pub growth: [f64; 2],
    /// The densities of the materials, by their numbers in the section; not needed without an acceleration.
    pub densities: Vec<f64>,
}

impl BodyForce {
    /// Whether there is no force anywhere.
    pub fn is_zero(&self) -> bool {
        [self.constant, self.acceleration, self.growth] == [[0.0; 2]; 3]
    }

    /// This force, multiplied by a factor.
    pub fn times(&self, factor: f64) -> BodyForce {
        let times = |values: [f64; 2]| values.map(|value| factor * value);
        BodyForce {
            constant: times(self.constant),
            acceleration: times(self.acceleration),
            growth: times(self.growth),
            densities: self.densities.clone(),
        }
    }

    /// The force per volume at a place in a material.
    pub fn at(&self, material: usize, place: [f64; 2]) -> [f64; 2] {
        self.over(material, 1.0, place)
    }

    /// The integral of the force with a weight, in a material: `volume` is the integral of the weight, and `moment` that
    /// of the weight times the place.
    pub fn over(&self, material: usize, volume: f64, moment: [f64; 2]) -> [f64; 2] {
        let density = self.densities.get(material).copied().unwrap_or_default();
        [0, 1].map(|a| {
            let accelerated = self.acceleration[a] * volume + self.growth[a] * moment[a];
            self.constant[a] * volume + density * accelerated
        })
    }
}
