//! Checks materials, and which elements are made of them.

use super::checks::{Checks, one_of};
use crate::elasticity::{self, Moduli, Section};
use crate::error::{AllChecks, Checked, Reason};
use crate::mesh::Mesh;
use crate::problem::{Analysis, Elasticity, Material, Orthotropic};

impl Checks {
    /// The analysis with the materials of all elements.
    pub(super) fn section(
        &mut self,
        analysis: Analysis,
        materials: &[Material],
        mesh: &Mesh,
    ) -> Checked<Section> {
        let mut all = AllChecks::default();
        if materials.is_empty() {
            all.fail(self.report(
                "/materials",
                Reason::TooFew,
                "no material",
                "at least one material",
                "Give youngs_modulus and poissons_ratio.",
            ));
        }
        let mut moduli = Vec::new();
        for (i, material) in materials.iter().enumerate() {
            if let Some(density) = material.density {
                all.check(self.require(
                    density >= 0.0,
                    format!("/materials/{i}/density"),
                    density,
                    "a density ≥ 0",
                    "Mass per volume.",
                ));
            }
            moduli.extend(all.check(self.moduli(&analysis, material, &format!("/materials/{i}"))));
        }
        let material_of = self.elements_of(materials, mesh);
        all.finish(())?;
        let material_of = material_of?;
        Ok(match moduli[..] {
            [only] => Section::uniform(analysis, only),
            _ => Section::by_element(analysis, moduli, material_of),
        })
    }

    fn moduli(
        &mut self,
        analysis: &Analysis,
        material: &Material,
        pointer: &str,
    ) -> Checked<Moduli> {
        match &material.elasticity {
            Elasticity::Isotropic {
                youngs_modulus,
                poissons_ratio,
            } => self.isotropic(analysis, *youngs_modulus, *poissons_ratio, pointer),
            Elasticity::Orthotropic(constants) => self.orthotropic(analysis, constants, pointer),
        }
    }

    fn isotropic(
        &mut self,
        analysis: &Analysis,
        e: f64,
        nu: f64,
        pointer: &str,
    ) -> Checked<Moduli> {
        let mut all = AllChecks::default();
        all.check(self.require(
            e > 0.0,
            format!("{pointer}/youngs_modulus"),
            e,
            "a stress > 0",
            "Young's modulus E.",
        ));
        all.check(self.require(
            nu > -1.0 && nu < 0.5,
            format!("{pointer}/poissons_ratio"),
            nu,
            "−1 < Poisson's ratio < 0.5",
            "For an incompressible body use 0.49999: results differ by some 1e-5, and the elements do not lock.",
        ));
        all.finish(elasticity::isotropic(analysis, e, nu))
    }

    fn orthotropic(
        &mut self,
        analysis: &Analysis,
        constants: &Orthotropic,
        pointer: &str,
    ) -> Checked<Moduli> {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/orthotropic/{field}");
        let sheet = matches!(analysis, Analysis::PlaneStress { .. });
        for (name, value) in [
            ("e3", constants.e3),
            ("nu13", constants.nu13),
            ("nu23", constants.nu23),
        ] {
            if value.is_none() && !sheet {
                all.fail(self.report(
                    at(name),
                    Reason::Missing,
                    "nothing",
                    format!("a value for `{name}`"),
                    format!("`{name}` is optional only in plane stress."),
                ));
            }
        }
        let moduli = [
            ("e1", Some(constants.e1)),
            ("e2", Some(constants.e2)),
            ("g12", Some(constants.g12)),
            ("e3", constants.e3),
        ];
        for (name, value) in moduli {
            if let Some(value) = value {
                all.check(self.require(value > 0.0, at(name), value, "a stress > 0", "A modulus."));
            }
        }
        all.finish(())?;
        elasticity::orthotropic(analysis, constants).ok_or_else(|| {
            let (nu13, nu23) = (named("nu13", constants.nu13), named("nu23", constants.nu23));
            self.report(
                format!("{pointer}/orthotropic"),
                Reason::OutOfRange,
                format!("nu12 = {}{nu13}{nu23}", constants.nu12),
                "constants of a stable material, e.g. nu12² < e1/e2",
                "Some strain would need no energy. Check whether nu12 and nu21 were exchanged: nu12 = −ε_2/ε_1 under σ_1.",
            )
        })
    }

    /// The material of every element: that of the element's group, else the material without a group.
    fn elements_of(&mut self, materials: &[Material], mesh: &Mesh) -> Checked<Vec<u16>> {
        const NONE: u16 = u16::MAX;
        let mut all = AllChecks::default();
        let mut material_of = vec![NONE; mesh.elements.len()];
        for (i, material) in materials.iter().enumerate() {
            let Some(name) = &material.group else {
                continue;
            };
            let pointer = format!("/materials/{i}/group");
            let Some(elements) = mesh.groups.get(name) else {
                all.fail(self.report(
                    pointer,
                    Reason::UnknownGroup,
                    name,
                    one_of("a group", mesh.groups.keys()),
                    "Check the spelling, or name a group under /mesh/groups.",
                ));
                continue;
            };
            let taken = elements.iter().find(|&&e| material_of[e as usize] != NONE);
            if let Some(e) = taken {
                all.fail(self.report(
                    pointer,
                    Reason::Overlap,
                    format!(
                        "element {e}, which already has material {}",
                        material_of[*e as usize]
                    ),
                    "one material for every element",
                    "The groups of two materials must not overlap.",
                ));
            }
            elements
                .iter()
                .for_each(|&e| material_of[e as usize] = i as u16);
        }
        let mut rest = (0..materials.len()).filter(|&i| materials[i].group.is_none());
        let (first, second) = (rest.next(), rest.next());
        if let Some(second) = second {
            all.fail(self.report(
                format!("/materials/{second}/group"),
                Reason::WrongCount,
                "a second material without a group",
                "at most one material without a group",
                "Name the group of elements with this material.",
            ));
        }
        let bare = material_of.iter().position(|m| *m == NONE);
        match (first, bare) {
            (Some(i), _) => material_of
                .iter_mut()
                .filter(|m| **m == NONE)
                .for_each(|m| *m = i as u16),
            (None, Some(e)) if !materials.is_empty() => all.fail(self.report(
                "/materials",
                Reason::Missing,
                format!("no material for element {e}"),
                "a material for every element",
                "Give one material without `group`, for the remaining elements.",
            )),
            _ => {}
        }
        all.finish(material_of)
    }
}

/// The name and value of a material constant, for a list in a message; empty if the constant is not given.
fn named(name: &str, value: Option<f64>) -> String {
    value.map_or(String::new(), |value| format!(", {name} = {value}"))
}
