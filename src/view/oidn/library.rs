//! The library, and the few of its functions that are called.
//!
//! In: pixels as its images have them. Out: a filtered image; the same on any number of threads.

use super::Quality;
use super::places::{DIR, FILE, places};
use crate::{Error, Result};
use glam::Vec3;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A device or a filter of the library's.
type Handle = *mut c_void;
/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// The library, loaded.
pub struct Oidn {
    /// Major, minor and patch: other versions have other networks.
    pub version: [u32; 3],
    /// Its file, or the name that the system knows it by.
    pub path: PathBuf,
    functions: Functions,
    /// Keeps what `functions` point to.
    _library: Library,
}

/// Declares the functions with the library's names for them.
macro_rules! functions {
    ($($field:ident = $symbol:literal: fn($($argument:ty),*) $(-> $result:ty)?;)+) => {
        struct Functions { $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)+ }

        impl Functions {
            /// # Safety
            /// `library` is Open Image Denoise of version 2, and outlives the result.
            unsafe fn of(library: &Library) -> std::result::Result<Self, libloading::Error> {
                // SAFETY: the types are those of the header `oidn.h` of version 2, which the caller says this library has.
                unsafe { Ok(Self { $($field: *library.get($symbol)?,)+ }) }
            }
        }
    };
}

functions! {
    new_device = b"oidnNewDevice\0": fn(c_int) -> Handle;
    set_device_int = b"oidnSetDeviceInt\0": fn(Handle, *const c_char, c_int);
    device_int = b"oidnGetDeviceInt\0": fn(Handle, *const c_char) -> c_int;
    commit_device = b"oidnCommitDevice\0": fn(Handle);
    device_error = b"oidnGetDeviceError\0": fn(Handle, *mut *const c_char) -> c_int;
    release_device = b"oidnReleaseDevice\0": fn(Handle);
    new_filter = b"oidnNewFilter\0": fn(Handle, *const c_char) -> Handle;
    set_image = b"oidnSetSharedFilterImage\0": fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_int = b"oidnSetFilterInt\0": fn(Handle, *const c_char, c_int);
    set_bool = b"oidnSetFilterBool\0": fn(Handle, *const c_char, bool);
    commit_filter = b"oidnCommitFilter\0": fn(Handle);
    execute_filter = b"oidnExecuteFilter\0": fn(Handle);
    release_filter = b"oidnReleaseFilter\0": fn(Handle);
}

impl Quality {
    /// `OIDN_QUALITY_*`.
    fn number(self) -> c_int {
        match self {
            Self::Fast => 4,
            Self::Balanced => 5,
            Self::High => 6,
        }
    }
}

impl Oidn {
    /// The library, where this machine has it: looked for once a process.
    ///
    /// # Errors
    /// In one line, what was looked for and how to get it.
    pub fn found() -> Result<&'static Self> {
        static FOUND: OnceLock<std::result::Result<Oidn, String>> = OnceLock::new();
        FOUND.get_or_init(find).as_ref().map_err(|why| Error::Request(why.clone()))
    }

    fn load(path: &Path) -> std::result::Result<Self, String> {
        let failed = |e: libloading::Error| format!("{}: {e}", path.display());
        // SAFETY: loading runs the library's initialisers. The file has the name of Open Image Denoise 2, and lies where the system, pip or
        // the user has put it: it is trusted as any library that a program is linked to.
        let library = unsafe { Library::new(path) }.map_err(failed)?;
        // SAFETY: by its name it is version 2, and it is kept beside the functions.
        let functions = unsafe { Functions::of(&library) }.map_err(failed)?;
        let mut oidn = Self { version: [0; 3], path: path.into(), functions, _library: library };
        let device = Device::new(&oidn, 1).map_err(|e| format!("{}: {e}", path.display()))?;
        let version = device.int(c"version");
        drop(device);
        oidn.version = [version / 10000, version / 100 % 100, version % 100];
        Ok(oidn)
    }

    /// The output of the filter "RT" from these images, all of one size and `width` pixels wide, with these settings on, at a quality, on as
    /// many threads as the program has.
    pub fn filtered(&self, images: &[(&CStr, &[Vec3])], settings: &[&CStr], quality: Quality, width: usize) -> Result<Vec<Vec3>> {
        let pixels = images.first().map_or(0, |(_, pixels)| pixels.len());
        if pixels == 0 {
            return Ok(Vec::new());
        }
        assert!(width > 0 && pixels.is_multiple_of(width) && images.iter().all(|(_, other)| other.len() == pixels));
        let device = Device::new(self, rayon::current_num_threads())?;
        let mut output = vec![Vec3::ZERO; pixels];
        let filter = Filter::new(&device)?;
        for (name, pixels) in images {
            // SAFETY: the pixels are as many as was asserted, and borrowed until after the filter is released; the library reads inputs alone.
            unsafe { filter.set_image(name, pixels.as_ptr().cast_mut(), [width, pixels.len() / width]) };
        }
        // SAFETY: the same number of pixels, which nothing else reads or writes until the filter is released.
        unsafe { filter.set_image(c"output", output.as_mut_ptr(), [width, pixels / width]) };
        filter.run(settings, quality);
        drop(filter);
        device.check()?;
        Ok(output)
    }
}

fn find() -> std::result::Result<Oidn, String> {
    let mut failures = Vec::new();
    for place in places(&|name| std::env::var_os(name)) {
        match Oidn::load(&place) {
            Ok(oidn) => return Ok(oidn),
            // That the system does not know the name is no news.
            Err(_) if place == Path::new(FILE) => {}
            Err(why) => failures.push(why.replace('\n', " ")),
        }
    }
    let why = match (failures.is_empty(), std::env::var_os(DIR)) {
        (false, _) => failures.join("; "),
        (true, Some(folder)) => format!("{DIR}={}: no {FILE} in it or in its lib/", Path::new(&folder).display()),
        (true, None) => format!("no {FILE} on this system or among the packages of its Pythons"),
    };
    Err(format!(
        "Open Image Denoise is not found ({why}): `pip install pyoidn` brings it, or set {DIR} to the folder of a download from openimagedenoise.org"
    ))
}

/// A device, released in the end.
struct Device<'a> {
    of: &'a Functions,
    handle: Handle,
}

impl<'a> Device<'a> {
    fn new(oidn: &'a Oidn, threads: usize) -> Result<Self> {
        let of = &oidn.functions;
        // SAFETY: takes a number, and returns a device or null.
        let device = Self { of, handle: unsafe { (of.new_device)(CPU) } };
        if !device.handle.is_null() {
            let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
            // SAFETY: a live device that is not committed yet, and a name that ends in zero.
            unsafe { (of.set_device_int)(device.handle, c"numThreads".as_ptr(), threads) };
            // SAFETY: a live device.
            unsafe { (of.commit_device)(device.handle) };
        }
        device.check()?;
        Ok(device)
    }

    fn int(&self, name: &CStr) -> u32 {
        // SAFETY: a live device, as `new` has none else, and a name that ends in zero.
        u32::try_from(unsafe { (self.of.device_int)(self.handle, name.as_ptr()) }).unwrap_or(0)
    }

    /// The first error since the last call; of a device that could not be made, too.
    fn check(&self) -> Result<()> {
        let mut message: *const c_char = std::ptr::null();
        // SAFETY: null stands for this thread's errors without a device; the message is written to a pointer of ours.
        let code = unsafe { (self.of.device_error)(self.handle, &raw mut message) };
        if code == 0 && !self.handle.is_null() {
            return Ok(());
        }
        let message = match message.is_null() {
            true => format!("error {code}"),
            // SAFETY: the library's text ends in zero, and lives until the next error on this thread.
            false => unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned(),
        };
        Err(Error::Request(format!("Open Image Denoise: {message}")))
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: a live device, which nobody uses after this; its filters borrow it.
            unsafe { (self.of.release_device)(self.handle) };
        }
    }
}

/// A filter of the kind "RT", released in the end.
struct Filter<'a> {
    device: &'a Device<'a>,
    handle: Handle,
}

impl<'a> Filter<'a> {
    fn new(device: &'a Device) -> Result<Self> {
        // SAFETY: a live device, and a name that ends in zero.
        let handle = unsafe { (device.of.new_filter)(device.handle, c"RT".as_ptr()) };
        if handle.is_null() {
            device.check()?;
            return Err(Error::Request("Open Image Denoise: it has no filter \"RT\"".into()));
        }
        Ok(Self { device, handle })
    }

    /// # Safety
    /// `pixels` points to as many as `size` says, one after the other, for as long as the filter lives; those of "output" may be written to.
    unsafe fn set_image(&self, name: &CStr, pixels: *mut Vec3, [width, height]: [usize; 2]) {
        // SAFETY: a live filter; a Vec3 is three floats in a row, which is the format; strides of 0 stand for pixels without gaps.
        unsafe { (self.device.of.set_image)(self.handle, name.as_ptr(), pixels.cast(), FLOAT3, width, height, 0, 0, 0) };
    }

    fn run(&self, settings: &[&CStr], quality: Quality) {
        for name in settings {
            // SAFETY: a live filter, and a name that ends in zero.
            unsafe { (self.device.of.set_bool)(self.handle, name.as_ptr(), true) };
        }
        // SAFETY: the same; versions that know fewer qualities take theirs.
        unsafe { (self.device.of.set_int)(self.handle, c"quality".as_ptr(), quality.number()) };
        // SAFETY: a live filter, whose images live as long as it does, as `set_image` asks.
        unsafe { (self.device.of.commit_filter)(self.handle) };
        // SAFETY: the same; returns when the output is written.
        unsafe { (self.device.of.execute_filter)(self.handle) };
    }
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: a live filter, which nobody uses after this.
        unsafe { (self.device.of.release_filter)(self.handle) };
    }
}
