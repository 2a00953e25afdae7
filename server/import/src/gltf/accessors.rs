//! Numbers out of buffers, with every bound checked.

use std::{borrow::Cow, cell::Cell};

use gltf::{
    Accessor,
    accessor::{DataType, sparse::IndexType},
    buffer::View,
};

use grasp_synthesis::base::stop::Stop;

use crate::{MeshLimits, error::ImportError};

/// How often, on average, each vertex and index of the largest mesh may be read: for morph targets, joints and weights.
const READS: u64 = 16;

/// The bytes of a document's buffers.
#[derive(Debug)]
pub(crate) struct Buffers<'a> {
    contents: Vec<Cow<'a, [u8]>>,
    /// Elements that may still be read: scenes can ask for the same ones again and again.
    left: Cell<u64>,
    stop: Stop<'a>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(buffers: Vec<Cow<'a, [u8]>>, limits: MeshLimits, stop: Stop<'a>) -> Self {
        let largest = limits.vertices as u64 + 3 * limits.triangles as u64;
        Self {
            contents: buffers,
            left: Cell::new(READS.saturating_mul(largest)),
            stop,
        }
    }

    /// Counts elements that are about to be read, and ends reading if it should.
    pub(crate) fn spend(&self, elements: u64) -> Result<(), ImportError> {
        self.stop.check()?;
        let left = self.left.get().checked_sub(elements.saturating_add(1));
        self.left.set(left.ok_or_else(|| {
            ImportError::at(
                "the scene",
                "repeats its meshes, joints or morph targets too often to be read",
            )
        })?);
        Ok(())
    }

    /// The first `count` elements of an accessor of `N` components, each converted from numbers; integers that stand for fractions
    /// become those. Memory grows with `count`, not with what the accessor claims.
    pub(crate) fn read<const N: usize, T: Clone>(
        &self,
        accessor: &Accessor<'_>,
        count: usize,
        convert: impl Fn([f64; N]) -> T,
    ) -> Result<Vec<T>, ImportError> {
        let wrong = |what: String| ImportError::at(format!("accessors[{}]", accessor.index()), what);
        let components = accessor.dimensions().multiplicity();
        if components != N {
            return Err(wrong(format!("has {components} components; {N} are needed")));
        }
        if accessor.count() < count {
            let found = accessor.count();
            return Err(wrong(format!("has {found} elements; {count} are needed")));
        }
        self.spend(count as u64)?;
        let kind = accessor.data_type();
        let size = kind.size() * N;
        let scale = scale_of(accessor);
        let read = |element: &[u8], kind| {
            let element = components_of(element, kind);
            // The smallest signed integer stands for −1 as well.
            convert(scale.map_or(element, |scale| element.map(|number| (number / scale).max(-1.0))))
        };
        let mut numbers: Vec<T> = match accessor.view() {
            Some(view) => {
                let stride = view.stride().unwrap_or(size);
                self.elements(&view, accessor.offset(), stride, size, count)
                    .ok_or_else(|| wrong(beyond(count)))?
                    .map(|element| read(element, kind))
                    .collect()
            }
            None => vec![convert([0.0; N]); count],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let changed = sparse.count();
            self.spend(changed as u64)?;
            let index_kind = match indices.index_type() {
                IndexType::U8 => DataType::U8,
                IndexType::U16 => DataType::U16,
                IndexType::U32 => DataType::U32,
            };
            let width = index_kind.size();
            let places = self.elements(&indices.view(), indices.offset(), width, width, changed);
            let replaced = self.elements(&values.view(), values.offset(), size, size, changed);
            let (Some(places), Some(replaced)) = (places, replaced) else {
                return Err(wrong(beyond(changed)));
            };
            for (place, element) in places.zip(replaced) {
                let [place] = components_of::<1>(place, index_kind).map(|place| place as usize);
                if place >= accessor.count() {
                    return Err(wrong(format!("replaces element {place}, which does not exist")));
                }
                if let Some(number) = numbers.get_mut(place) {
                    *number = read(element, kind);
                }
            }
        }
        Ok(numbers)
    }

    /// The bytes of `count` elements, if all are within their view and its buffer.
    fn elements(
        &self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
    ) -> Option<impl Iterator<Item = &[u8]> + use<'_, 'a>> {
        let buffer = self.contents.get(view.buffer().index())?;
        let end = view.offset().checked_add(view.length())?;
        let bytes = buffer.get(view.offset()..end)?;
        let last = count.checked_sub(1)?.checked_mul(stride)?.checked_add(offset)?;
        if last.checked_add(size)? > bytes.len() || stride < size {
            return None;
        }
        Some((0..count).map(move |element| &bytes[offset + element * stride..][..size]))
    }
}

/// What the integers of an accessor are divided by; `None` if they stand for themselves.
fn scale_of(accessor: &Accessor<'_>) -> Option<f64> {
    let scale = match accessor.data_type() {
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32767.0,
        DataType::U16 => 65535.0,
        DataType::U32 | DataType::F32 => return None,
    };
    accessor.normalized().then_some(scale)
}

fn beyond(count: usize) -> String {
    format!("has {count} elements, which reach beyond its buffer")
}

/// The little-endian numbers of one element.
fn components_of<const N: usize>(element: &[u8], kind: DataType) -> [f64; N] {
    let width = kind.size();
    std::array::from_fn(|component| {
        let bytes = &element[component * width..][..width];
        match (kind, bytes) {
            (DataType::I8, &[a]) => f64::from(i8::from_le_bytes([a])),
            (DataType::U8, &[a]) => f64::from(a),
            (DataType::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
            (DataType::U16, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
            (DataType::U32, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
            (DataType::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::NAN,
        }
    })
}
