//! What every program answers about itself, before it looks at anything else: completions for shells, and its manual page.

use crate::news::{self, Log};
use clap::{Arg, ArgAction, Command, CommandFactory, FromArgMatches, value_parser};
use clap_complete::Shell;
use std::ffi::OsString;

/// What the command line asks for.
#[derive(Clone, Debug)]
pub enum Asked<P> {
    /// The program's own work.
    Work(P),
    /// A text about the program, for standard output.
    Text(Vec<u8>),
}

/// The command line of `P`, with `--completions`, `--man` and `--log` besides.
pub fn command<P: CommandFactory>() -> Command {
    let completions = Arg::new("completions").long("completions").value_name("SHELL").exclusive(true);
    let man = Arg::new("man").long("man").action(ArgAction::SetTrue).exclusive(true);
    let log = Arg::new("log").long("log").value_name("FORM").value_parser(value_parser!(Log)).default_value("text");
    P::command()
        .arg(completions.value_parser(value_parser!(Shell)).help("Print completions for a shell, and do nothing else"))
        .arg(log.help("What is said on standard error: lines for people, or a JSON object a line"))
        .arg(man.help("Print the manual page (`--man | man -l -`), and do nothing else"))
}

/// Reads a command line.
///
/// # Errors
/// Those of clap: also help and version, which are printed like errors.
pub fn parse<P: CommandFactory + FromArgMatches>(
    words: impl IntoIterator<Item = OsString>,
) -> Result<Asked<P>, clap::Error> {
    let mut command = command::<P>();
    let matches = command.try_get_matches_from_mut(words)?;
    if let Some(shell) = matches.get_one::<Shell>("completions") {
        let (mut text, name) = (Vec::new(), command.get_name().to_owned());
        clap_complete::generate(*shell, &mut command, name, &mut text);
        return Ok(Asked::Text(text));
    }
    if matches.get_flag("man") {
        let mut text = Vec::new();
        clap_mangen::Man::new(command).render(&mut text)?;
        return Ok(Asked::Text(text));
    }
    news::speak(command.get_name(), matches.get_one("log").copied().unwrap_or_default());
    P::from_arg_matches(&matches).map(Asked::Work).map_err(|error| error.format(&mut command))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    /// Works.
    #[derive(Debug, Parser)]
    #[command(name = "worker")]
    struct Arguments {
        /// The folder
        folder: String,
        /// Faster
        #[arg(long)]
        fast: bool,
    }

    fn asked(words: &[&str]) -> Result<Asked<Arguments>, clap::Error> {
        parse(["worker"].iter().chain(words).map(OsString::from))
    }

    fn text(words: &[&str]) -> String {
        match asked(words).unwrap() {
            Asked::Text(text) => String::from_utf8(text).unwrap(),
            Asked::Work(work) => panic!("{work:?}"),
        }
    }

    #[test]
    fn texts_need_no_folder_and_go_with_nothing_else() {
        command::<Arguments>().debug_assert();
        for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
            let text = text(&["--completions", shell]);
            assert!(
                text.contains("worker") && text.contains("fast") && text.contains("completions"),
                "{shell}: {text}"
            );
        }
        let page = text(&["--man"]);
        assert!(page.contains(".TH worker 1") && page.contains("\\-\\-fast") && page.contains("Faster"), "{page}");
        for wrong in [&["--man", "folder"][..], &["--completions", "csh"], &["--completions", "bash", "--fast"], &[]] {
            assert!(asked(wrong).unwrap_err().use_stderr(), "{wrong:?}");
        }
        match asked(&["folder", "--fast"]).unwrap() {
            Asked::Work(work) => assert!(work.fast && work.folder == "folder"),
            Asked::Text(_) => panic!("no text was asked for"),
        }
        assert!(!asked(&["--help"]).unwrap_err().use_stderr());
    }
}
