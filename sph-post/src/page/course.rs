//! How the run went: launches, stops, where the time went. From logs, which may be missing: then there is nothing to show.

use super::html::{duration, escape, number, table};
use crate::analysis::Analysis;
use formats::{
    folder::RunFolder,
    journal::{Event, Progress},
};
use std::fmt::Write;

/// Phases of `log/phases.csv`: what stands between the columns `loop` and `memory_largest`.
const PHASES: [&str; 2] = ["loop", "memory_largest"];

/// A table of numbers from a log.
#[derive(Debug, Default)]
struct Log {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Log {
    /// Of CSV with `name [unit]` above the columns. Lines that are not numbers, or too short, are left out.
    fn parse(text: &str) -> Self {
        let mut lines = text.lines();
        let name = |cell: &str| cell.split(" [").next().unwrap_or(cell).to_string();
        let names: Vec<String> = lines.next().unwrap_or_default().split(',').map(name).collect();
        let rows = lines.filter_map(|line| line.split(',').map(|cell| cell.parse().ok()).collect::<Option<Vec<f64>>>());
        let rows = rows.filter(|row| row.len() == names.len()).collect();
        Self { names, rows }
    }

    fn column(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.names.iter().position(|n| n == name)?;
        Some(self.rows.iter().map(|row| row[place]).collect()).filter(|c: &Vec<f64>| !c.is_empty())
    }
}

/// What the logs tell.
#[derive(Debug)]
pub struct Course {
    events: Vec<Event>,
    progress: Option<Progress>,
    phases: Log,
    performance: Log,
}

impl Course {
    /// Whatever can be read of it.
    pub fn read(run: &RunFolder) -> Self {
        let text = |path| std::fs::read_to_string(path).unwrap_or_default();
        Self {
            events: Event::all(run),
            progress: serde_json::from_str(&text(run.progress())).ok(),
            phases: Log::parse(&text(run.log().join("phases.csv"))),
            performance: Log::parse(&text(run.log().join("performance.csv"))),
        }
    }

    /// One line: how far the run is.
    pub fn state(&self, a: &Analysis, run: &RunFolder) -> String {
        let (last, end) = (a.last(), a.scene.end.time);
        if run.done().exists() {
            return format!(
                "Finished at t = {} s; {} particles, {} steps.",
                number(last.time),
                last.particles,
                last.step
            );
        }
        let time = self.progress.as_ref().map_or(last.time, |p| p.time.max(last.time));
        let far = format!("t = {} of {} s ({:.0} %)", number(time), number(end), 100.0 * time / end);
        match std::fs::read_to_string(run.to_continue()) {
            Ok(reason) => format!("Stopped at {far}: {}", reason.trim()),
            Err(_) => format!("Unfinished: {far}; {} particles.", last.particles),
        }
    }

    /// The largest work of a rank over the mean, if it was logged.
    pub fn imbalance(&self) -> Option<f64> {
        self.performance.column("imbalance").map(|c| c.into_iter().fold(0.0, f64::max))
    }

    /// All of it.
    pub fn page(&self) -> String {
        let mut out = String::new();
        let checkpoints = self.events.iter().filter(|e| e.event == "checkpoint").count();
        let told: Vec<Vec<String>> = self.events.iter().filter(|e| e.event != "checkpoint").map(row).collect();
        if !told.is_empty() {
            out.push_str("<h3>What happened</h3>\n");
            out += &table(&["event", "when (UTC)", "step", "t (s)", "ranks", "more"], &told);
            let _ = writeln!(out, "<p>Checkpoints written: {checkpoints}.</p>");
        }
        out += &self.where_the_time_went();
        out += &self.rates();
        if out.is_empty() { "<p>There are no logs of this run.</p>\n".into() } else { out }
    }

    /// The phases of the step, over all launches.
    fn where_the_time_went(&self) -> String {
        let log = &self.phases;
        let place = |name: &str| log.names.iter().position(|n| n == name);
        let (Some(from), Some(to), false) = (place(PHASES[0]), place(PHASES[1]), log.rows.is_empty()) else {
            return String::new();
        };
        let sum = |place: usize| log.rows.iter().map(|row| row[place]).sum::<f64>();
        let whole = sum(from);
        let mut out = format!(
            "<h3>Where the time went</h3>\n<p>{} in the loop over the steps, in {} launch{}.</p>\n<table>\n<tbody>\n",
            duration(whole),
            log.rows.len(),
            if log.rows.len() == 1 { "" } else { "es" }
        );
        for place in from + 1..to {
            let (name, spent) = (escape(&log.names[place]), sum(place));
            let percent = if whole > 0.0 { 100.0 * spent / whole } else { 0.0 };
            let _ = writeln!(
                out,
                "<tr><th scope=\"row\">{name}</th><td>{}</td><td>{percent:.1} %</td>\
                 <td><span class=\"bar\" style=\"width:{:.2}em\"></span></td></tr>",
                duration(spent),
                0.25 * percent
            );
        }
        out.push_str("</tbody>\n</table>\n");
        let launches: Vec<Vec<String>> = (0..log.rows.len())
            .map(|k| {
                let cell = |name: &str| place(name).map_or(f64::NAN, |p| log.rows[k][p]);
                vec![
                    format!("{} to {}", cell("step") - cell("steps"), cell("step")),
                    number(cell("ranks")),
                    duration(cell("loop")),
                    format!("{:.3e}", cell("particle_steps") / cell("loop")),
                    format!("{:.0} MB", cell("memory_sum") / 1e6),
                    format!("{:.1}", cell("neighbours")),
                ]
            })
            .collect();
        let headings = ["steps", "ranks", "time", "particle-steps/s", "peak memory, all ranks", "neighbours"];
        out + &table(&headings, &launches)
    }

    /// The rates between outputs.
    fn rates(&self) -> String {
        let Some(rates) = self.performance.column("particle_steps_per_second") else { return String::new() };
        let rates: Vec<f64> = rates.into_iter().filter(|r| *r > 0.0).collect();
        let Some(&last) = rates.last() else { return String::new() };
        let low = rates.iter().copied().fold(f64::INFINITY, f64::min);
        let high = rates.iter().copied().fold(0.0, f64::max);
        let rows = [
            ("particle-steps per second, least and most", format!("{low:.3e} to {high:.3e}")),
            ("particle-steps per second, the last", format!("{last:.3e}")),
            ("largest work of a rank over the mean", number(self.imbalance().unwrap_or(f64::NAN))),
        ];
        let rows: Vec<Vec<String>> = rows.into_iter().map(|(name, value)| vec![name.into(), value]).collect();
        format!("<h3>Rates</h3>\n{}", table(&[], &rows))
    }
}

fn row(e: &Event) -> Vec<String> {
    let job = e.job.iter().map(String::as_str);
    let more: Vec<&str> = job.chain([e.what.as_str()]).filter(|t| !t.is_empty()).collect();
    vec![e.event.clone(), e.at.clone(), e.step.to_string(), number(e.time), e.ranks.to_string(), more.join("; ")]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logs_are_read_as_far_as_they_go() {
        let log = Log::parse("step [1],loop [s],lists [s],memory_largest [B]\n10,2.5,1.5,7\n20,x,1,7\n30,1.5,0.5\n");
        assert_eq!(log.rows, [[10.0, 2.5, 1.5, 7.0]]);
        assert_eq!((log.column("loop"), log.column("none")), (Some(vec![2.5]), None));
        let course = Course { events: Vec::new(), progress: None, phases: log, performance: Log::parse("") };
        let page = course.page();
        assert!(page.contains("2.5 s in the loop") && page.contains("60.0 %"), "{page}");
        assert!(!page.contains("memory_largest") && course.imbalance().is_none());
        let nothing =
            Course { events: Vec::new(), progress: None, phases: Log::default(), performance: Log::default() };
        assert!(nothing.page().contains("no logs"));
    }
}
