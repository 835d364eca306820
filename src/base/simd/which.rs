//! Which form of eight lanes runs: the machine's best, or the one that the environment asks for.

#[cfg(target_arch = "x86_64")]
use super::{Avx2, Avx512};
use super::{Portable, Simd};
use crate::{Error, Result};
use std::sync::OnceLock;

/// A form of [`Simd`] that the machine has.
#[derive(Clone, Copy)]
pub enum Lanes {
    /// AVX-512 F and VL.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// Nothing of that.
    Portable(Portable),
}

/// What can be done with any form.
pub trait Kernel {
    /// What comes of it.
    type Output;
    /// Does it. To be inlined always, with all that it calls for each lane: what is not is compiled without the machine's lanes.
    fn run<S: Simd>(self, s: S) -> Self::Output;
}

impl Lanes {
    /// The environment's variable that asks for one.
    pub const VARIABLE: &str = "REPROBE_SIMD";
    /// What it may say, best first.
    const NAMES: [&str; 3] = ["avx512", "avx2", "portable"];

    /// What the environment asks for, or the machine's best; the latter also where [`Self::asked`] has an error to tell.
    pub fn chosen() -> Self {
        static CHOSEN: OnceLock<Lanes> = OnceLock::new();
        *CHOSEN.get_or_init(|| Self::asked().unwrap_or_else(|_| Self::best()))
    }

    /// What the environment asks for, or the machine's best.
    ///
    /// # Errors
    /// A word that stands for none, or for one that the machine lacks.
    pub fn asked() -> Result<Self> {
        match std::env::var_os(Self::VARIABLE).filter(|word| !word.is_empty()) {
            Some(word) => Self::named(&word.to_string_lossy()),
            None => Ok(Self::best()),
        }
    }

    fn named(word: &str) -> Result<Self> {
        let allowed = Self::NAMES.join(", ");
        if !Self::NAMES.contains(&word) {
            return Err(Error::Request(format!("{}={word}: expected one of {allowed}", Self::VARIABLE)));
        }
        let all = Self::all();
        let has = || all.iter().map(|lanes| lanes.name()).collect::<Vec<_>>().join(", ");
        let found = all.iter().copied().find(|lanes| lanes.name() == word);
        found.ok_or_else(|| Error::Request(format!("{}={word}: this machine has {}", Self::VARIABLE, has())))
    }

    fn best() -> Self {
        Self::all().first().copied().unwrap_or(Self::Portable(Portable))
    }

    /// All that the machine has, best first.
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        #[cfg(target_arch = "x86_64")]
        {
            all.extend(Avx512::detect().map(Self::Avx512));
            all.extend(Avx2::detect().map(Self::Avx2));
        }
        all.push(Self::Portable(Portable));
        all
    }

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Self::NAMES[0],
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Self::NAMES[1],
            Self::Portable(_) => Self::NAMES[2],
        }
    }

    /// Runs a kernel in this form.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            // SAFETY: the machine has what the value stands for.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(s) => unsafe { with_avx512(s, kernel) },
            // SAFETY: likewise.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(s) => unsafe { with_avx2(s, kernel) },
            Self::Portable(s) => kernel.run(s),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx2<K: Kernel>(s: Avx2, kernel: K) -> K::Output {
    kernel.run(s)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,avx512f,avx512vl")]
fn with_avx512<K: Kernel>(s: Avx512, kernel: K) -> K::Output {
    kernel.run(s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_stands_for_a_form_or_is_an_error_that_says_what_does() {
        for lanes in Lanes::all() {
            assert_eq!(Lanes::named(lanes.name()).unwrap().name(), lanes.name());
        }
        let said = Lanes::named("sse9").err().unwrap().to_string();
        assert!(said.contains("REPROBE_SIMD=sse9: expected one of avx512, avx2, portable"), "{said}");
        let missing = Lanes::NAMES.into_iter().find(|name| Lanes::all().iter().all(|lanes| lanes.name() != *name));
        if let Some(name) = missing {
            let said = Lanes::named(name).err().unwrap().to_string();
            assert!(said.contains("this machine has") && said.contains("portable"), "{said}");
        }
    }
}
