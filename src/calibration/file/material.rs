//! What ball and floor are made of, as a calibration says it.

use crate::config::{NumberRange, POSITIVE, Section};
use crate::rebound::compliant::stiffness::Material;

const POISSON: NumberRange = NumberRange {
    accepted: "a number from -0.9 to 0.5",
    holds: |x| (-0.9..=0.5).contains(&x),
    hint: "0.22 to 0.35 for glass, ceramics and metals, 0.5 for rubber",
};

/// What a ball or a floor is made of: both of its elastic constants, or nothing.
pub(super) fn material(section: &Section<'_>) -> Option<Material> {
    let modulus = section.number(
        "youngs_modulus_pa",
        POSITIVE.or_try("7e10 is glass, 2.1e11 steel; give pascals, or leave it out"),
    );
    let poisson = section.number("poisson_ratio", POISSON);
    for (key, has, other) in [
        ("youngs_modulus_pa", "poisson_ratio", section.get("poisson_ratio")),
        (
            "poisson_ratio",
            "youngs_modulus_pa",
            section.get("youngs_modulus_pa"),
        ),
    ] {
        if section.get(key).is_none() && other.is_some() {
            section.refuse(
                section.key(key),
                format!("nothing, beside {has}"),
                "both or neither",
                "the stiffness of a contact follows from both: 0.22 to 0.35 is the Poisson number of glass, ceramics and metals, 0.5 of rubber",
            );
        }
    }
    Some(Material {
        youngs_modulus_pa: modulus?,
        poisson_ratio: poisson?,
    })
}
