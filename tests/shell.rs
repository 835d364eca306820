//! `completions` and `man`: what shells and manuals make of the commands.

mod folder;

use folder::{Folder, text};
use std::process::{Command, Stdio};

fn folder() -> Folder {
    Folder::with("", "")
}

/// Whether a program is there; says so where it is not.
fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
    if found.is_err() {
        eprintln!("skipped: {program} is not on the PATH");
    }
    found.is_ok()
}

/// The commands that `--help` lists.
fn commands(f: &Folder) -> Vec<String> {
    let help = f.success("--help");
    let list = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap().to_owned();
    let names = list.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names: Vec<String> = names.map(|line| line.split_whitespace().next().unwrap().to_owned()).collect();
    assert!(names.len() > 15 && names.contains(&"help".to_owned()), "{names:?}");
    names.into_iter().filter(|name| name != "help").collect()
}

#[test]
fn every_shell_has_completions_of_every_command() {
    let f = folder();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = f.success(&format!("completions {shell}"));
        for name in commands(&f) {
            assert!(script.contains(&name), "{shell}: {name}");
        }
        // What the shell itself says of it, where it is there.
        if ["bash", "zsh", "fish"].contains(&shell) && has(shell) {
            std::fs::write(f.at(shell), script).unwrap();
            let output = Command::new(shell).args(["-n", shell]).current_dir(f.0.path()).output().unwrap();
            assert!(output.status.success() && output.stderr.is_empty(), "{shell}: {}", text(&output.stderr));
        }
    }
    let message = f.refusal("completions tcsh");
    assert!(message.contains("tcsh") && message.contains("bash"), "{message}");
}

/// What bash completes of a line; its last word is the one that is being typed.
fn completed(f: &Folder, words: &[&str]) -> Vec<String> {
    std::fs::write(f.at("reprobe.bash"), f.success("completions bash")).unwrap();
    let (last, before) = (words[words.len() - 1], words[words.len() - 2]);
    let line = words.iter().map(|w| format!("'{w}'")).collect::<Vec<_>>().join(" ");
    let script = format!(
        "set -e; source ./reprobe.bash; COMP_WORDS=({line}); COMP_CWORD={}; _reprobe reprobe '{last}' '{before}' || true; printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        words.len() - 1
    );
    let output = Command::new("bash").args(["--norc", "-c", &script]).current_dir(f.0.path()).output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", text(&output.stderr));
    text(&output.stdout).split_whitespace().map(str::to_owned).collect()
}

#[test]
fn bash_completes_commands_and_options() {
    if !has("bash") {
        return;
    }
    let f = folder();
    assert_eq!(completed(&f, &["reprobe", "ren"]), ["render-path"]);
    assert_eq!(completed(&f, &["reprobe", "vi"]), ["view", "video"]);
    assert_eq!(completed(&f, &["reprobe", "view", "a.exr", "--ex"]), ["--exposure"]);
    assert!(completed(&f, &["reprobe", "completions", ""]).contains(&"fish".to_owned()));
}

#[test]
fn every_command_has_a_page_of_the_manual() {
    let f = folder();
    let said = f.success("man -o man");
    assert!(said.contains("pages"), "{said}");
    let mut expected: Vec<String> = commands(&f).iter().map(|name| format!("reprobe-{name}.1")).collect();
    expected.push("reprobe.1".into());
    expected.sort();
    let mut found: Vec<String> =
        std::fs::read_dir(f.at("man")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    found.sort();
    assert_eq!(found, expected);
    for name in &found {
        let page = std::fs::read_to_string(f.at("man").join(name)).unwrap();
        let title = page.lines().find(|line| line.starts_with(".TH ")).unwrap_or_default();
        let expected =
            format!(".TH {} 1 \"\" \"reprobe {}\" \"reprobe\"", name.trim_end_matches(".1"), env!("CARGO_PKG_VERSION"));
        assert_eq!(title, expected, "{name}");
        let sections: Vec<&str> =
            page.lines().filter_map(|line| line.strip_prefix(".SH ")).map(|s| s.trim_matches('"')).collect();
        let wanted: &[&str] = match name.as_str() {
            "reprobe.1" => &["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "SUBCOMMANDS"],
            _ => &["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXAMPLES", "SEE ALSO"],
        };
        for section in wanted {
            assert!(sections.contains(section), "{name}: {section} is not in {sections:?}");
        }
        if has("mandoc") {
            let output =
                Command::new("mandoc").args(["-T", "lint", "-W", "error", name]).current_dir(f.at("man")).output().unwrap();
            assert!(output.status.success(), "{name}: {}", text(&output.stdout));
        }
    }
    let page = std::fs::read_to_string(f.at("man/reprobe-view.1")).unwrap();
    assert!(page.contains("\\-\\-exposure") && page.contains(".nf\nreprobe view out/frames/0003.exr \\-o frame.png\n"), "{page}");
    assert!(!page.contains("unit\\-scale"), "an option that does nothing for a command stays out of its page");
}

#[test]
fn pages_replace_our_pages_alone() {
    let f = folder();
    f.success("man -o man");
    let before = std::fs::read(f.at("man/reprobe-run.1")).unwrap();
    f.success("man -o man");
    std::fs::write(f.at("man/reprobe-run.1"), ".TH mine 1\n").unwrap();
    std::fs::remove_file(f.at("man/reprobe-view.1")).unwrap();
    let message = f.refusal("man -o man");
    assert!(message.contains("reprobe-run.1: was not written by reprobe"), "{message}");
    assert_eq!(std::fs::read_to_string(f.at("man/reprobe-run.1")).unwrap(), ".TH mine 1\n");
    assert!(!f.at("man/reprobe-view.1").exists(), "nothing is written where one of them is not ours");
    std::fs::remove_file(f.at("man/reprobe-run.1")).unwrap();
    f.success("man -o man");
    assert_eq!(std::fs::read(f.at("man/reprobe-run.1")).unwrap(), before);
    std::fs::write(f.at("file"), "").unwrap();
    assert!(f.refusal("man -o file").contains("file"));
}
