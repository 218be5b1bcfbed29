//! Numbers in buffers: positions and indices.

use ::gltf::json::accessor::{Accessor, ComponentType, GenericComponentType, Type, sparse};
use ::gltf::json::validation::{Checked, USize64};
use ::gltf::json::{Index, Root, buffer};
use glam::DVec3;

use super::buffers::Buffers;
use crate::error::Problem;

/// All of a file's.
pub(super) struct Accessors<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: &'a Buffers<'a>,
}

/// One of them.
pub(super) struct Found<'a> {
    all: &'a Accessors<'a>,
    number: usize,
    accessor: &'a Accessor,
}

/// Elements one after the other, each as long as its kind.
type Elements<'a> = Box<dyn Iterator<Item = &'a [u8]> + 'a>;

impl<'a> Accessors<'a> {
    pub(super) fn find(&'a self, index: Index<Accessor>) -> Result<Found<'a>, Problem> {
        let number = index.value();
        let accessor = self
            .root
            .accessors
            .get(number)
            .ok_or_else(|| self.unknown("accessor", number, self.root.accessors.len()))?;
        Ok(Found { all: self, number, accessor })
    }

    fn unknown(&self, what: &str, found: usize, num: usize) -> Problem {
        Problem::field(what, found, format!("below {num}"))
    }

    /// `count` elements of `size` bytes from `offset` in a view on, as far apart as it says.
    fn elements(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: u64,
        size: usize,
    ) -> Result<Elements<'a>, Problem> {
        let views = &self.root.buffer_views;
        let number = view.value();
        let view = views.get(number).ok_or_else(|| self.unknown("bufferView", number, views.len()))?;
        let buffer = view.buffer.value();
        let bytes = self
            .buffers
            .get(buffer)
            .ok_or_else(|| self.unknown("buffer", buffer, self.root.buffers.len()))?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let held = range(bytes, start, view.byte_length.0)?;
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(Problem::field("byteStride", stride, format!("at least {size}")));
        }
        if count == 0 {
            return Ok(Box::new(std::iter::empty()));
        }
        let length = (count - 1).saturating_mul(stride as u64).saturating_add(size as u64);
        let elements = range(held, offset, length)?;
        Ok(Box::new(elements.chunks(stride).map(move |element| &element[..size])))
    }
}

/// Part of some bytes, if they hold it.
fn range(bytes: &[u8], start: u64, length: u64) -> Result<&[u8], Problem> {
    let expected = start.saturating_add(length);
    let problem = Problem::Size { what: "the buffer", found: bytes.len() as u64, expected };
    if expected > bytes.len() as u64 { Err(problem) } else { Ok(&bytes[start as usize..expected as usize]) }
}

impl<'a> Found<'a> {
    pub(super) fn count(&self) -> u64 {
        self.accessor.count.0
    }

    fn fail(&self, problem: Problem) -> Problem {
        problem.of_array(format!("accessor {}", self.number))
    }

    fn component(&self) -> Result<ComponentType, Problem> {
        match self.accessor.component_type {
            Checked::Valid(GenericComponentType(component)) => Ok(component),
            Checked::Invalid => {
                Err(self.fail(Problem::field("componentType", "another number", "5120 to 5126")))
            }
        }
    }

    fn check_type(&self, expected: Type, name: &str) -> Result<(), Problem> {
        if matches!(self.accessor.type_, Checked::Valid(found) if found == expected) {
            return Ok(());
        }
        Err(self.fail(Problem::field("type", "another one", name)))
    }

    /// Calls `take` with the elements of `size` bytes in order, `None` for one of zeroes, and what a sparse accessor
    /// changes afterwards.
    fn each(&self, size: usize, mut take: impl FnMut(usize, Option<&[u8]>)) -> Result<(), Problem> {
        let Accessor { buffer_view, byte_offset, count: USize64(count), sparse, .. } = self.accessor;
        match buffer_view {
            Some(view) => {
                let offset = byte_offset.map_or(0, |offset| offset.0);
                let elements = self.all.elements(*view, offset, *count, size)?;
                elements.enumerate().for_each(|(place, element)| take(place, Some(element)));
            }
            None => (0..*count as usize).for_each(|place| take(place, None)),
        }
        let Some(sparse::Sparse { count: USize64(changed), indices, values, .. }) = sparse else {
            return Ok(());
        };
        let Checked::Valid(component) = &indices.component_type else {
            return Err(Problem::field("componentType of indices", "another number", "5121, 5123 or 5125"));
        };
        let index_size = component.0.size();
        let places = self.all.elements(indices.buffer_view, indices.byte_offset.0, *changed, index_size)?;
        let values = self.all.elements(values.buffer_view, values.byte_offset.0, *changed, size)?;
        for (place, value) in places.zip(values) {
            let place = unsigned(place);
            if u64::from(place) >= *count {
                return Err(Problem::field("an index of sparse values", place, format!("below {count}")));
            }
            take(place as usize, Some(value));
        }
        Ok(())
    }

    /// The elements as vectors of three.
    pub(super) fn vectors(&self) -> Result<Vec<DVec3>, Problem> {
        self.check_type(Type::Vec3, "VEC3")?;
        let component = self.component()?;
        let mut vectors = Vec::with_capacity(self.allowed_count(12)?);
        let normalized = self.accessor.normalized;
        let each = self.each(3 * component.size(), |place, bytes| {
            let vector = bytes.map_or(DVec3::ZERO, |bytes| {
                let mut numbers =
                    bytes.chunks_exact(component.size()).map(|bytes| number(component, normalized, bytes));
                DVec3::from_array(std::array::from_fn(|_| numbers.next().unwrap_or_default()))
            });
            put(&mut vectors, place, vector);
        });
        each.map_err(|problem| self.fail(problem))?;
        Ok(vectors)
    }

    /// The elements as indices.
    pub(super) fn indices(&self) -> Result<Vec<u32>, Problem> {
        self.check_type(Type::Scalar, "SCALAR")?;
        let component = self.component()?;
        if !matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(self.fail(Problem::field(
                "componentType",
                format!("{component:?}"),
                "an unsigned integer",
            )));
        }
        let mut indices = Vec::with_capacity(self.allowed_count(4)?);
        let each =
            self.each(component.size(), |place, bytes| put(&mut indices, place, bytes.map_or(0, unsigned)));
        each.map_err(|problem| self.fail(problem))?;
        Ok(indices)
    }

    /// The count, which the caller has compared with its limit.
    fn allowed_count(&self, bytes: usize) -> Result<usize, Problem> {
        let count = usize::try_from(self.count()).ok().filter(|count| count.checked_mul(bytes).is_some());
        count.ok_or_else(|| self.fail(Problem::field("count", self.count(), "one that can be addressed")))
    }
}

/// Puts a value at a place, which is the next one or one that has a value.
fn put<T>(values: &mut Vec<T>, place: usize, value: T) {
    match values.get_mut(place) {
        Some(held) => *held = value,
        None => values.push(value),
    }
}

/// An unsigned integer of up to four bytes.
fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u32::from(byte))
}

/// A component as the specification decodes it.
fn number(component: ComponentType, normalized: bool, bytes: &[u8]) -> f64 {
    let bits = unsigned(bytes);
    let (number, largest) = match component {
        ComponentType::I8 => (f64::from(bits as u8 as i8), 127.0),
        ComponentType::U8 => (f64::from(bits), 255.0),
        ComponentType::I16 => (f64::from(bits as u16 as i16), 32767.0),
        ComponentType::U16 => (f64::from(bits), 65535.0),
        ComponentType::U32 => (f64::from(bits), f64::from(u32::MAX)),
        ComponentType::F32 => return f64::from(f32::from_bits(bits)),
    };
    if normalized { (number / largest).max(-1.0) } else { number }
}
