//! Whether units of length, force and stress belong together: a stress is a force divided by the square of a length.

/// Common units of length with their size in metres.
const LENGTHS: &[(&str, f64)] = &[
    ("nm", 1e-9),
    ("um", 1e-6),
    ("µm", 1e-6), // the micro sign, and the Greek letter
    ("μm", 1e-6),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("dm", 1e-1),
    ("m", 1.0),
    ("km", 1e3),
    ("in", 0.0254),
    ("ft", 0.3048),
];

/// Common units of force with their size in newtons.
const FORCES: &[(&str, f64)] = &[
    ("nN", 1e-9),
    ("uN", 1e-6),
    ("µN", 1e-6),
    ("μN", 1e-6),
    ("mN", 1e-3),
    ("N", 1.0),
    ("daN", 10.0),
    ("kN", 1e3),
    ("MN", 1e6),
    ("GN", 1e9),
    ("kgf", 9.80665),
    ("lbf", POUND),
    ("kip", 1e3 * POUND),
];

/// A pound-force in newtons.
const POUND: f64 = 4.448_221_615_260_5;

/// Common units of stress with their size in pascals.
const STRESSES: &[(&str, f64)] = &[
    ("Pa", 1.0),
    ("hPa", 1e2),
    ("kPa", 1e3),
    ("MPa", 1e6),
    ("GPa", 1e9),
    ("bar", 1e5),
    ("psi", POUND / (0.0254 * 0.0254)),
    ("ksi", 1e3 * POUND / (0.0254 * 0.0254)),
    ("psf", POUND / (0.3048 * 0.3048)),
];

/// The largest relative difference that comes from rounded names of units, for instance psi from lbf and in.
const ROUNDED: f64 = 1e-3;

/// The number of units of stress that a unit of force on a unit of area is, if that is not 1. None if the units belong
/// together, or one of them is not a common one: it may be a name of the client's own.
pub(super) fn disagreement(length: &str, force: &str, stress: &str) -> Option<f64> {
    let metres = size(LENGTHS, length)?;
    let factor = size(FORCES, force)? / (metres * metres) / stress_size(stress)?;
    ((factor - 1.0).abs() > ROUNDED).then_some(factor)
}

fn size(units: &[(&str, f64)], name: &str) -> Option<f64> {
    let name = name.trim();
    let found = units.iter().find(|(unit, _)| *unit == name);
    found.map(|(_, size)| *size)
}

/// The size of a unit of stress in pascals: a name, or a force divided by the square of a length, such as N/mm².
fn stress_size(name: &str) -> Option<f64> {
    size(STRESSES, name).or_else(|| {
        let (force, area) = name.split_once('/')?;
        let area = area.trim();
        let length = ["²", "^2", "2"]
            .iter()
            .find_map(|two| area.strip_suffix(two))?;
        let metres = size(LENGTHS, length)?;
        Some(size(FORCES, force)? / (metres * metres))
    })
}

#[cfg(test)]
mod tests {
    use super::disagreement;

    #[test]
    fn units_that_belong_together_have_a_factor_of_one() {
        for (length, force, stress) in [
            ("mm", "N", "MPa"),
            ("mm", "N", "N/mm²"),
            ("mm", "N", "N/mm^2"),
            ("m", "N", "Pa"),
            ("m", "kN", "kPa"),
            ("m", "MN", "MPa"),
            ("mm", "kN", "GPa"),
            ("µm", "mN", "GPa"),
            ("in", "lbf", "psi"),
            ("in", "kip", "ksi"),
            // names of the client's own
            ("furlong", "N", "MPa"),
            ("mm", "stone", "MPa"),
            ("mm", "N", "E"),
        ] {
            assert_eq!(
                disagreement(length, force, stress),
                None,
                "{length} {force} {stress}"
            );
        }
    }

    #[test]
    fn the_factor_between_others_is_known() {
        for (length, force, stress, factor) in [
            ("mm", "N", "GPa", 1e-3),
            ("mm", "N", "Pa", 1e6),
            ("m", "N", "MPa", 1e-6),
            ("mm", "kN", "MPa", 1e3),
            ("cm", "N", "N/mm²", 1e-2),
            ("in", "N", "psi", 0.2248),
        ] {
            let found = disagreement(length, force, stress).unwrap();
            assert!(
                (found / factor - 1.0).abs() < 1e-4,
                "{length} {force} {stress}: {found}"
            );
        }
    }
}
