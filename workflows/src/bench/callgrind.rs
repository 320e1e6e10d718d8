//! Reads what valgrind's callgrind writes: instructions of each function, without those of what it calls.
//!
//! The format is in valgrind's manual, "Callgrind Format Specification". Here only names and costs of one event count: a
//! name is written out once and then given by its number in brackets; a cost line is a position and a number; the line behind
//! `calls=` is what the called function cost, which that function lists itself.

use std::collections::HashMap;

/// Instructions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts {
    /// Of the whole program.
    pub total: u64,
    /// Of each function itself.
    pub functions: HashMap<String, u64>,
}

impl Counts {
    /// What each function has more than in `fewer`, largest first.
    pub fn since(&self, fewer: &Self) -> Vec<(String, u64)> {
        let more = |(name, count): (&String, &u64)| {
            let before = fewer.functions.get(name).copied().unwrap_or(0);
            (*count > before).then(|| (name.clone(), count - before))
        };
        let mut functions: Vec<_> = self.functions.iter().filter_map(more).collect();
        functions.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        functions
    }
}

/// None of what is no such file, or of a part of one.
pub fn parse(text: &str) -> Option<Counts> {
    if !text.lines().any(|line| line == "events: Ir") {
        return None;
    }
    let mut names: HashMap<&str, &str> = HashMap::new();
    let mut counts = Counts::default();
    let (mut function, mut is_of_a_call) = ("", false);
    for line in text.lines() {
        if let Some(total) = line.strip_prefix("summary: ").or_else(|| line.strip_prefix("totals: ")) {
            counts.total = total.trim().parse().ok()?;
        } else if let Some(name) = line.strip_prefix("fn=") {
            function = named(name, &mut names)?;
        } else if let Some(name) = line.strip_prefix("cfn=") {
            named(name, &mut names)?;
        } else if line.starts_with("calls=") {
            is_of_a_call = true;
        } else if line.starts_with(|c: char| c.is_ascii_digit() || "+-*".contains(c))
            && !std::mem::take(&mut is_of_a_call)
        {
            let count: u64 = line.split(' ').nth(1)?.parse().ok()?;
            // Levels of a recursion are functions of their own there: name'2.
            let name = function.split('\'').next().unwrap_or(function);
            *counts.functions.entry(name.to_owned()).or_default() += count;
        }
    }
    Some(counts)
}

/// `(7) name`, or `(7)` once that was said.
fn named<'a>(text: &'a str, names: &mut HashMap<&'a str, &'a str>) -> Option<&'a str> {
    match text.split_once(' ') {
        Some((number, name)) if number.starts_with('(') => {
            names.insert(number, name);
            Some(name)
        }
        _ if text.starts_with('(') => names.get(text).copied(),
        _ => Some(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "\
# callgrind format
version: 1
positions: line
events: Ir
summary: 195

fl=(1) main.rs
fn=(1) main
16 40
cfn=(2) sweep<f64>
calls=5 1
16 120
+1 5

fn=(2)
fi=(3) algebra.rs
* 100
-3 20
fe=(1)
cfn=(3) sweep<f64>'2
calls=1 +2
* 30

fn=(3)
9 30

totals: 195
";

    #[test]
    fn functions_have_their_own_instructions() {
        let counts = parse(FILE).unwrap();
        let expected = [("main", 45), ("sweep<f64>", 150)].map(|(name, count)| (name.to_owned(), count));
        assert_eq!(counts.functions, HashMap::from(expected));
        assert_eq!(counts.total, counts.functions.values().sum::<u64>());
        assert_eq!(parse("events: Ir Dr\n1 2 3\n"), None);
        assert_eq!(parse("events: Ir\nfn=(4)\n1 2\n"), None, "a name that was never said");
    }

    #[test]
    fn differences_come_largest_first() {
        let [few, mut many] = [parse(FILE).unwrap(), parse(FILE).unwrap()];
        many.functions.insert("new".into(), 3);
        *many.functions.get_mut("sweep<f64>").unwrap() += 7;
        assert_eq!(many.since(&few), [("sweep<f64>".to_owned(), 7), ("new".to_owned(), 3)]);
    }
}
