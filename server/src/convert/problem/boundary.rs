//! Materials, supports and loads.

use solver::problem::{BoundaryValue, Load, Material, Orthotropic, Support};

use super::Reader;
use crate::pb;

impl Reader {
    pub(super) fn material(&mut self, at: &str, message: pb::Material) -> Option<Material> {
        let pb::Material {
            youngs_modulus,
            poissons_ratio,
            name,
            orthotropic,
            group,
        } = message;
        Some(Material {
            youngs_modulus: self.some_number(&format!("{at}/youngs_modulus"), youngs_modulus),
            poissons_ratio: self.some_number(&format!("{at}/poissons_ratio"), poissons_ratio),
            orthotropic: orthotropic
                .map(|constants| self.orthotropic(&format!("{at}/orthotropic"), constants)),
            group,
            name,
        })
    }

    fn orthotropic(&mut self, at: &str, message: pb::Orthotropic) -> Orthotropic {
        Orthotropic {
            e1: self.number(&format!("{at}/e1"), message.e1),
            e2: self.number(&format!("{at}/e2"), message.e2),
            nu12: self.number(&format!("{at}/nu12"), message.nu12),
            g12: self.number(&format!("{at}/g12"), message.g12),
            angle: self.number(&format!("{at}/angle"), message.angle),
            e3: self.some_number(&format!("{at}/e3"), message.e3),
            nu13: self.some_number(&format!("{at}/nu13"), message.nu13),
            nu23: self.some_number(&format!("{at}/nu23"), message.nu23),
        }
    }

    fn value(
        &mut self,
        at: &str,
        pb::BoundaryValue { start, end }: pb::BoundaryValue,
    ) -> BoundaryValue {
        match end {
            None => BoundaryValue::Constant(self.number(at, start)),
            Some(end) => {
                let start = self.number(&format!("{at}/0"), start);
                BoundaryValue::Linear([start, self.number(&format!("{at}/1"), end)])
            }
        }
    }

    fn some_value(&mut self, at: &str, value: Option<pb::BoundaryValue>) -> Option<BoundaryValue> {
        value.map(|value| self.value(at, value))
    }

    pub(super) fn support(&mut self, at: &str, message: pb::Support) -> Option<Support> {
        let pb::Support {
            boundary,
            ux,
            uy,
            un,
            ut,
            nodes,
        } = message;
        Some(Support {
            boundary: Some(boundary).filter(|name| !name.is_empty()),
            nodes,
            ux: self.some_value(&format!("{at}/ux"), ux),
            uy: self.some_value(&format!("{at}/uy"), uy),
            un: self.some_value(&format!("{at}/un"), un),
            ut: self.some_value(&format!("{at}/ut"), ut),
        })
    }

    pub(super) fn load(&mut self, at: &str, message: pb::Load) -> Option<Load> {
        let pb::Load {
            boundary,
            pressure,
            traction,
            normal,
            tangential,
            nodal,
            body_force,
            nodes,
            force,
        } = message;
        let traction = match traction {
            None => None,
            Some(pb::Traction { x, y }) => {
                let component = |reader: &mut Self, value, axis: usize| {
                    let at = format!("{at}/traction/{axis}");
                    let value = reader.need(&at, value, "a stress")?;
                    Some(reader.value(&at, value))
                };
                let (x, y) = (component(self, x, 0), component(self, y, 1));
                Some([x?, y?])
            }
        };
        let nodal = nodal.map(|pb::NodalForces { forces }| {
            let forces = forces.into_iter().enumerate();
            forces
                .map(|(i, force)| self.vector(&format!("{at}/nodal/{i}"), force))
                .collect()
        });
        Some(Load {
            boundary,
            pressure: self.some_value(&format!("{at}/pressure"), pressure),
            traction,
            normal: self.some_value(&format!("{at}/normal"), normal),
            tangential: self.some_value(&format!("{at}/tangential"), tangential),
            nodal,
            nodes,
            force: force.map(|force| self.vector(&format!("{at}/force"), force)),
            body_force: body_force.map(|force| self.vector(&format!("{at}/body_force"), force)),
        })
    }

    pub(super) fn vector(&mut self, at: &str, pb::Vector { x, y }: pb::Vector) -> [f64; 2] {
        if x.is_finite() && y.is_finite() {
            return [x, y];
        }
        [
            self.number(&format!("{at}/0"), x),
            self.number(&format!("{at}/1"), y),
        ]
    }
}
