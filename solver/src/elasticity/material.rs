//! Hooke's law (thesis 1.10) in the three two-dimensional theories.

use serde::Serialize;

use crate::problem::{Analysis, Orthotropic};

/// Strains and stresses have four components, in this order: xx, yy, xy, zz (rr, zz, rz, θθ in
/// axisymmetry); the shear strain is the engineering one, γ = 2 ε_xy.
pub const COMPONENTS: usize = 4;

/// The elastic moduli, σ = moduli · ε, symmetric (stress).
pub type Moduli = [[f64; COMPONENTS]; COMPONENTS];

/// The moduli of a nearly incompressible material in two parts, σ = rest · ε + bulk (ε_xx + ε_yy + ε_zz) m with m = (1,
/// 1, 0, 1) (2G and λ for an isotropic material).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Split {
    /// The resistance to strains without the part of `bulk`; positive definite.
    pub rest: Moduli,
    /// The resistance to a change of volume (stress).
    pub bulk: f64,
}

/// The limit of λ/G = 2ν/(1 − 2ν), the value of an isotropic material with ν = .48: above it a material is nearly
/// incompressible.
const NEARLY_INCOMPRESSIBLE: f64 = 24.0;

/// The largest λ/G in a measure of forces, about the value for ν = .49999.
const STIFFEST: f64 = 1e5;

impl Split {
    /// The two parts of the moduli; `None` if the material is not nearly incompressible, or in plane stress, where the
    /// thickness takes up any change of volume.
    fn new(moduli: &Moduli) -> Option<Split> {
        let bulk = moduli[0][1].min(moduli[0][3]).min(moduli[1][3]);
        let mut rest = *moduli;
        let normal = [0, 1, 3];
        for (i, j) in normal.iter().flat_map(|i| normal.map(|j| (*i, j))) {
            rest[i][j] -= bulk;
        }
        // 2G for each of three normal strains and G for the shear strain, where the material is isotropic
        let shear = (0..COMPONENTS).map(|c| rest[c][c]).sum::<f64>() / 7.0;
        // rounding must not make ν = .48 itself nearly incompressible
        let nearly = bulk > NEARLY_INCOMPRESSIBLE * (1.0 + 1e-9) * shear;
        let sheet = moduli[COMPONENTS - 1][COMPONENTS - 1] == 0.0;
        (nearly && !sheet && inverse(&rest).is_some()).then_some(Split { rest, bulk })
    }
}

/// The body's theory and its materials, in the plane of the analysis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Section {
    analysis: Analysis,
    moduli: Vec<Moduli>,
    /// The two parts of the moduli of every material; `None` for one that is not nearly incompressible.
    splits: Vec<Option<Split>>,
    /// The number of every element's material; empty if all elements have the first material.
    material_of: Vec<u16>,
}

impl Section {
    /// A body of one material.
    pub fn uniform(analysis: Analysis, moduli: Moduli) -> Self {
        Section::by_element(analysis, vec![moduli], Vec::new())
    }

    /// A body of several materials. `material_of`: the number of the material of every element.
    pub fn by_element(analysis: Analysis, moduli: Vec<Moduli>, material_of: Vec<u16>) -> Self {
        Section {
            analysis,
            splits: moduli.iter().map(Split::new).collect(),
            moduli,
            material_of,
        }
    }

    /// The theory of the body.
    pub fn analysis(&self) -> Analysis {
        self.analysis
    }

    /// Number of an element's material.
    pub fn material_of(&self, element: usize) -> usize {
        self.material_of.get(element).map_or(0, |&m| usize::from(m))
    }

    /// Moduli of every material.
    pub fn materials(&self) -> &[Moduli] {
        &self.moduli
    }

    /// The modulus for comparing displacements with forces: the largest of all materials, without bulk moduli far above
    /// the resistance to shear (stress).
    pub fn modulus(&self) -> f64 {
        let of_material = |(moduli, split): (&Moduli, &Option<Split>)| match split {
            None => moduli[0][0],
            Some(split) => moduli[0][0].min(STIFFEST * split.rest[0][0]),
        };
        let moduli = self.moduli.iter().zip(&self.splits).map(of_material);
        moduli.fold(0.0, f64::max)
    }

    /// The modulus E* of a material by which its surface yields to a pressure, E/(1 − ν²) in plane strain and E in plane
    /// stress (stress); of an orthotropic material a mean of both directions.
    pub fn contact_modulus(&self, material: usize) -> f64 {
        let moduli = &self.moduli[material];
        let normal = (moduli[0][0] * moduli[1][1]).sqrt();
        (normal - moduli[0][1]) * (normal + moduli[0][1]) / normal
    }

    /// The share β of a material in the coupling of normal and tangential stress on its surface: where σ_t jumps by q, the
    /// pressure under a rigid obstacle changes by (β/π) q times the logarithm of the distance. (1 − 2ν)/(2(1 − ν)) in plane
    /// strain, (1 − ν)/2 in plane stress (Johnson, Contact Mechanics, 2.22 with 2.23).
    pub fn coupling(&self, material: usize) -> f64 {
        let moduli = &self.moduli[material];
        let normal = (moduli[0][0] * moduli[1][1]).sqrt();
        0.5 * (1.0 - moduli[0][1] / normal)
    }

    /// The two parts of the moduli of a material, if it is nearly incompressible.
    pub fn split(&self, material: usize) -> Option<&Split> {
        self.splits[material].as_ref()
    }

    /// Whether any material is nearly incompressible.
    pub fn has_split(&self) -> bool {
        self.splits.iter().any(Option::is_some)
    }

    /// The factor of every integral over the section at the first coordinate x: the thickness, or the radius r. The 2π
    /// of axisymmetry is left out here and enters totals only.
    pub fn depth(&self, x: f64) -> f64 {
        match self.analysis {
            Analysis::PlaneStrain {} => 1.0,
            Analysis::PlaneStress { thickness } => thickness,
            Analysis::Axisymmetric {} => x,
        }
    }

    /// The factor that turns an integral with [`Section::depth`] into a total: 2π in axisymmetry, else 1.
    pub fn circumference(&self) -> f64 {
        if self.axisymmetric() {
            2.0 * std::f64::consts::PI
        } else {
            1.0
        }
    }

    /// Whether there is a hoop strain u_r / r.
    pub fn axisymmetric(&self) -> bool {
        matches!(self.analysis, Analysis::Axisymmetric {})
    }

    /// The strain by unit displacements of one node (columns ux, uy): the node's part of B.
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
}

/// The stress σ = moduli · ε.
pub fn stress(moduli: &Moduli, strain: &[f64; COMPONENTS]) -> [f64; COMPONENTS] {
    moduli.map(|row| (0..COMPONENTS).map(|k| row[k] * strain[k]).sum())
}

/// The moduli of an isotropic material from E and Poisson's ratio.
#[rustfmt::skip]
pub fn isotropic(analysis: &Analysis, youngs_modulus: f64, poissons_ratio: f64) -> Moduli {
    let (e, nu) = (youngs_modulus, poissons_ratio);
    let shear = e / (2.0 * (1.0 + nu));
    match analysis {
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
    }
}

/// The moduli of an orthotropic material from its constants; `None` if the material is not stable. Constants across the
/// plane are required unless the analysis is plane stress.
#[rustfmt::skip]
pub fn orthotropic(analysis: &Analysis, material: &Orthotropic) -> Option<Moduli> {
    let Orthotropic { e1, e2, nu12, g12, angle, e3, nu13, nu23, .. } = *material;
    let sheet = matches!(analysis, Analysis::PlaneStress { .. });
    let (e3, nu13, nu23) = if sheet {
(0.0, 0.0, 0.0)
} else {
(e3?, nu13?, nu23?)
};
    let across = if sheet { 0.0 } else { 1.0 / e3 };
    let compliance = [
        [ 1.0 / e1,  -nu12 / e1, 0.0,       -nu13 / e1],
        [-nu12 / e1,  1.0 / e2,  0.0,       -nu23 / e2],
        [ 0.0,        0.0,       1.0 / g12,  0.0      ],
        [-nu13 / e1, -nu23 / e2, 0.0,        across   ],
    ];
    let own = inverse(&compliance)?;
    let (s, c) = angle.to_radians().sin_cos();
    // strains along the material's axes from those along x and y
    let turn = [
        [c * c,        s * s,       c * s,         0.0],
        [s * s,        c * c,      -c * s,         0.0],
        [-2.0 * c * s, 2.0 * c * s, c * c - s * s, 0.0],
        [0.0,          0.0,         0.0,           1.0],
    ];
    let mut moduli = [[0.0; COMPONENTS]; COMPONENTS];
    for i in 0..COMPONENTS {
        for j in 0..COMPONENTS {
            for k in 0..COMPONENTS {
                for l in 0..COMPONENTS {
                    moduli[i][j] += turn[k][i] * own[k][l] * turn[l][j];
                }
            }
        }
    }
    Some(moduli)
}

/// The inverse of a symmetric matrix. A last row and column of zeros (σ_zz = 0) is left out and stays zero; `None` if
/// the remaining matrix is not positive definite.
pub fn inverse(matrix: &Moduli) -> Option<Moduli> {
    let n = if matrix[COMPONENTS - 1][COMPONENTS - 1] == 0.0 {
        COMPONENTS - 1
    } else {
        COMPONENTS
    };
    let (mut a, mut b) = (*matrix, [[0.0; COMPONENTS]; COMPONENTS]);
    (0..n).for_each(|i| b[i][i] = 1.0);
    // Gauss–Jordan: the pivots of a positive definite matrix are positive
    for k in 0..n {
        let pivot = a[k][k];
        if pivot.is_nan() || pivot <= 1e-12 * matrix[k][k].abs() {
            return None;
        }
        for j in 0..n {
            a[k][j] /= pivot;
            b[k][j] /= pivot;
        }
        for i in (0..n).filter(|&i| i != k) {
            let factor = a[i][k];
            for j in 0..n {
                a[i][j] -= factor * a[k][j];
                b[i][j] -= factor * b[k][j];
            }
        }
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wood(angle: f64) -> Orthotropic {
        Orthotropic {
            e1: 120.0,
            e2: 10.0,
            nu12: 0.3,
            g12: 5.0,
            angle,
            e3: Some(8.0),
            nu13: Some(0.25),
            nu23: Some(0.4),
            expansion: None,
        }
    }

    #[test]
    fn equal_constants_in_all_directions_are_isotropic_at_any_angle() {
        let (e, nu) = (200.0, 0.3);
        let material = Orthotropic {
            e1: e,
            e2: e,
            nu12: nu,
            g12: e / (2.0 * (1.0 + nu)),
            angle: 37.0,
            e3: Some(e),
            nu13: Some(nu),
            nu23: Some(nu),
            expansion: None,
        };
        for analysis in [
            Analysis::PlaneStrain {},
            Analysis::Axisymmetric {},
            Analysis::PlaneStress { thickness: 1.0 },
        ] {
            let (a, b) = (
                orthotropic(&analysis, &material).unwrap(),
                isotropic(&analysis, e, nu),
            );
            for i in 0..COMPONENTS {
                for j in 0..COMPONENTS {
                    assert!((a[i][j] - b[i][j]).abs() < 1e-11, "{i}, {j}");
                }
            }
        }
    }

    /// A sheet pulled at an angle θ to its stiff axis has 1/E = c⁴/e1 + (1/g12 − 2 nu12/e1) c²s² + s⁴/e2.
    #[test]
    fn a_sheet_pulled_off_its_axis_has_the_known_modulus() {
        let sheet = Analysis::PlaneStress { thickness: 1.0 };
        for angle in [0.0, 20.0, 45.0, 90.0] {
            let compliance = inverse(&orthotropic(&sheet, &wood(angle)).unwrap()).unwrap();
            let (s, c) = f64::to_radians(angle).sin_cos();
            let exact = c.powi(4) / 120.0
                + (1.0 / 5.0 - 2.0 * 0.3 / 120.0) * c * c * s * s
                + s.powi(4) / 10.0;
            assert!((compliance[0][0] / exact - 1.0).abs() < 1e-12, "{angle}");
        }
    }

    #[test]
    fn a_material_is_nearly_incompressible_above_a_ratio_of_48() {
        let split = |analysis: Analysis, nu: f64| Split::new(&isotropic(&analysis, 200.0, nu));
        let sheet = Analysis::PlaneStress { thickness: 1.0 };
        for analysis in [Analysis::PlaneStrain {}, Analysis::Axisymmetric {}] {
            for nu in [-0.9, 0.0, 0.3, 0.48] {
                assert_eq!(split(analysis, nu), None, "{nu}");
            }
            for nu in [0.4801, 0.49, 0.49999, 0.4999999] {
                let Split { rest, bulk } = split(analysis, nu).unwrap();
                let shear = 200.0 / (2.0 * (1.0 + nu));
                assert!((bulk * (1.0 - 2.0 * nu) / (2.0 * shear * nu) - 1.0).abs() < 1e-12);
                for (i, row) in rest.iter().enumerate() {
                    for (j, value) in row.iter().enumerate() {
                        let expected = match (i, j) {
                            (2, 2) => shear,
                            _ if i == j => 2.0 * shear,
                            _ => 0.0,
                        };
                        // what the difference from the larger bulk loses
                        assert!((value - expected).abs() <= 1e-15 * bulk, "{nu}: {i}, {j}");
                    }
                }
            }
        }
        assert_eq!(split(sheet, 0.499), None);
    }

    /// An orthotropic material is split by the same criterion; wood is far from nearly incompressible.
    #[test]
    fn an_orthotropic_material_is_split_as_the_isotropic_one_that_it_is() {
        let strain = Analysis::PlaneStrain {};
        assert_eq!(
            Split::new(&orthotropic(&strain, &wood(30.0)).unwrap()),
            None
        );
        for (nu, nearly) in [(0.479, false), (0.499, true)] {
            let (e, g12) = (200.0, 200.0 / (2.0 * (1.0 + nu)));
            let material = Orthotropic {
                e1: e,
                e2: e,
                nu12: nu,
                g12,
                angle: 20.0,
                e3: Some(e),
                nu13: Some(nu),
                nu23: Some(nu),
                expansion: None,
            };
            let split = Split::new(&orthotropic(&strain, &material).unwrap());
            assert_eq!(split.is_some(), nearly, "{nu}");
        }
        // fibres twice as stiff in a matrix that keeps its volume: ν_12/e1 + ν_32/e3 = 1/e2 − 1/K, and so on round
        let matrix = Orthotropic {
            e1: 2.0,
            e2: 1.0,
            nu12: 0.4999,
            g12: 0.4,
            angle: 20.0,
            e3: Some(1.0),
            nu13: Some(0.4999),
            nu23: Some(0.7499),
            expansion: None,
        };
        let split = Split::new(&orthotropic(&strain, &matrix).unwrap()).unwrap();
        assert!(split.bulk > 1000.0, "{}", split.bulk);
    }

    #[test]
    fn an_unstable_material_has_no_moduli() {
        let mut material = wood(0.0);
        material.nu12 = 4.0; // nu12² > e1/e2
        assert!(orthotropic(&Analysis::PlaneStrain {}, &material).is_none());
        assert!(orthotropic(&Analysis::PlaneStress { thickness: 1.0 }, &material).is_none());
    }
}
