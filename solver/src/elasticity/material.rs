//! Hooke's law (thesis 1.10) in the three two-dimensional theories.

use crate::problem::Analysis;

/// Strains and stresses have four components, in this order: xx, yy, xy, zz (rr, zz, rz, θθ in
/// axisymmetry); the shear strain is the engineering one, γ = 2 ε_xy.
pub const COMPONENTS: usize = 4;

/// The material seen in the plane of the analysis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// σ = moduli · ε, symmetric (stress).
    pub moduli: [[f64; COMPONENTS]; COMPONENTS],
    analysis: Analysis,
}

impl Section {
    /// From E and Poisson's ratio.
    #[rustfmt::skip]
    pub fn new(analysis: Analysis, youngs_modulus: f64, poissons_ratio: f64) -> Self {
        let (e, nu) = (youngs_modulus, poissons_ratio);
        let shear = e / (2.0 * (1.0 + nu));
        let moduli = match analysis {
            Analysis::PlaneStress { .. } => {
                let a = e / (1.0 - nu * nu);
                [
                    [a,      nu * a, 0.0,   0.0],
                    [nu * a, a,      0.0,   0.0],
                    [0.0,    0.0,    shear, 0.0],
                    [0.0,    0.0,    0.0,   0.0], // σ_zz = 0
                ]
            }
            // in plane strain ε_zz = 0 and the last row gives σ_zz
            Analysis::PlaneStrain {} | Analysis::Axisymmetric {} => {
                let lambda = e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
                let a = lambda + 2.0 * shear;
                [
                    [a,      lambda, 0.0,   lambda],
                    [lambda, a,      0.0,   lambda],
                    [0.0,    0.0,    shear, 0.0   ],
                    [lambda, lambda, 0.0,   a     ],
                ]
            }
        };
        Section { moduli, analysis }
    }

    /// The factor of every integral over the section at the first coordinate x: thickness, or r.
    /// The 2π of axisymmetry stays out here and enters totals only.
    pub fn depth(&self, x: f64) -> f64 {
        match self.analysis {
            Analysis::PlaneStrain {} => 1.0,
            Analysis::PlaneStress { thickness } => thickness,
            Analysis::Axisymmetric {} => x,
        }
    }

    /// The factor from an integral with `depth` to a total: 2π in axisymmetry, else 1.
    pub fn circumference(&self) -> f64 {
        if self.axisymmetric() {
            2.0 * std::f64::consts::PI
        } else {
            1.0
        }
    }

    /// True where the hoop strain u_r / r counts.
    pub fn axisymmetric(&self) -> bool {
        matches!(self.analysis, Analysis::Axisymmetric {})
    }

    /// Strain of one node's unit displacements (columns ux, uy): the node's part of B.
    #[rustfmt::skip]
    pub fn strain(&self, shape: f64, gradient: [f64; 2], x: f64) -> [[f64; 2]; COMPONENTS] {
        let [dx, dy] = gradient;
        let hoop = if self.axisymmetric() { shape / x } else { 0.0 };
        [
            [dx,   0.0],
            [0.0,  dy ],
            [dy,   dx ],
            [hoop, 0.0],
        ]
    }

    /// σ = moduli · ε.
    pub fn stress(&self, strain: &[f64; COMPONENTS]) -> [f64; COMPONENTS] {
        self.moduli
            .map(|row| (0..COMPONENTS).map(|k| row[k] * strain[k]).sum())
    }
}
