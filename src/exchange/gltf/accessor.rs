//! Arrays of numbers within buffers.

use super::file::File;
use crate::Result;
use gltf_json::accessor::{Accessor, ComponentType};
use gltf_json::validation::Checked;
use gltf_json::{Index, buffer};

/// Where the elements of an array lie.
struct Layout<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: ComponentType,
    components: usize,
    count: usize,
}

impl File {
    /// Elements of N numbers each; integers count as `normalized` says.
    pub fn numbers<const N: usize>(&self, index: Index<Accessor>, what: &str) -> Result<Vec<[f32; N]>> {
        let accessor = self.get(index, "accessor")?;
        let layout = self.layout(index, accessor, what, N)?;
        self.elements(accessor, &layout, what, number(layout.component, accessor.normalized))
    }

    /// Whole numbers, one an element.
    pub fn indices(&self, index: Index<Accessor>, what: &str) -> Result<Vec<u32>> {
        Ok(self.whole::<1>(index, what)?.into_iter().map(|[i]| i).collect())
    }

    /// Elements of N whole numbers each, none below 0.
    pub fn whole<const N: usize>(&self, index: Index<Accessor>, what: &str) -> Result<Vec<[u32; N]>> {
        let accessor = self.get(index, "accessor")?;
        let layout = self.layout(index, accessor, what, N)?;
        let read: fn(&[u8]) -> u32 = match layout.component {
            ComponentType::U8 => |b| u32::from(b[0]),
            ComponentType::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            ComponentType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            other => {
                return Err(self.error(format!("{what}: accessor {} is of {other:?}: expected whole numbers", index.value())));
            }
        };
        self.elements(accessor, &layout, what, read)
    }

    /// All elements, sparse ones in their places; `read` takes one number of them.
    fn elements<T: Copy + Default, const N: usize>(
        &self,
        accessor: &Accessor,
        layout: &Layout,
        what: &str,
        read: fn(&[u8]) -> T,
    ) -> Result<Vec<[T; N]>> {
        let width = layout.component.size();
        let element = |bytes: &[u8]| std::array::from_fn(|i| read(&bytes[i * width..]));
        let mut elements = match accessor.buffer_view {
            Some(_) => layout.elements().map(element).collect(),
            None => vec![[T::default(); N]; layout.count],
        };
        for (i, bytes) in self.sparse(accessor, layout, what)? {
            elements[i] = element(bytes);
        }
        Ok(elements)
    }

    /// How many numbers an element has.
    pub fn components(&self, index: Index<Accessor>) -> Result<usize> {
        Ok(match self.get(index, "accessor")?.type_ {
            Checked::Valid(kind) => kind.multiplicity(),
            Checked::Invalid => return Err(self.error(format!("accessor {} has an unknown type", index.value()))),
        })
    }

    fn layout(&self, index: Index<Accessor>, accessor: &Accessor, what: &str, n: usize) -> Result<Layout<'_>> {
        let number = index.value();
        let bad = |message: String| self.error(format!("{what}: accessor {number} {message}"));
        let components = self.components(index)?;
        if components != n {
            return Err(bad(format!("has {components} numbers an element, expected {n}")));
        }
        let Checked::Valid(component) = accessor.component_type else { return Err(bad("has numbers of an unknown type".into())) };
        let component = component.0;
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let size = n * component.size();
        let Some(view) = accessor.buffer_view else {
            if accessor.sparse.is_none() && !self.compressed().is_empty() {
                return Err(bad(format!("has no data{}", self.compressed())));
            }
            // An array of zeros, of a mesh whose other arrays are longer than a byte a vertex.
            let most = self.buffered();
            if count > most {
                return Err(bad(format!("has {count} elements without data: expected at most {most}, as there are bytes")));
            }
            return Ok(Layout { bytes: &[], stride: size, component, components: n, count });
        };
        let stride = self.get(view, "buffer view")?.byte_stride.map_or(size, |s| s.0);
        let bytes = self.part(view, accessor.byte_offset.unwrap_or_default().0, what)?;
        let fits = stride >= size
            && count.checked_sub(1).is_none_or(|last| last.checked_mul(stride).is_some_and(|at| at + size <= bytes.len()));
        if !fits {
            return Err(bad(format!("has {count} elements of {size} bytes, {stride} apart, in {} bytes", bytes.len())));
        }
        Ok(Layout { bytes, stride, component, components: n, count })
    }

    /// A view's bytes from an offset on.
    fn part(&self, view: Index<buffer::View>, offset: u64, what: &str) -> Result<&[u8]> {
        let bytes = self.view(view)?;
        let rest = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..));
        rest.ok_or_else(|| self.error(format!("{what}: byte {offset} of buffer view {} of {} bytes", view.value(), bytes.len())))
    }

    /// The elements that stand for those of the array itself.
    fn sparse<'a>(&'a self, accessor: &Accessor, layout: &Layout, what: &str) -> Result<Vec<(usize, &'a [u8])>> {
        let Some(sparse) = &accessor.sparse else { return Ok(Vec::new()) };
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err(self.error(format!("{what}: sparse indices of an unknown type")));
        };
        let count = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
        let (width, size) = (kind.0.size(), layout.components * layout.component.size());
        let places = self.part(sparse.indices.buffer_view, sparse.indices.byte_offset.0, what)?;
        let values = self.part(sparse.values.buffer_view, sparse.values.byte_offset.0, what)?;
        if count > places.len() / width || count > values.len() / size {
            return Err(self.error(format!("{what}: {count} sparse elements in less data than they take")));
        }
        let place = |b: &[u8]| b.iter().rev().fold(0, |n, &byte| n << 8 | usize::from(byte));
        let pairs = places.chunks_exact(width).map(place).zip(values.chunks_exact(size)).take(count);
        pairs
            .map(|(i, bytes)| match i < layout.count {
                true => Ok((i, bytes)),
                false => Err(self.error(format!("{what}: sparse element {i} of {}", layout.count))),
            })
            .collect()
    }
}

impl<'a> Layout<'a> {
    fn elements(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride) = (self.bytes, self.stride);
        (0..self.count).map(move |i| &bytes[i * stride..])
    }
}

/// How a number is read.
fn number(component: ComponentType, normalized: bool) -> fn(&[u8]) -> f32 {
    match (component, normalized) {
        (ComponentType::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        (ComponentType::U32, _) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
        (ComponentType::U8, false) => |b| f32::from(b[0]),
        (ComponentType::U8, true) => |b| f32::from(b[0]) / 255.0,
        (ComponentType::I8, false) => |b| f32::from(b[0] as i8),
        (ComponentType::I8, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
        (ComponentType::U16, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
        (ComponentType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
        (ComponentType::I16, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
        (ComponentType::I16, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
    }
}
