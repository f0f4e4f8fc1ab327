//! Accessors: typed arrays out of buffer views, every range and count checked.

use super::{
    buffers::{Buffers, View},
    document::{Document, Element},
};
use crate::Result;

/// Component types by their numbers in the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

/// An accessor, resolved but not read.
struct Layout<'a> {
    element: Element<'a>,
    count: usize,
    width: usize,
    component: Component,
    normalized: bool,
    /// Bytes from the first element on, and the stride; none: zeros.
    view: Option<(&'a [u8], usize)>,
}

/// How integers become floats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Integers {
    /// As `normalized` says.
    AsDeclared,
    /// Always to [0, 1] or [-1, 1]: for colours, weights and rotations, where whole numbers make no sense and the
    /// flag is sometimes forgotten.
    Normalized,
}

/// Reads accessors of a document.
#[derive(Clone, Copy)]
pub(super) struct Accessors<'a> {
    /// The document that holds them.
    pub document: &'a Document,
    /// Its data.
    pub buffers: &'a Buffers<'a>,
}

/// Numbers read from an accessor.
pub(super) struct Numbers {
    /// `width` for each element.
    pub values: Vec<f32>,
    /// Numbers in an element.
    pub width: usize,
}

impl Component {
    fn of(element: &Element) -> Result<Self> {
        Ok(match element.required_index("componentType")? {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => {
                return Err(element.error(format!("unknown componentType {other}; export the file again")));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// One number from its bytes, which are as many as [`Component::size`].
    fn float(self, b: &[u8], normalized: bool) -> f32 {
        match (self, normalized) {
            (Self::F32, _) => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            (Self::I8, true) => (f32::from(b[0] as i8) / 127.0).max(-1.0),
            (Self::U8, true) => f32::from(b[0]) / 255.0,
            (Self::I16, true) => (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
            (Self::U16, true) => f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            (Self::U32, true) => (f64::from(self.whole(b)) / f64::from(u32::MAX)) as f32,
            (Self::I8, false) => f32::from(b[0] as i8),
            (Self::I16, false) => f32::from(i16::from_le_bytes([b[0], b[1]])),
            (Self::U8 | Self::U16 | Self::U32, false) => self.whole(b) as f32,
        }
    }

    /// An unsigned whole number; 0 for types that are none.
    fn whole(self, b: &[u8]) -> u32 {
        match self {
            Self::U8 => u32::from(b[0]),
            Self::U16 => u32::from(u16::from_le_bytes([b[0], b[1]])),
            Self::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            Self::I8 | Self::I16 | Self::F32 => 0,
        }
    }
}

impl<'a> Accessors<'a> {
    /// Number of elements, without reading them.
    pub fn count(&self, index: usize, user: &str) -> Result<usize> {
        self.document.element("accessors", index, user)?.required_index("count")
    }

    /// All numbers of accessor `index`, whose elements must have one of `widths` numbers.
    pub fn numbers(&self, index: usize, user: &str, widths: &[usize], integers: Integers) -> Result<Numbers> {
        let layout = self.layout(index, user, widths)?;
        let normalized = layout.normalized || integers == Integers::Normalized;
        let values = self.read(&layout, |b| layout.component.float(b, normalized))?;
        Ok(Numbers { values, width: layout.width })
    }

    /// All numbers, `N` to an element.
    pub fn arrays<const N: usize>(
        &self,
        index: usize,
        user: &str,
        integers: Integers,
    ) -> Result<Vec<[f32; N]>> {
        Ok(self.numbers(index, user, &[N], integers)?.values.as_chunks::<N>().0.to_vec())
    }

    /// Unsigned whole numbers, `width` to an element.
    pub fn whole_numbers(&self, index: usize, user: &str, width: usize) -> Result<Vec<u32>> {
        let layout = self.layout(index, user, &[width])?;
        if !matches!(layout.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(layout
                .element
                .error(format!("{user} wants unsigned integers; export the file again")));
        }
        self.read(&layout, |b| layout.component.whole(b))
    }

    fn layout(&self, index: usize, user: &str, widths: &[usize]) -> Result<Layout<'a>> {
        let element = self.document.element("accessors", index, user)?;
        let kind = element.text("type")?.unwrap_or_default();
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            _ => 0,
        };
        if !widths.contains(&width) {
            return Err(
                element.error(format!("has type `{kind}`, which {user} cannot use; export the file again"))
            );
        }
        let component = Component::of(&element)?;
        let count = element.required_index("count")?;
        let normalized = element.flag("normalized")?.unwrap_or(false);
        let size = width * component.size();
        let view = match element.index("bufferView")? {
            None => None,
            Some(view) => {
                let View { bytes, stride } = self.buffers.view(view, &element.place)?;
                let offset = element.index("byteOffset")?.unwrap_or(0);
                let stride = stride.unwrap_or(size);
                Some((elements(&element, bytes, offset, stride, size, count)?, stride))
            }
        };
        Ok(Layout { element, count, width, component, normalized, view })
    }

    /// Reads every component, sparse replacements included.
    fn read<T: Copy + Default>(&self, layout: &Layout, convert: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let Layout { element, count, width, component, .. } = layout;
        let total = count.saturating_mul(*width);
        self.buffers.budget.take(total, size_of::<T>(), |message| element.error(message))?;
        let (part, size) = (component.size(), width * component.size());
        let mut out = Vec::with_capacity(total);
        match layout.view {
            None => out.resize(total, T::default()),
            Some((bytes, stride)) if stride == size => {
                out.extend(bytes[..count * size].chunks_exact(part).map(&convert));
            }
            Some((bytes, stride)) => {
                for i in 0..*count {
                    out.extend(bytes[i * stride..][..size].chunks_exact(part).map(&convert));
                }
            }
        }
        if let Some(sparse) = element.get("sparse") {
            self.replace(layout, &sparse, &mut out, convert)?;
        }
        Ok(out)
    }

    fn replace<T>(
        &self,
        layout: &Layout,
        sparse: &Element,
        out: &mut [T],
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<()> {
        let Layout { width, component, .. } = layout;
        let count = sparse.required_index("count")?;
        let part = |key: &str| {
            sparse.get(key).ok_or_else(|| sparse.error(format!("`{key}` is missing; export the file again")))
        };
        let range = |element: &Element, size: usize| -> Result<&[u8]> {
            let View { bytes, stride } =
                self.buffers.view(element.required_index("bufferView")?, &element.place)?;
            if stride.is_some_and(|s| s != size) {
                return Err(element.error("sparse data must be packed; export the file again"));
            }
            elements(element, bytes, element.index("byteOffset")?.unwrap_or(0), size, size, count)
        };
        let (indices, values) = (part("indices")?, part("values")?);
        let index_type = Component::of(&indices)?;
        let size = width * component.size();
        let index_bytes = range(&indices, index_type.size())?;
        let value_bytes = range(&values, size)?;
        if !matches!(index_type, Component::U8 | Component::U16 | Component::U32) {
            return Err(indices.error("must be unsigned integers; export the file again"));
        }
        let each = index_bytes.chunks_exact(index_type.size()).zip(value_bytes.chunks_exact(size));
        for (index, value) in each.take(count) {
            let at = index_type.whole(index) as usize;
            let slot = out.get_mut(at.saturating_mul(*width)..at.saturating_add(1).saturating_mul(*width));
            let slot = slot.ok_or_else(|| indices.error(format!("index {at} is outside the accessor")))?;
            for (slot, bytes) in slot.iter_mut().zip(value.chunks_exact(component.size())) {
                *slot = convert(bytes);
            }
        }
        Ok(())
    }
}

/// The bytes from `offset` on, checked to hold `count` elements of `size` bytes that begin `stride` apart.
fn elements<'b>(
    element: &Element,
    bytes: &'b [u8],
    offset: usize,
    stride: usize,
    size: usize,
    count: usize,
) -> Result<&'b [u8]> {
    let wanted = match count.checked_sub(1) {
        None => Some(0),
        Some(steps) => steps.checked_mul(stride).and_then(|n| n.checked_add(size)),
    };
    let end = wanted.and_then(|n| n.checked_add(offset));
    if stride < size && count > 1 {
        return Err(element.error(format!("elements of {size} bytes overlap at a byteStride of {stride}")));
    }
    end.and_then(|end| bytes.get(offset..end)).ok_or_else(|| {
        element.error(format!(
            "{count} elements from byte {offset} do not fit its view of {} bytes; export the file again",
            bytes.len()
        ))
    })
}
