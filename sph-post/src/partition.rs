//! Where the potential energy went (Szewc 2017, section 5.4, Eqs 29 to 31 and Fig 7).

use crate::history::History;

/// The energies of a run over the time of its history, J (J/m in plane strain), and whether they add up.
///
/// The work of the stresses is what the material stores and what it dissipates; with the heat of the viscosity it is all
/// that leaves the mechanical energy, so that kinetic + potential + stress work + viscous work stays as it began, but for
/// walls that move and what the scheme loses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Partition {
    /// Times, s.
    pub times: Vec<f64>,
    /// Kinetic energy (Szewc 2017, Eq 30).
    pub kinetic: Vec<f64>,
    /// Potential energy (the same, Eq 29), zero at the origin.
    pub potential: Vec<f64>,
    /// What the material stores.
    pub elastic: Vec<f64>,
    /// What the material has dissipated: the work of the stresses, less what of it is stored.
    pub plastic: Vec<f64>,
    /// What the viscosity between particles has turned into heat.
    pub viscous: Vec<f64>,
    /// Error of the sum, over the largest change of the potential energy so far in the run; 0 where all adds up.
    pub closure: Vec<f64>,
}

impl Partition {
    /// From a history; `None` where it lacks one of the columns, as those of older runs do.
    pub fn of(history: &History) -> Option<Self> {
        let column = |name| history.column(name);
        let (kinetic, potential) = (column("kinetic_energy")?, column("potential_energy")?);
        let (elastic, stress, viscous) = (column("elastic_energy")?, column("stress_work")?, column("viscous_work")?);
        let sum = |k: usize| kinetic[k] + potential[k] + stress[k] + viscous[k];
        let change = potential.iter().map(|p| (p - potential[0]).abs()).fold(0.0, f64::max);
        let lines = 0..history.times().len();
        Some(Self {
            times: history.times().to_vec(),
            kinetic: kinetic.to_vec(),
            potential: potential.to_vec(),
            elastic: elastic.to_vec(),
            plastic: lines.clone().map(|k| stress[k] - stress[0] - (elastic[k] - elastic[0])).collect(),
            viscous: viscous.iter().map(|v| v - viscous[0]).collect(),
            closure: lines.map(|k| (sum(k) - sum(0)) / change).collect(),
        })
    }

    /// Dissipated by the material and by the viscosity at the end, over `potential`, the potential energy at the start.
    pub fn dissipated(&self, potential: f64) -> f64 {
        let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
        (last(&self.plastic) + last(&self.viscous)) / potential
    }

    /// The error of the sum at the end.
    pub fn error(&self) -> f64 {
        self.closure.last().copied().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::Column;

    fn history(columns: &[(&str, [f64; 3])]) -> History {
        let column = |&(name, values): &(&str, [f64; 3])| Column {
            name: name.into(),
            unit: if name == "time" { "s" } else { "J" }.into(),
            values: values.to_vec(),
        };
        History { columns: columns.iter().map(column).collect() }
    }

    /// 10 J of potential energy: 6 J go; first 2 J of it are motion, at the end none, and 0.5 J of elastic energy is
    /// there from the start.
    fn falling() -> Vec<(&'static str, [f64; 3])> {
        vec![
            ("time", [0.0, 1.0, 2.0]),
            ("kinetic_energy", [0.0, 2.0, 0.0]),
            ("potential_energy", [10.0, 6.0, 4.0]),
            ("elastic_energy", [0.5, 0.75, 1.0]),
            ("stress_work", [0.0, 1.5, 5.0]),
            ("viscous_work", [0.0, 0.5, 1.0]),
        ]
    }

    #[test]
    fn a_partition_that_closes() {
        let p = Partition::of(&history(&falling())).unwrap();
        assert_eq!(p.plastic, [0.0, 1.25, 4.5]);
        assert_eq!(p.viscous, [0.0, 0.5, 1.0]);
        assert_eq!(p.closure, [0.0; 3]);
        assert!((p.dissipated(10.0) - 0.55).abs() < 1e-15);
        // What is stored, moves, lies high and is dissipated makes up what there was, at every time.
        for k in 0..3 {
            let sum = p.kinetic[k] + p.potential[k] + p.elastic[k] + p.plastic[k] + p.viscous[k];
            assert!((sum - 10.5).abs() < 1e-15, "{k}: {sum}");
        }
    }

    #[test]
    fn what_is_missing_shows_in_the_closure() {
        let mut columns = falling();
        columns[5].1[2] = 0.7;
        let p = Partition::of(&history(&columns)).unwrap();
        assert!((p.error() + 0.05).abs() < 1e-15, "{:?}", p.closure);
        assert_eq!(p.closure[1], 0.0);
    }

    #[test]
    fn histories_without_work_have_none() {
        for missing in 4..6 {
            let mut columns = falling();
            columns.remove(missing);
            assert_eq!(Partition::of(&history(&columns)), None);
        }
    }
}
