//! `reprobe completions`.

use clap_complete::Shell;
use reprobe::plan::Outcome;
use serde_json::json;

/// Print what makes a shell complete commands and options
#[derive(clap::Args)]
#[command(after_help = "Examples:
  reprobe completions bash > ~/.local/share/bash-completion/completions/reprobe
  reprobe completions zsh > ~/.zfunc/_reprobe     where fpath has ~/.zfunc
  reprobe completions fish > ~/.config/fish/completions/reprobe.fish")]
pub struct Args {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

pub fn run(args: &Args, mut cli: clap::Command) -> anyhow::Result<Outcome> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut cli, "reprobe", &mut script);
    let script = String::from_utf8(script)?;
    let figures = json!({ "shell": args.shell.to_string(), "script": script });
    Ok(Outcome { summary: script, figures, ..Outcome::default() })
}
