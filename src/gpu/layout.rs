//! For tests: whether a Rust struct lies in memory as a shader's does.

use wgpu::naga::TypeInner;
use wgpu::naga::front::wgsl::parse_str;

/// Size of a shader's struct, and name and offset of its members.
pub(crate) fn layout(source: &str, name: &str) -> (usize, Vec<(String, usize)>) {
    let module = parse_str(source).unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
    match found.map(|(_, t)| &t.inner) {
        Some(TypeInner::Struct { members, span }) => {
            let of = |m: &wgpu::naga::StructMember| (m.name.clone().unwrap_or_default(), m.offset as usize);
            (*span as usize, members.iter().map(of).collect())
        }
        _ => panic!("the shader has no struct {name}"),
    }
}

/// Checks that `$rust` has the size of the shader's `$name`, and these fields at the same offsets; fields of padding need not be named.
macro_rules! check {
    ($source:expr, $rust:ty as $name:literal { $($field:ident),+ $(,)? }) => {{
        let (size, members) = $crate::gpu::layout::layout($source, $name);
        assert_eq!(size_of::<$rust>(), size, "size of {}", $name);
        let expected = [$((stringify!($field), std::mem::offset_of!($rust, $field))),+];
        let named = members.iter().filter(|(name, _)| !name.starts_with("padding"));
        assert_eq!(named.map(|(n, o)| (n.as_str(), *o)).collect::<Vec<_>>(), expected, "members of {}", $name);
    }};
}
pub(crate) use check;
