//! `reprobe man`.

use anyhow::{Context, ensure};
use clap_mangen::Man;
use reprobe::io::atomic;
use reprobe::plan::Outcome;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Write the manual, a page a command
///
/// reprobe.1, reprobe-run.1 and so on, of what --help says.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe man -o ~/.local/share/man/man1
  reprobe man -o man/     and then man -l man/reprobe-run.1")]
pub struct Args {
    /// Folder for the pages
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// How a page of ours begins: a comment.
const OURS: &str = ".\\\" Written by reprobe man.\n";

pub fn run(args: &Args, cli: clap::Command) -> anyhow::Result<Outcome> {
    let mut cli = cli.disable_help_subcommand(true);
    cli.build();
    let pages: Vec<(PathBuf, String)> = std::iter::once(&cli)
        .chain(cli.get_subcommands())
        .map(|command| page(command).map(|(name, text)| (args.output.join(name), text)))
        .collect::<Result<_, _>>()?;
    // All are looked at before the first is written.
    for (path, _) in &pages {
        let is_ours = !path.exists() || std::fs::read(path).is_ok_and(|old| old.starts_with(OURS.as_bytes()));
        ensure!(is_ours, "{}: was not written by reprobe: remove it, or give the pages another folder", path.display());
    }
    ensure!(!args.output.is_file(), "{}: is a file: expected a folder for the pages", args.output.display());
    for (path, text) in &pages {
        atomic::write(path, text.as_bytes())?;
    }
    let first = pages.first().map_or(Path::new(""), |(path, _)| path);
    let summary = format!("{}: {} pages; man -l {}", args.output.display(), pages.len(), first.display());
    let names: Vec<&Path> = pages.iter().map(|(path, _)| path.as_path()).collect();
    Ok(Outcome { summary, figures: json!({ "output": args.output, "pages": names }), ..Outcome::default() })
}

/// A command's page: its name and its text.
fn page(command: &clap::Command) -> anyhow::Result<(String, String)> {
    let man = Man::new(command.clone());
    let name = command.get_display_name().unwrap_or_else(|| command.get_name());
    // Not the crate's own title: an empty date goes missing in it, and what follows would take its place.
    let title = format!("{OURS}.TH {name} 1 \"\" \"reprobe {}\" \"reprobe\"\n", env!("CARGO_PKG_VERSION"));
    let mut text = title.into_bytes();
    man.render_name_section(&mut text)?;
    man.render_synopsis_section(&mut text)?;
    man.render_description_section(&mut text)?;
    man.render_options_section(&mut text)?;
    let has_commands = command.has_subcommands();
    if has_commands {
        man.render_subcommands_section(&mut text)?;
    }
    let mut text = String::from_utf8(text).context("a page's text")?;
    let after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    text += &sections(&after);
    if !has_commands {
        text += ".SH \"SEE ALSO\"\nreprobe(1)\n";
    }
    Ok((man.get_filename(), text))
}

/// What stands below the options: a line that ends in a colon begins a section, and indented lines stay as they are.
fn sections(after_help: &str) -> String {
    let mut text = String::new();
    for (i, block) in after_help.split("\n\n").filter(|block| !block.is_empty()).enumerate() {
        let (first, rest) = block.split_once('\n').unwrap_or((block, ""));
        match first.strip_suffix(':').filter(|title| title.len() < 30) {
            Some(title) => text += &format!(".SH {}\n", quoted(&title.to_uppercase())),
            None if i == 0 => text += &format!(".SH NOTES\n{}\n", escaped(first)),
            None => text += &format!(".PP\n{}\n", escaped(first)),
        }
        let mut lines = rest.lines().peekable();
        while let Some(line) = lines.next() {
            let Some(example) = line.strip_prefix("  ") else {
                text += &format!(".PP\n{}\n", escaped(line));
                continue;
            };
            text += &format!(".nf\n{}\n", escaped(example));
            while let Some(example) = lines.next_if(|line| line.starts_with("  ")) {
                text += &format!("{}\n", escaped(&example[2..]));
            }
            text += ".fi\n";
        }
    }
    text
}

fn quoted(title: &str) -> String {
    format!("\"{}\"", escaped(title))
}

/// Text that roff takes for text.
fn escaped(line: &str) -> String {
    let line = line.replace('\\', "\\e").replace('-', "\\-");
    if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_stand_line_by_line_and_prose_flows() {
        let help = "Examples:\n  a -o b \\\n    'c'\n  d\n\nA lamp, as the file says it:\n  {\"x\": 1}\n.dot";
        let expected = ".SH \"EXAMPLES\"\n.nf\na \\-o b \\e\n  'c'\nd\n.fi\n.SH \"A LAMP, AS THE FILE SAYS IT\"\n.nf\n{\"x\": 1}\n.fi\n.PP\n\\&.dot\n";
        assert_eq!(sections(help), expected);
        assert_eq!(sections("Exit codes: 0."), ".SH NOTES\nExit codes: 0.\n");
    }
}
