//! Options of a stage: one list says what a stage takes, how it is written on a command line, and how an option is set by its name.

use crate::{Error, Result};
use std::ffi::OsString;
use std::path::PathBuf;

/// Width and height, pixels or texels: `WIDTHxHEIGHT`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size(pub [u32; 2]);

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}x{}", self.0[0], self.0[1])
    }
}

impl std::str::FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        const MOST: u32 = 16384;
        let expected = || format!("\"{text}\": expected WIDTHxHEIGHT, each from 1 to {MOST}, like 960x540");
        let (w, h) = text.split_once('x').ok_or_else(expected)?;
        let side = |s: &str| s.parse().ok().filter(|n| (1..=MOST).contains(n)).ok_or_else(expected);
        Ok(Self([side(w)?, side(h)?]))
    }
}

/// A list of numbers with something between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct List<T, const N: usize, const BETWEEN: char>(pub [T; N]);

impl<T: std::fmt::Display, const N: usize, const BETWEEN: char> std::fmt::Display for List<T, N, BETWEEN> {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let texts: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        f.write_str(&texts.join(&BETWEEN.to_string()))
    }
}

impl<T: std::str::FromStr, const N: usize, const BETWEEN: char> std::str::FromStr for List<T, N, BETWEEN> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts: Option<Vec<T>> = text.split(BETWEEN).map(|s| s.trim().parse().ok()).collect();
        let list = parts.and_then(|parts| parts.try_into().ok());
        list.map(Self).ok_or_else(|| format!("\"{text}\": expected {N} numbers with {BETWEEN:?} between them"))
    }
}

/// What an option holds, written and read as on a command line.
pub trait OptionValue {
    /// Adds the option to a command, if it is given.
    fn write(&self, option: &str, to: &mut Vec<OsString>);
    /// Gives it a value; `None` where it stands alone.
    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()>;
}

fn wanted<'a>(option: &str, value: Option<&'a str>) -> Result<&'a str> {
    value.ok_or_else(|| Error::Request(format!("{option}: expected a value, {option}=VALUE")))
}

impl OptionValue for bool {
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        if *self {
            to.push(option.into());
        }
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        if let Some(value) = value {
            return Err(Error::Request(format!("{option}={value}: expected no value")));
        }
        *self = true;
        Ok(())
    }
}

impl OptionValue for PathBuf {
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        to.extend([option.into(), self.into()]);
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        *self = wanted(option, value)?.into();
        Ok(())
    }
}

impl OptionValue for Option<PathBuf> {
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        if let Some(path) = self {
            path.write(option, to);
        }
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        *self = Some(wanted(option, value)?.into());
        Ok(())
    }
}

/// A value that is written and parsed as text.
pub trait Text: std::fmt::Display + std::str::FromStr {}

macro_rules! text {
    ($($type:ty),+ $(,)?) => { $(impl $crate::plan::option::Text for $type {})+ };
}
pub(crate) use text;
text!(u32, u64, f32, f64, String, Size, crate::io::jobs::Shard);
impl<T: Text, const N: usize, const BETWEEN: char> Text for List<T, N, BETWEEN> {}

impl<T: Text> OptionValue for Option<T>
where
    T::Err: std::fmt::Display,
{
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        if let Some(value) = self {
            to.extend([option.into(), value.to_string().into()]);
        }
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        let text = wanted(option, value)?;
        *self = Some(text.parse().map_err(|e| Error::Request(format!("{option}={text}: {e}")))?);
        Ok(())
    }
}

/// Its value may be left out.
impl<T: Text> OptionValue for Option<Option<T>>
where
    T::Err: std::fmt::Display,
{
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        match self {
            None => {}
            Some(None) => to.push(option.into()),
            Some(value) => value.write(option, to),
        }
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        let mut inner = None;
        if value.is_some() {
            OptionValue::set(&mut inner, option, value)?;
        }
        *self = Some(inner);
        Ok(())
    }
}

/// May be given again and again.
impl OptionValue for Vec<String> {
    fn write(&self, option: &str, to: &mut Vec<OsString>) {
        for value in self {
            to.extend([option.into(), value.into()]);
        }
    }

    fn set(&mut self, option: &str, value: Option<&str>) -> Result<()> {
        self.push(wanted(option, value)?.into());
        Ok(())
    }
}

/// Declares a stage's struct: any number of files, where it takes such, its other inputs in the order of the command line, and its options
/// by name.
macro_rules! stage {
    (
        $(#[$about:meta])* $name:ident $command:literal
        $([ $(#[$files_about:meta])* $files:ident ])?
        { $($(#[$input_about:meta])* $input:ident),* $(,)? }
        { $($(#[$option_about:meta])* $option:literal $field:ident: $type:ty),* $(,)? }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Default, PartialEq)]
        pub struct $name {
            $($(#[$files_about])* pub $files: Vec<std::path::PathBuf>,)?
            $($(#[$input_about])* pub $input: std::path::PathBuf,)*
            $($(#[$option_about])* pub $field: $type,)*
        }

        impl $name {
            /// The subcommand.
            pub const COMMAND: &'static str = $command;
            /// Names of its options.
            pub const OPTIONS: &'static [&'static str] = &[$($option),*];

            /// Inputs and options as on a command line, after the subcommand.
            pub fn arguments(&self) -> Vec<std::ffi::OsString> {
                let mut list: Vec<std::ffi::OsString> = vec![$(self.$input.clone().into()),*];
                $(list.extend(self.$files.iter().map(|file| file.clone().into()));)?
                $($crate::plan::option::OptionValue::write(&self.$field, $option, &mut list);)*
                list
            }

            /// Gives an option a value, by its name.
            pub fn set(&mut self, option: &str, value: Option<&str>) -> $crate::Result<()> {
                match option {
                    $($option => $crate::plan::option::OptionValue::set(&mut self.$field, option, value),)*
                    _ => Err($crate::Error::Request(format!(
                        "{}: no option {option}; there are {}", Self::COMMAND, Self::OPTIONS.join(", ")
                    ))),
                }
            }
        }
    };
}
pub(crate) use stage;

#[cfg(test)]
mod tests {
    use super::*;

    stage! {
        /// For these tests.
        Example "example" { /// In.
            scene }
        { /// Out.
            "--output" output: PathBuf, /// Samples.
            "--spp" spp: Option<u32>, /// A choice.
            "--paper" paper: bool, /// Parameters.
            "--set" set: Vec<String>, /// A value or none.
            "--by" by: Option<Option<u32>> }
    }

    #[test]
    fn options_are_set_by_name_and_written_as_they_were_given() {
        let mut e = Example { scene: "s.xml".into(), output: "out".into(), ..Example::default() };
        for (option, value) in
            [("--spp", Some("8")), ("--paper", None), ("--set", Some("a=1")), ("--set", Some("b=2")), ("--spp", Some("16"))]
        {
            e.set(option, value).unwrap();
        }
        let words: Vec<String> = e.arguments().into_iter().map(|a| a.into_string().unwrap()).collect();
        assert_eq!(words.join(" "), "s.xml --output out --spp 16 --paper --set a=1 --set b=2");
        for (value, words) in [(None, &["--by"][..]), (Some("7"), &["--by", "7"])] {
            e.set("--by", value).unwrap();
            assert!(e.arguments().iter().rev().zip(words.iter().rev()).all(|(a, b)| a == b), "{:?}", e.arguments());
        }
    }

    #[test]
    fn wrong_options_are_refused() {
        let mut e = Example::default();
        for (option, value, expected) in [
            ("--spp", Some("many"), "--spp=many: invalid digit"),
            ("--spp", None, "--spp: expected a value"),
            ("--paper", Some("1"), "--paper=1: expected no value"),
            ("--by", Some("x"), "--by=x: invalid digit"),
            ("--magic", None, "example: no option --magic; there are --output, --spp, --paper, --set, --by"),
        ] {
            let message = e.set(option, value).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn sizes_and_lists_parse_and_print() {
        assert_eq!("960x540".parse::<Size>().unwrap().to_string(), "960x540");
        assert_eq!("1,-2,0.5".parse::<List<f32, 3, ','>>().unwrap().to_string(), "1,-2,0.5");
        for bad in ["", "x", "0x5", "20000x1", "1x2x3"] {
            assert!(bad.parse::<Size>().is_err(), "{bad}");
        }
        assert!("1,2".parse::<List<f32, 3, ','>>().is_err());
    }
}
