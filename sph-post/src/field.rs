//! What particles can be coloured by: fields of the snapshots and what follows from them at once.

use formats::snapshot::Rows;

/// A number that every particle has.
#[derive(Debug)]
pub struct Field {
    /// As on the command line and in the names of files.
    pub name: &'static str,
    /// As beside the colours.
    pub symbol: &'static str,
    /// SI; empty for pure numbers.
    pub unit: &'static str,
    /// Of the particle in a row.
    pub value: fn(&Rows, usize) -> f64,
}

impl PartialEq for Field {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

macro_rules! fields {
    ($($name:literal $symbol:literal $unit:literal $value:expr)*) => {
        /// The whole table.
        pub static FIELDS: &[Field] =
            &[$(Field { name: $name, symbol: $symbol, unit: $unit, value: $value }),*];
    };
}

fields! {
    "speed" "|v|" "m/s" |r, k| r.velocity[k].iter().map(|v| v * v).sum::<f64>().sqrt()
    "velocity_x" "v x" "m/s" |r, k| r.velocity[k][0]
    "velocity_y" "v y" "m/s" |r, k| r.velocity[k][1]
    "velocity_z" "v z" "m/s" |r, k| r.velocity[k][2]
    "density" "\u{03c1}" "kg/m\u{b3}" |r, k| r.density[k]
    "pressure" "p" "Pa" |r, k| pressure(r.stress[k])
    "shear_stress" "\u{221a}J\u{2082}" "Pa" |r, k| shear_stress(r.stress[k])
    "stress_ratio" "\u{221a}J\u{2082} / p" "" |r, k| shear_stress(r.stress[k]) / pressure(r.stress[k])
    "stress_xx" "\u{03c3}xx" "Pa" |r, k| r.stress[k][0]
    "stress_yy" "\u{03c3}yy" "Pa" |r, k| r.stress[k][1]
    "stress_zz" "\u{03c3}zz" "Pa" |r, k| r.stress[k][2]
    "stress_xy" "\u{03c3}xy" "Pa" |r, k| r.stress[k][3]
    "stress_yz" "\u{03c3}yz" "Pa" |r, k| r.stress[k][4]
    "stress_xz" "\u{03c3}xz" "Pa" |r, k| r.stress[k][5]
    "plastic_strain" "plastic strain" "" |r, k| r.plastic_strain[k]
    "stress_work" "stress work" "J/kg" |r, k| r.stress_work[k]
    "viscous_work" "viscous work" "J/kg" |r, k| r.viscous_work[k]
    "body" "body" "" |r, k| r.body[k] as f64
}

/// Minus a third of the trace, Pa: positive in compression.
pub fn pressure(s: [f64; 6]) -> f64 {
    -(s[0] + s[1] + s[2]) / 3.0
}

/// Root of the second invariant J2 of the deviator, Pa.
pub fn shear_stress(s: [f64; 6]) -> f64 {
    let p = pressure(s);
    let normal: f64 = s[..3].iter().map(|s| (s + p).powi(2)).sum();
    (0.5 * normal + s[3..].iter().map(|s| s * s).sum::<f64>()).sqrt()
}

/// The field of a name.
///
/// # Errors
/// A sentence with all names.
pub fn parse(text: &str) -> Result<&'static Field, String> {
    FIELDS.iter().find(|f| f.name == text).ok_or_else(|| {
        let names: Vec<&str> = FIELDS.iter().map(|f| f.name).collect();
        format!("there is no such field; valid: {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invariants_of_known_stresses() {
        // Simple shear of 300 Pa under 1 kPa; uniaxial compression has sqrt(J2) = s/sqrt(3).
        let sheared = [-1000.0, -1000.0, -1000.0, 0.0, 0.0, 300.0];
        assert_eq!((pressure(sheared), shear_stress(sheared)), (1000.0, 300.0));
        let uniaxial = [0.0, 0.0, -3000.0, 0.0, 0.0, 0.0];
        assert_eq!(pressure(uniaxial), 1000.0);
        assert!((shear_stress(uniaxial) - 3000.0 / 3_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn names_are_found_and_unknown_ones_refused_with_a_list() {
        assert_eq!(parse("plastic_strain").unwrap().unit, "");
        let names: std::collections::BTreeSet<&str> = FIELDS.iter().map(|f| f.name).collect();
        assert_eq!(names.len(), FIELDS.len());
        assert!(parse("sped").unwrap_err().contains("valid: speed, velocity_x"));
    }
}
