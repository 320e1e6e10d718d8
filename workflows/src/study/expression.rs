//! Arithmetic in studies: `final_height_m / r0_m`, `6*sqrt(r0*aspect/9.81)`.
//!
//! Numbers, names, `+ - * / ^`, brackets, and the functions sqrt, abs, min, max. Names begin with a letter and go on with
//! letters, digits, `_` and `.`.

/// Value of an expression. `lookup` answers names: not-a-number where there is no value, which makes the whole one
/// not-a-number; nothing where it does not know the name.
pub fn evaluate(text: &str, lookup: &dyn Fn(&str) -> Option<f64>) -> Result<f64, String> {
    let mut parser = Parser { text, at: 0, lookup };
    let value = parser.sum()?;
    match parser.peek() {
        None => Ok(value),
        Some(found) => Err(format!("`{text}`: unexpected `{found}`")),
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    lookup: &'a dyn Fn(&str) -> Option<f64>,
}

impl Parser<'_> {
    fn peek(&mut self) -> Option<char> {
        let rest = self.text.get(self.at..)?;
        self.at += rest.len() - rest.trim_start().len();
        self.text.get(self.at..)?.chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += if found { wanted.len_utf8() } else { 0 };
        found
    }

    fn sum(&mut self) -> Result<f64, String> {
        let mut value = self.product()?;
        loop {
            if self.take('+') {
                value += self.product()?;
            } else if self.take('-') {
                value -= self.product()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn product(&mut self) -> Result<f64, String> {
        let mut value = self.power()?;
        loop {
            if self.take('*') {
                value *= self.power()?;
            } else if self.take('/') {
                value /= self.power()?;
            } else {
                return Ok(value);
            }
        }
    }

    fn power(&mut self) -> Result<f64, String> {
        if self.take('-') {
            return Ok(-self.power()?);
        }
        let base = self.atom()?;
        Ok(if self.take('^') { base.powf(self.power()?) } else { base })
    }

    fn atom(&mut self) -> Result<f64, String> {
        if self.take('(') {
            let value = self.sum()?;
            return self.closed(value);
        }
        let first = self.peek();
        let rest = self.text.get(self.at..).unwrap_or_default();
        match first {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(rest),
            Some(c) if c.is_ascii_alphabetic() => self.name(rest),
            Some(c) => Err(format!("`{}`: unexpected `{c}`", self.text)),
            None => Err(format!("`{}`: a number or a name is missing at the end", self.text)),
        }
    }

    fn closed(&mut self, value: f64) -> Result<f64, String> {
        if self.take(')') { Ok(value) } else { Err(format!("`{}`: `)` is missing", self.text)) }
    }

    fn number(&mut self, rest: &str) -> Result<f64, String> {
        let bytes = rest.as_bytes();
        let is_part = |k: usize| {
            let sign = (bytes[k] == b'-' || bytes[k] == b'+') && k > 0 && bytes[k - 1].eq_ignore_ascii_case(&b'e');
            bytes[k].is_ascii_digit() || bytes[k] == b'.' || bytes[k].eq_ignore_ascii_case(&b'e') || sign
        };
        let end = (0..bytes.len()).find(|&k| !is_part(k)).unwrap_or(bytes.len());
        self.at += end;
        rest[..end].parse().map_err(|_| format!("`{}`: `{}` is no number", self.text, &rest[..end]))
    }

    fn name(&mut self, rest: &str) -> Result<f64, String> {
        let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')).unwrap_or(rest.len());
        let name = &rest[..end];
        self.at += end;
        if self.take('(') {
            let first = self.sum()?;
            let value = match name {
                "sqrt" => first.sqrt(),
                "abs" => first.abs(),
                "min" | "max" if self.take(',') => {
                    let second = self.sum()?;
                    // Unlike f64::min: what is not known stays not known.
                    match (first < second) == (name == "min") {
                        _ if first.is_nan() || second.is_nan() => f64::NAN,
                        true => first,
                        false => second,
                    }
                }
                _ => return Err(format!("`{}`: no function `{name}` of one number", self.text)),
            };
            return self.closed(value);
        }
        (self.lookup)(name).ok_or_else(|| format!("`{}`: the name `{name}` is not known here", self.text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_as_on_paper() {
        let names = |name: &str| match name {
            "a" => Some(4.0),
            "none" => Some(f64::NAN),
            _ => None,
        };
        for (text, value) in [
            ("1 + 2*3", 7.0),
            ("(1+2)*3", 9.0),
            ("2^3^2", 512.0),
            ("-2^2", -4.0),
            ("10 - 4 - 3", 3.0),
            ("8/4/2", 1.0),
            ("sqrt(a) + 1.5e-3*2", 2.003),
            ("min(a, 3) + max(a, 3) - abs(-1)", 6.0),
        ] {
            assert_eq!(evaluate(text, &names), Ok(value), "{text}");
        }
        for text in ["none", "1 + none", "min(1, none)"] {
            assert!(evaluate(text, &names).unwrap().is_nan(), "{text}");
        }
        for (text, fault) in [
            ("b", "`b` is not known"),
            ("1 +", "missing"),
            ("(1", "`)`"),
            ("1 2", "unexpected"),
            ("sin(1)", "no function"),
        ] {
            assert!(evaluate(text, &names).unwrap_err().contains(fault), "{text}");
        }
    }
}
