//! The supported keywords of decks, and messages about others.

use super::written::on_line;
use solver::error::{Findings, Reason};

/// Keywords that are read. The message about an unknown keyword lists them.
pub(super) const READ: &[&str] = &[
    "HEADING",
    "NODE",
    "ELEMENT",
    "NSET",
    "ELSET",
    "SURFACE",
    "PART",
    "END PART",
    "ASSEMBLY",
    "END ASSEMBLY",
    "INSTANCE",
    "END INSTANCE",
    "MATERIAL",
    "ELASTIC",
    "EXPANSION",
    "DENSITY",
    "SPRING",
    "ORIENTATION",
    "SOLID SECTION",
    "AMPLITUDE",
    "INITIAL CONDITIONS",
    "RIGID BODY",
    "CONTACT PAIR",
    "CLEARANCE",
    "TIE",
    "SURFACE INTERACTION",
    "SURFACE BEHAVIOR",
    "FRICTION",
    "STEP",
    "STATIC",
    "BOUNDARY",
    "CLOAD",
    "DLOAD",
    "DSLOAD",
    "TEMPERATURE",
];

/// The parameters of keywords: those that are read or refused where the keyword is read, and those that do not change a
/// linear static solution. Any other one is refused, since a misspelt parameter would be left out. Keywords that are not
/// listed compare their parameters themselves, or are never used.
#[rustfmt::skip] // a table
pub(super) const PARAMETERS: &[(&str, &[&str])] = &[
    ("NODE", &["NSET", "SYSTEM", "INPUT"]),
    ("ELEMENT", &["TYPE", "ELSET", "INPUT"]),
    ("NSET", &["NSET", "ELSET", "INSTANCE", "GENERATE", "UNSORTED", "INTERNAL"]),
    ("ELSET", &["ELSET", "INSTANCE", "GENERATE", "UNSORTED", "INTERNAL"]),
    ("SURFACE", &["NAME", "TYPE", "COMBINE", "FILLET RADIUS", "INTERNAL", "DEFINITION", "REGION TYPE"]),
    ("PART", &["NAME"]),
    ("INSTANCE", &["NAME", "PART"]),
    ("ASSEMBLY", &["NAME"]),
    ("MATERIAL", &["NAME"]),
    ("ELASTIC", &["TYPE", "MODULI", "DEPENDENCIES"]),
    ("ORIENTATION", &["NAME", "SYSTEM", "DEFINITION", "LOCAL DIRECTIONS"]),
    // of plane elements an offset, along the thickness, does not matter
    (
        "SOLID SECTION",
        &["ELSET", "MATERIAL", "ORIENTATION", "CONTROLS", "OFFSET"],
    ),
    ("STEP", &["NAME", "NLGEOM", "PERTURBATION", "INC", "INCF", "AMPLITUDE", "AMP", "EXTRAPOLATION", "UNSYMM", "SOLVER", "CONVERT SDI"]),
    ("STATIC", &["DIRECT", "SOLVER", "TIME RESET", "TOTAL TIME AT START", "RIKS", "STABILIZE", "ALLSDTOL", "CONTINUE", "FACTOR"]),
];

/// Keywords for nodes or elements that are not written in the deck, or that are moved.
pub(super) const NOT_WRITTEN_OUT: &[&str] = &[
    "INCLUDE", "NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM",
];

/// Keywords without effect on a linear static step: requests for output, options of the step's solution, and options of
/// other kinds of steps.
pub(super) const IDLE: &[&str] = &[
    "END STEP",
    "DAMPING",
    "CONDUCTIVITY",
    "SPECIFIC HEAT",
    "LATENT HEAT",
    "PHYSICAL CONSTANTS",
    "USER OUTPUT VARIABLES",
    "MASS",
    "ROTARY INERTIA",
    "NODE PRINT",
    "EL PRINT",
    "NODE FILE",
    "EL FILE",
    "NODE OUTPUT",
    "ELEMENT OUTPUT",
    "EL OUTPUT",
    "OUTPUT",
    "FILE OUTPUT",
    "CONTACT FILE",
    "CONTACT PRINT",
    "CONTACT OUTPUT",
    "SECTION PRINT",
    "SECTION FILE",
    "SECTION OUTPUT",
    "ENERGY PRINT",
    "ENERGY FILE",
    "ENERGY OUTPUT",
    "INTEGRATED OUTPUT",
    "INTEGRATED OUTPUT SECTION",
    "INCREMENTATION OUTPUT",
    "TIME POINTS",
    "FILTER",
    "PREPRINT",
    "PRINT",
    "RESTART",
    "MONITOR",
    "FILE FORMAT",
    "NODE RESPONSE",
    "DIAGNOSTICS",
    "CONTROLS",
    "CONTACT CONTROLS",
    "SOLVER CONTROLS",
    "SECTION CONTROLS",
    "HOURGLASS STIFFNESS",
    "WAVEFRONT MINIMIZATION",
    "DISTRIBUTION",
    "DISTRIBUTION TABLE",
    "POST OUTPUT",
];

/// Keywords for properties that a linear elastic material does not have. A material that no element uses may have them.
pub(super) const NOT_ELASTIC: &[&str] = &[
    "PLASTIC",
    "CYCLIC HARDENING",
    "RATE DEPENDENT",
    "DEFORMATION PLASTICITY",
    "HYPERELASTIC",
    "HYPERFOAM",
    "MULLINS EFFECT",
    "VISCOELASTIC",
    "VISCOUS",
    "CREEP",
    "SWELLING",
    "POROUS ELASTIC",
    "POROUS METAL PLASTICITY",
    "POTENTIAL",
    "CAP PLASTICITY",
    "CLAY PLASTICITY",
    "DRUCKER PRAGER",
    "DRUCKER PRAGER HARDENING",
    "MOHR COULOMB",
    "CONCRETE",
    "CONCRETE DAMAGED PLASTICITY",
    "DAMAGE INITIATION",
    "USER MATERIAL",
    "NO TENSION",
    "NO COMPRESSION",
    "FAIL STRESS",
];

/// The largest number of unknown keywords that are kept for one part.
pub(super) const MOST_UNKNOWN: usize = 50;

/// An unknown keyword.
#[derive(Clone)]
pub(super) struct UnknownKeyword {
    pub(super) name: String,
    /// The line where the keyword first occurs.
    pub(super) line: u64,
    /// The number of occurrences after the first.
    pub(super) more: usize,
}

/// Reports each unknown keyword once; the first report lists the supported keywords.
pub(super) fn report_unknown(mut unknown: Vec<UnknownKeyword>, doubts: &mut Findings) {
    unknown.sort_by(|a, b| (&a.name, a.line).cmp(&(&b.name, b.line)));
    unknown.dedup_by(|later, first| {
        let same = later.name == first.name;
        if same {
            first.more += 1 + later.more;
        }
        same
    });
    unknown.sort_by_key(|keyword| keyword.line);
    let mut hint = format!(
        "Remove it if the solution does not depend on it. Supported keywords: *{}. Requests for output are ignored.",
        READ.join(", *")
    );
    for UnknownKeyword { name, line, more } in unknown {
        let got = match more {
            0 => format!("*{name:.60}"),
            1 => format!("*{name:.60}, here and once more"),
            more => format!("*{name:.60}, here and {more} more times"),
        };
        let expected = "a keyword that is known here";
        doubts.add(on_line(line, Reason::NotUnderstood, got, expected, &hint));
        hint = "Remove it if the solution does not depend on it. The message on the first unknown keyword lists the supported ones.".to_owned();
    }
}
