//! Quantities with units: `"2 mm"`, `"5.98 MPa"`, `"30 deg"` to numbers in SI units (degrees for angles).
//!
//! Prefixes shift the decimal exponent before the text becomes a binary number, so `"2 mm"` is the same number as
//! `0.002`, to the last bit.

/// What a quantity measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// m.
    Length,
    /// s.
    Time,
    /// kg/m3.
    Density,
    /// Pa.
    Stress,
    /// Degrees.
    Angle,
    /// m/s.
    Velocity,
    /// m/s2.
    Acceleration,
    /// 1/s.
    Rate,
    /// Pa s.
    Viscosity,
    /// No unit.
    Number,
}

/// A unit: value in SI = number * 10^shift * multiply / divide.
struct Unit {
    name: &'static str,
    dimension: Dimension,
    shift: i32,
    multiply: f64,
    divide: f64,
}

const fn decimal(name: &'static str, dimension: Dimension, shift: i32) -> Unit {
    Unit { name, dimension, shift, multiply: 1.0, divide: 1.0 }
}

/// Every unit, smallest first within a dimension.
const UNITS: &[Unit] = &[
    decimal("um", Dimension::Length, -6),
    decimal("mm", Dimension::Length, -3),
    decimal("cm", Dimension::Length, -2),
    decimal("m", Dimension::Length, 0),
    decimal("km", Dimension::Length, 3),
    decimal("us", Dimension::Time, -6),
    decimal("ms", Dimension::Time, -3),
    decimal("s", Dimension::Time, 0),
    Unit { name: "min", dimension: Dimension::Time, shift: 0, multiply: 60.0, divide: 1.0 },
    Unit { name: "h", dimension: Dimension::Time, shift: 2, multiply: 36.0, divide: 1.0 },
    decimal("kg/m3", Dimension::Density, 0),
    decimal("g/cm3", Dimension::Density, 3),
    decimal("t/m3", Dimension::Density, 3),
    decimal("Pa", Dimension::Stress, 0),
    decimal("kPa", Dimension::Stress, 3),
    decimal("MPa", Dimension::Stress, 6),
    decimal("GPa", Dimension::Stress, 9),
    decimal("deg", Dimension::Angle, 0),
    Unit { name: "rad", dimension: Dimension::Angle, shift: 0, multiply: 180.0 / std::f64::consts::PI, divide: 1.0 },
    decimal("mm/s", Dimension::Velocity, -3),
    decimal("cm/s", Dimension::Velocity, -2),
    decimal("m/s", Dimension::Velocity, 0),
    Unit { name: "km/h", dimension: Dimension::Velocity, shift: 1, multiply: 1.0, divide: 36.0 },
    decimal("mm/s2", Dimension::Acceleration, -3),
    decimal("cm/s2", Dimension::Acceleration, -2),
    decimal("m/s2", Dimension::Acceleration, 0),
    decimal("1/s", Dimension::Rate, 0),
    decimal("/s", Dimension::Rate, 0),
    decimal("Hz", Dimension::Rate, 0),
    decimal("mPa s", Dimension::Viscosity, -3),
    decimal("Pa s", Dimension::Viscosity, 0),
    decimal("kPa s", Dimension::Viscosity, 3),
];

impl Dimension {
    /// Its name with an article, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "a length",
            Self::Time => "a time",
            Self::Density => "a density",
            Self::Stress => "a stress",
            Self::Angle => "an angle",
            Self::Velocity => "a velocity",
            Self::Acceleration => "an acceleration",
            Self::Rate => "a rate",
            Self::Viscosity => "a viscosity",
            Self::Number => "a number without unit",
        }
    }

    /// Names of its units; empty for [`Dimension::Number`].
    pub fn units(self) -> Vec<&'static str> {
        UNITS.iter().filter(|unit| unit.dimension == self).map(|unit| unit.name).collect()
    }

    /// How one is written in a scene, for messages.
    pub fn example(self) -> &'static str {
        match self {
            Self::Length => "\"4 mm\"",
            Self::Time => "\"0.35 s\"",
            Self::Density => "\"2600 kg/m3\"",
            Self::Stress => "\"5.98 MPa\"",
            Self::Angle => "\"30 deg\"",
            Self::Velocity => "\"1 m/s\"",
            Self::Acceleration => "\"9.81 m/s2\"",
            Self::Rate => "\"10 1/s\"",
            Self::Viscosity => "\"200 Pa s\"",
            Self::Number => "0.3",
        }
    }

    /// What is needed: name and units, for messages.
    fn needed(self) -> String {
        match self {
            Self::Number => "a number without unit is needed".to_string(),
            _ => format!("{} is needed (units: {})", self.name(), self.units().join(", ")),
        }
    }
}

/// Reads a quantity written as a number and a unit, e.g. `2 mm`; returns it in SI units (degrees for angles).
///
/// Fails with one sentence saying what is wrong and which units would be right. Infinities and not-a-number are refused.
pub fn parse(text: &str, dimension: Dimension) -> Result<f64, String> {
    let (number, unit) = split(text.trim());
    if !number.contains(|c: char| c.is_ascii_digit()) {
        return Err(format!("`{text}` does not begin with a finite number; {}", dimension.needed()));
    }
    let unit = normalised(unit);
    let unit = match (dimension, unit.as_str()) {
        (Dimension::Number, "") => &NO_UNIT,
        (_, "") => return Err(format!("`{text}` has no unit; {}", dimension.needed())),
        _ => {
            let found = named(&unit).ok_or_else(|| unknown(&unit, dimension))?;
            if found.dimension != dimension {
                return Err(format!("`{text}` is {}; {}", found.dimension.name(), dimension.needed()));
            }
            found
        }
    };
    unit.value(number).ok_or_else(|| format!("`{text}` is not a finite number; {}", dimension.needed()))
}

/// The number that [`parse`] makes of a text, whatever it measures; none where it is no quantity. Every unit stands for one
/// dimension only.
pub(crate) fn any(text: &str) -> Option<f64> {
    let (number, unit) = split(text.trim());
    let unit = normalised(unit);
    let unit = if unit.is_empty() { &NO_UNIT } else { named(&unit)? };
    unit.value(number)
}

const NO_UNIT: Unit = decimal("", Dimension::Number, 0);

/// The unit of a normalised name.
fn named(name: &str) -> Option<&'static Unit> {
    UNITS.iter().find(|unit| unit.name.replace(' ', "") == name)
}

impl Unit {
    /// That many of it, in SI units; none where that is no finite number.
    fn value(&self, number: &str) -> Option<f64> {
        let value = shifted(number, self.shift)? * self.multiply / self.divide;
        value.is_finite().then_some(value)
    }
}

fn unknown(unit: &str, dimension: Dimension) -> String {
    let alike = UNITS.iter().find(|u| u.dimension == dimension && u.name.eq_ignore_ascii_case(unit));
    let hint = alike.map_or(String::new(), |u| format!("did you mean `{}`? ", u.name));
    format!("unknown unit `{unit}`; {hint}{}", dimension.needed())
}

/// The longest decimal number at the start, and the rest.
fn split(text: &str) -> (&str, &str) {
    let bytes = text.as_bytes();
    let digits = |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let signed = |from: usize| from + usize::from(matches!(bytes.get(from), Some(b'+' | b'-')));
    let mut end = digits(signed(0));
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let start = signed(end + 1);
        // Only with digits behind it, `e` is an exponent.
        if digits(start) > start {
            end = digits(start);
        }
    }
    text.split_at(end)
}

/// `number * 10^shift`, rounded once.
fn shifted(number: &str, shift: i32) -> Option<f64> {
    let (mantissa, exponent) = match number.find(['e', 'E']) {
        Some(at) => (&number[..at], number[at + 1..].parse::<i32>().ok()?),
        None => (number, 0),
    };
    format!("{mantissa}e{}", exponent.checked_add(shift)?).parse().ok()
}

/// One spelling for each unit: `m/s^2`, `m/s²` and `m / s2` are `m/s2`.
fn normalised(unit: &str) -> String {
    let mut plain = String::new();
    for c in unit.chars() {
        match c {
            '²' => plain.push('2'),
            '³' => plain.push('3'),
            'µ' | 'μ' => plain.push('u'),
            '°' => plain.push_str("deg"),
            '^' | '*' | '·' => {}
            c if c.is_whitespace() => {}
            c => plain.push(c),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::{Dimension::*, *};

    #[test]
    fn a_quantity_says_what_it_measures() {
        let names: std::collections::BTreeSet<_> = UNITS.iter().map(|unit| normalised(unit.name)).collect();
        assert_eq!(names.len(), UNITS.len(), "each name stands for one unit");
        for (text, value) in [("2 mm", Some(0.002)), ("1 h", Some(3600.0)), (" 30° ", Some(30.0)), ("0.3", Some(0.3))]
        {
            assert_eq!(any(text), value, "{text}");
        }
        for text in ["3d", "cubic-spline", "", "mm", "-", "1e999 m", "nan"] {
            assert_eq!(any(text), None, "{text}");
        }
    }

    #[test]
    fn prefixes_are_exact() {
        for (text, dimension, value) in [
            ("2 mm", Length, 0.002),
            ("0.3 mm", Length, 0.0003),
            ("7 um", Length, 7e-6),
            ("7 µm", Length, 7e-6),
            ("1.1 cm", Length, 0.011),
            ("-3m", Length, -3.0),
            ("1.7 km", Length, 1700.0),
            ("20 ms", Time, 0.02),
            ("5e-1 us", Time, 5e-7),
            ("1.5 min", Time, 90.0),
            ("2 h", Time, 7200.0),
            ("2.65 g/cm3", Density, 2650.0),
            ("2.65 t/m^3", Density, 2650.0),
            ("2600 kg/m³", Density, 2600.0),
            ("5.98 MPa", Stress, 5.98e6),
            ("5.98e3 kPa", Stress, 5.98e6),
            ("1.2E+1 GPa", Stress, 1.2e10),
            ("30 deg", Angle, 30.0),
            ("30°", Angle, 30.0),
            (" 1.5 mm/s ", Velocity, 0.0015),
            ("36 km/h", Velocity, 10.0),
            ("9.81 m/s2", Acceleration, 9.81),
            ("9.81 m/s^2", Acceleration, 9.81),
            ("9.81 m / s²", Acceleration, 9.81),
            ("3 1/s", Rate, 3.0),
            ("3 /s", Rate, 3.0),
            ("3 Hz", Rate, 3.0),
            ("0.25", Number, 0.25),
            (".5 m", Length, 0.5),
            ("5. m", Length, 5.0),
        ] {
            assert_eq!(parse(text, dimension), Ok(value), "{text}");
        }
        assert!((parse("1 rad", Angle).unwrap() - 57.295_779_513_082_32).abs() < 1e-13);
        // A product with 1e-3 would miss some of these by a bit.
        for n in 1..2000 {
            let expected: f64 = format!("{n}e-3").parse().unwrap();
            assert_eq!(parse(&format!("{n} mm"), Length), Ok(expected));
        }
    }

    #[test]
    fn faults_name_the_units_that_would_be_right() {
        for (text, dimension, phrase) in [
            ("2 kg/m3", Length, "`2 kg/m3` is a density; a length is needed (units: um, mm, cm, m, km)"),
            ("2", Length, "has no unit"),
            ("2 furlong", Length, "unknown unit `furlong`"),
            ("2 mpa", Stress, "did you mean `MPa`?"),
            ("mm", Length, "does not begin with a finite number"),
            ("", Time, "(units: us, ms, s, min, h)"),
            ("inf m", Length, "does not begin with a finite number"),
            ("nan", Number, "does not begin with a finite number"),
            ("1e999 m", Length, "not a finite number"),
            ("1e99999999999 m", Length, "not a finite number"),
            ("1e308 km", Length, "not a finite number"),
            ("3 s", Number, "is a time; a number without unit is needed"),
            ("1 2 m", Length, "unknown unit `2m`"),
        ] {
            let message = parse(text, dimension).unwrap_err();
            assert!(message.contains(phrase), "{text}: {message}");
        }
    }
}
