//! What a kernel is: declared once, beside what binds its buffers. Pipelines and layouts are made from it, and the contract's test holds the
//! shader's text against it.

/// How a kernel uses a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Parameters; they are no storage buffer.
    Uniform,
    /// A storage buffer, read alone.
    Read,
    /// A storage buffer.
    ReadWrite,
}

/// How a `#[repr(C)]` type lies in memory, as a shader's struct of this name must: see [`layout!`].
#[cfg_attr(not(test), allow(dead_code, reason = "read by the contract's test"))]
pub(crate) struct StructLayout {
    pub(crate) name: &'static str,
    pub(crate) size: usize,
    /// Names and offsets, padding left out.
    pub(crate) fields: &'static [(&'static str, usize)],
}

/// The [`StructLayout`] of a type, as the shader's struct of the given name; fields of padding need not be named.
macro_rules! layout {
    ($rust:ty as $name:literal { $($field:ident),+ $(,)? }) => {
        $crate::gpu::spec::StructLayout {
            name: $name,
            size: size_of::<$rust>(),
            fields: &[$((stringify!($field), std::mem::offset_of!($rust, $field))),+],
        }
    };
}
pub(crate) use layout;

/// A kernel.
#[cfg_attr(not(test), allow(dead_code, reason = "twin and structs are read by the contract's test"))]
pub(crate) struct KernelSpec {
    /// Its file in `shaders/`, whose stem is its entry point.
    pub(crate) file: &'static str,
    /// The function on the CPU whose work it does, as its file's first line has it.
    pub(crate) twin: &'static str,
    /// Edges of a workgroup.
    pub(crate) workgroup: [u32; 2],
    /// Whether group 1 is the scene.
    pub(crate) scene: bool,
    /// Group 0: names and accesses, numbered from 0.
    pub(crate) bindings: &'static [(&'static str, Access)],
    /// The structs that these buffers hold.
    pub(crate) structs: &'static [&'static StructLayout],
}

impl KernelSpec {
    /// The entry point.
    pub(crate) fn entry(&self) -> &'static str {
        let name = self.file.rsplit_once('/').map_or(self.file, |(_, name)| name);
        name.strip_suffix(".wgsl").unwrap_or(name)
    }

    /// Workgroups that cover `size` invocations.
    pub(crate) fn groups(&self, size: [u32; 2]) -> [u32; 2] {
        [size[0].div_ceil(self.workgroup[0]), size[1].div_ceil(self.workgroup[1])]
    }
}
