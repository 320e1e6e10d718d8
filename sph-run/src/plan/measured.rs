//! What earlier launches of a run took, from its log.

use formats::folder::RunFolder;
use std::path::Path;

/// The newest launch.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    pub ranks: u64,
    /// Time of a step in which a rank computes, a mean over the ranks, s.
    pub seconds_per_step: f64,
    /// For people.
    pub origin: String,
}

impl Log {
    /// That of the folder of a run of `count` particles, if it has one that can be used: `log/phases.csv`, else
    /// `log/performance.csv`, whose rates include the exchange.
    pub fn find(path: &Path, count: u64) -> Option<Self> {
        let log = RunFolder::new(path).log();
        ["phases.csv", "performance.csv"].iter().find_map(|name| {
            let file = log.join(name);
            Self::parse(&std::fs::read_to_string(&file).ok()?, count, &file.display().to_string())
        })
    }

    /// The last line of either table; none where a column that is needed is not there or says nothing.
    fn parse(text: &str, count: u64, origin: &str) -> Option<Self> {
        let (head, line) = (text.lines().next()?, text.lines().skip(1).last()?);
        let of = |name: &str| {
            let place = head.split(',').position(|column| column.split(' ').next() == Some(name))?;
            line.split(',').nth(place)?.trim().parse::<f64>().ok()
        };
        let ranks = of("ranks")?;
        let seconds_per_step = match of("particle_steps_per_second") {
            Some(rate) => count as f64 / rate,
            // Lines of earlier versions lack the processor time.
            None => {
                of("computed")
                    .map_or_else(|| Some(of("loop")? - of("output")? - of("halo")?), |all| Some(all / ranks))?
                    / of("steps")?
            }
        };
        let usable = ranks >= 1.0 && seconds_per_step > 0.0 && seconds_per_step.is_finite();
        usable.then(|| Self { ranks: ranks as u64, seconds_per_step, origin: format!("{origin}, on {ranks} ranks") })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phases;

    #[test]
    fn the_newest_launch_counts_without_output_and_exchange() {
        let columns = phases::columns();
        let line = |loop_: f64| {
            let value = |column: &str| match column.split(' ').next() {
                Some("steps") => "100".to_owned(),
                Some("ranks") => "4".to_owned(),
                Some("loop") => loop_.to_string(),
                Some("output") => "1".to_owned(),
                Some("halo") => "2".to_owned(),
                Some("computed") => "16".to_owned(),
                _ => "0".to_owned(),
            };
            columns.split(',').map(value).collect::<Vec<_>>().join(",")
        };
        let text = format!("{columns}\n{}\n{}\n", line(50.0), line(8.0));
        let log = Log::parse(&text, 1000, "phases.csv").unwrap();
        assert_eq!((log.ranks, log.seconds_per_step), (4, 0.04));
        assert!(Log::parse(&columns, 1, "x").is_none() && Log::parse("", 1, "x").is_none());
        let earlier = text.replace(",computed [s]", "").replace(",16\n", "\n");
        assert_eq!(Log::parse(&earlier, 1000, "phases.csv").unwrap().seconds_per_step, 0.05);
        let rates =
            "time,step,wall,particle_steps_per_second [1/s],imbalance,ranks\n0.1,5,1,1e6,1,4\n0.2,9,2,2e6,1,4\n";
        assert_eq!(Log::parse(rates, 1000, "performance.csv").unwrap().seconds_per_step, 5e-4);
    }
}
