//! `navfuse completions`.

use crate::error::{CommandError, Result};
use crate::output;
use clap::{Args, Command, ValueEnum};
use clap_complete::{Generator, Shell};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `completions`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse completions bash > ~/.local/share/bash-completion/completions/navfuse
  navfuse completions zsh > ~/.zfunc/_navfuse
  navfuse completions fish > ~/.config/fish/completions/navfuse.fish
  navfuse completions man --out ~/.local/share/man/man1 && man navfuse-run")]
pub struct Completions {
    /// The shell, or `man` for the manual pages
    #[arg(value_enum)]
    pub shell: Target,
    /// Folder for the manual pages, one for each command [default: the page of navfuse alone, on
    /// standard output]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// A shell, or the manual pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// GNU Bourne-again shell
    Bash,
    /// Z shell
    Zsh,
    /// Friendly interactive shell
    Fish,
    /// PowerShell
    Powershell,
    /// Elvish
    Elvish,
    /// Manual pages (roff)
    Man,
}

impl Target {
    fn shell(self) -> Option<Shell> {
        match self {
            Self::Bash => Some(Shell::Bash),
            Self::Zsh => Some(Shell::Zsh),
            Self::Fish => Some(Shell::Fish),
            Self::Powershell => Some(Shell::PowerShell),
            Self::Elvish => Some(Shell::Elvish),
            Self::Man => None,
        }
    }
}

/// Writes the manual pages of a command and of its subcommands.
fn pages(command: Command, folder: &Path) -> Result<()> {
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
        pages(sub.clone(), folder)?;
    }
    let page = clap_mangen::Man::new(command);
    let (path, mut text) = (folder.join(page.get_filename()), Vec::new());
    page.render(&mut text).map_err(CommandError::rendering)?;
    output::write(&path, &String::from_utf8_lossy(&text))
}

/// Prints the completions of a shell, or writes the manual pages.
pub fn completions(mut command: Command, arguments: &Completions) -> Result<ExitCode> {
    let mut text = Vec::new();
    match (arguments.shell.shell(), &arguments.out) {
        (Some(_), Some(out)) => {
            let message = "only manual pages go to a folder; write completions to a file with `>`";
            return Err(CommandError::argument(format!("--out {}", out.display()), message));
        }
        (Some(shell), None) => {
            command.set_bin_name("navfuse");
            command.build();
            shell.try_generate(&command, &mut text).map_err(CommandError::rendering)?;
        }
        (None, Some(out)) => {
            command = command.disable_help_subcommand(true);
            command.build();
            pages(command, out)?;
        }
        (None, None) => {
            clap_mangen::Man::new(command).render(&mut text).map_err(CommandError::rendering)?;
        }
    }
    output::raw(&String::from_utf8_lossy(&text));
    Ok(ExitCode::SUCCESS)
}
