//! The command line.

use crate::{
    basal::Level,
    failure_plane::FailureTime,
    field::{self, Field},
    flow::StaticSpeed,
};
use clap::{Parser, ValueHint};
use formats::units::{self, Dimension};
use std::path::PathBuf;

/// Evaluate a run: deposit, run-out, layers, failure plane, stresses, energies, and pictures of them.
///
/// Works on the snapshots that are there, also while the run goes on; every call evaluates all of them anew.
/// Works on several snapshots at a time in threads; under mpirun one rank works and the others wait.
#[derive(Clone, Debug, Parser)]
#[command(name = "sph-post", version, after_help = EXIT_CODES)]
pub struct Arguments {
    /// The run folder
    #[arg(value_hint = ValueHint::DirPath)]
    pub run: PathBuf,
    /// Height above the floor at which basal stresses are taken: smoothing lengths, or a length as "12 mm"
    #[arg(long, value_name = "HEIGHT", default_value = "3 h", value_parser = Level::parse)]
    pub basal_height: Level,
    /// Number of layers the particles are marked by, horizontal and vertical: 1 to 20
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=20))]
    pub layers: u8,
    /// Speed below which material counts as static: a part of sqrt(g H0), or a velocity as "2 cm/s"
    #[arg(long, value_name = "SPEED", default_value = "1 %", value_parser = StaticSpeed::parse)]
    pub static_speed: StaticSpeed,
    /// Time at which the failure plane is taken, from the nearest snapshot: multiples of T = sqrt(H0/g), or a time as "40 ms"
    ///
    /// The default is the 40 ms of Szewc (2017) in units of the T of the column there, 74 ms.
    #[arg(long, value_name = "TIME", default_value = "0.54 T", value_parser = FailureTime::parse)]
    pub failure_time: FailureTime,
    /// Draw the particles coloured by this field, too, as particles-FIELD; may be given several times
    #[arg(long, value_name = "FIELD", value_parser = field::parse)]
    pub color: Vec<&'static Field>,
    /// Diameter of the grains for the inertial number, as "2 mm"; without it that of the law, where it has one
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub grain_diameter: Option<f64>,
    /// Draw these measured curves, too: CSV with the columns curve,x_m,y_m; the curves are `free_surface`, of the final
    /// deposit, and `failure_line`
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub reference: Option<PathBuf>,
    /// Evaluate as many snapshots at a time, as far as they fit into memory; the processors this process may use where left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Print paths, warnings and errors only
    #[arg(short, long)]
    pub quiet: bool,
}

/// A length above 0, m.
fn length(text: &str) -> Result<f64, String> {
    match units::parse(text, Dimension::Length)? {
        value if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("`{text}` is no diameter: give a length above 0 as \"2 mm\"")),
    }
}

const EXIT_CODES: &str = "\
Exit codes:
   0  post/ is written; the paths are on standard output
   2  the command line, or the scene in the run folder, is wrong
  65  no run, or one of its files is missing, damaged, or of another scene
  70  the program failed: a bug
  73  post/ cannot be written";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
        let arguments = Arguments::try_parse_from(["sph-post", "run/"]).unwrap();
        assert_eq!(arguments.basal_height, Level::Smoothing(3.0));
        assert_eq!(arguments.layers, 5);
        assert_eq!(arguments.static_speed, StaticSpeed::Part(0.01));
        assert_eq!(arguments.failure_time, FailureTime::Scaled(0.54));
        let more = ["--color", "pressure", "--color=density", "--grain-diameter", "2 mm"];
        let arguments = Arguments::try_parse_from(["sph-post", "run/"].into_iter().chain(more)).unwrap();
        assert_eq!(arguments.color.iter().map(|f| f.name).collect::<Vec<_>>(), ["pressure", "density"]);
        assert_eq!(arguments.grain_diameter, Some(0.002));
        for (option, wrong) in [
            ("basal-height", "3 kg"),
            ("layers", "0"),
            ("layers", "21"),
            ("static-speed", "1"),
            ("failure-time", "40"),
            ("color", "hue"),
            ("grain-diameter", "0 mm"),
        ] {
            let option = format!("--{option}");
            assert!(Arguments::try_parse_from(["sph-post", "run/", &option, wrong]).is_err(), "{option} {wrong}");
        }
    }
}
