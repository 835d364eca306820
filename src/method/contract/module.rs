//! A kernel's module against its record.

use crate::gpu::scene;
use crate::gpu::spec::{Access, KernelSpec, StructLayout};
use wgpu::naga::front::wgsl::parse_str;
use wgpu::naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use wgpu::naga::{AddressSpace, GlobalVariable, Handle, Module, StorageAccess, Type, TypeInner};

/// Storage buffers that WebGPU lets a kernel bind.
const MOST_STORAGE_BUFFERS: usize = 8;

/// A valid module.
pub(crate) struct Parsed {
    pub(crate) module: Module,
    info: ModuleInfo,
}

impl Parsed {
    pub(crate) fn new(text: &str) -> Result<Self, String> {
        let module = parse_str(text).map_err(|e| e.emit_to_string(text))?;
        // Two halves in a word, which all of WGSL has.
        let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|e| e.emit_to_string(text))?;
        Ok(Self { module, info })
    }

    /// What the kernel binds of a group: number and variable.
    fn group(&self, group: u32) -> Vec<(u32, &GlobalVariable)> {
        let used = self.info.get_entry_point(0);
        let bound = self.module.global_variables.iter().filter(|(handle, _)| !used[*handle].is_empty());
        let mut list: Vec<_> =
            bound.filter_map(|(_, v)| v.binding.as_ref().filter(|b| b.group == group).map(|b| (b.binding, v))).collect();
        list.sort_by_key(|(binding, _)| *binding);
        list
    }

    /// Whether the kernel uses a variable.
    fn uses(&self, name: &str) -> bool {
        let used = self.info.get_entry_point(0);
        let named = |variable: &GlobalVariable| variable.name.as_deref() == Some(name);
        self.module.global_variables.iter().any(|(handle, variable)| named(variable) && !used[handle].is_empty())
    }

    /// Structs within a type.
    fn structs(&self, ty: Handle<Type>, found: &mut Vec<Handle<Type>>) {
        match &self.module.types[ty].inner {
            TypeInner::Struct { members, .. } => {
                if !found.contains(&ty) {
                    found.push(ty);
                }
                members.iter().for_each(|m| self.structs(m.ty, found));
            }
            TypeInner::Array { base, .. } => self.structs(*base, found),
            _ => {}
        }
    }

    fn name(&self, ty: Handle<Type>) -> &str {
        self.module.types[ty].name.as_deref().unwrap_or_default()
    }

    /// How a struct differs from its Rust type.
    fn differences(&self, ty: Handle<Type>, layout: &StructLayout) -> Vec<String> {
        let TypeInner::Struct { members, span } = &self.module.types[ty].inner else {
            return vec![format!("{} is no struct", layout.name)];
        };
        let named = members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize));
        let named: Vec<_> = named.filter(|(name, _)| !name.starts_with("padding")).collect();
        let mut found = Vec::new();
        if *span as usize != layout.size {
            found.push(format!("struct {}: {span} bytes, in Rust {}", layout.name, layout.size));
        }
        for i in 0..named.len().max(layout.fields.len()) {
            if named.get(i) != layout.fields.get(i) {
                let show = |member: Option<&(&str, usize)>| member.map_or("nothing".into(), |(n, o)| format!("\"{n}\" at {o}"));
                found.push(format!(
                    "struct {}: member {}, in Rust {}",
                    layout.name,
                    show(named.get(i)),
                    show(layout.fields.get(i))
                ));
            }
        }
        found
    }
}

/// The use of a variable, as a record would have it.
fn access_of(variable: &GlobalVariable) -> Option<Access> {
    match variable.space {
        AddressSpace::Uniform => Some(Access::Uniform),
        AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => Some(Access::ReadWrite),
        AddressSpace::Storage { .. } => Some(Access::Read),
        _ => None,
    }
}

fn storage_buffers(bindings: &[(&str, Access)]) -> usize {
    bindings.iter().filter(|(_, access)| *access != Access::Uniform).count()
}

/// All that is wrong with a kernel.
pub(crate) fn check_kernel(spec: &KernelSpec, parsed: &Parsed) -> Vec<String> {
    let mut found = Vec::new();
    match parsed.module.entry_points.as_slice() {
        [entry] if entry.name == spec.entry() => {
            let [x, y] = spec.workgroup;
            if entry.workgroup_size != [x, y, 1] {
                found.push(format!("workgroup of {:?}, in the record {:?}", entry.workgroup_size, spec.workgroup));
            }
        }
        others => {
            let names: Vec<_> = others.iter().map(|e| &e.name).collect();
            return vec![format!("expected the entry point {} alone, found {names:?}", spec.entry())];
        }
    }
    let storage = storage_buffers(spec.bindings) + if spec.scene { storage_buffers(&scene::BINDINGS) } else { 0 };
    if storage > MOST_STORAGE_BUFFERS {
        found.push(format!("{storage} storage buffers; at most {MOST_STORAGE_BUFFERS} are there everywhere"));
    }
    found.extend(check_bindings(spec.bindings, &parsed.group(0), true));
    let of_scene = parsed.group(1);
    if !spec.scene && !of_scene.is_empty() {
        found.push("uses the scene, but its record does not".into());
    }
    found.extend(check_bindings(&scene::BINDINGS, &of_scene, false));
    if parsed.uses("scene") && !parsed.uses("scene_params") {
        found.push("does not begin with scene = scene_params".into());
    }
    found.extend(check_structs(spec, parsed));
    found
}

/// Bindings that are not as in a record; where `all` count, also those of the record that the kernel does not use.
fn check_bindings(record: &[(&str, Access)], group: &[(u32, &GlobalVariable)], all: bool) -> Vec<String> {
    let mut found = Vec::new();
    let show = |name: &str, access: Option<Access>| access.map_or("nothing".into(), |access| format!("{name} ({access:?})"));
    for (binding, variable) in group {
        let expected = record.get(*binding as usize).copied();
        let there = (variable.name.as_deref().unwrap_or_default(), access_of(variable));
        if expected.map(|(name, access)| (name, Some(access))) != Some(there) {
            let expected = show(expected.map_or("", |e| e.0), expected.map(|e| e.1));
            found.push(format!("binding {binding}: expected {expected}, found {}", show(there.0, there.1)));
        }
    }
    let used = |i: &usize| group.iter().any(|(binding, _)| *binding as usize == *i);
    let unused = (0..record.len()).filter(|i| all && !used(i));
    found.extend(unused.map(|i| format!("binding {i}: {} of the record is not used", record[i].0)));
    found
}

/// Structs that differ from their Rust types, that the record lacks, or that no buffer holds.
fn check_structs(spec: &KernelSpec, parsed: &Parsed) -> Vec<String> {
    let mut found = Vec::new();
    let mut held = Vec::new();
    for (group, known) in [(0, spec.structs), (1, &scene::STRUCTS)] {
        for (_, variable) in parsed.group(group) {
            let mut structs = Vec::new();
            parsed.structs(variable.ty, &mut structs);
            for ty in structs {
                let name = parsed.name(ty);
                held.push(name);
                match known.iter().find(|layout| layout.name == name) {
                    Some(layout) => found.extend(parsed.differences(ty, layout)),
                    None => {
                        let variable = variable.name.as_deref().unwrap_or_default();
                        found.push(format!("{variable}: struct {name} is not in the record"));
                    }
                }
            }
        }
    }
    let missing = spec.structs.iter().filter(|layout| !held.contains(&layout.name));
    found.extend(missing.map(|layout| format!("no buffer holds the record's struct {}", layout.name)));
    // The scene's records that are read whole are no buffer's type.
    for (ty, named) in parsed.module.types.iter() {
        if let Some(layout) = scene::STRUCTS.iter().find(|layout| named.name.as_deref() == Some(layout.name)) {
            found.extend(parsed.differences(ty, layout));
        }
    }
    found
}
