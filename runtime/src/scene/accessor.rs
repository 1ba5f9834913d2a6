//! Decodes accessors of every component type, interleaved, sparse or normalized, with all bounds checked.

use super::document::Document;
use crate::error::{Error, Result};
use gltf::accessor::{Accessor, DataType, Dimensions};

/// More elements than this in one accessor is a broken file, not a scene.
const MOST_ELEMENTS: usize = 1 << 30;
/// The same for an accessor without a buffer view: nothing in the file bears out its count.
const MOST_ZEROS: usize = 1 << 22;

/// Where the elements of an accessor lie.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Decodes an accessor of floats or (normalized) integers into `N` floats an element.
///
/// # Errors
/// Another element type than `dimensions`, or data outside its buffer view or buffer.
pub fn floats<const N: usize>(
    document: &Document,
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
) -> Result<Vec<[f32; N]>> {
    debug_assert_eq!(dimensions.multiplicity(), N);
    decode(document, accessor, dimensions, component_scale(accessor))
}

/// Decodes an accessor of unsigned integers.
///
/// # Errors
/// Signed or floating-point components, another element type than SCALAR, or data out of bounds.
pub fn indices(document: &Document, accessor: &Accessor<'_>) -> Result<Vec<u32>> {
    let at = || format!("accessor {}", accessor.index());
    if !matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32) {
        let message = format!("indices have the component type {:?}", accessor.data_type());
        return Err(Error::input(message).at(at()).help("unsigned byte, short or int"));
    }
    let (values, _) =
        expect(accessor, Dimensions::Scalar).and_then(|()| raw(document, accessor, 1)).map_err(|e| e.at(at()))?;
    Ok(values.into_iter().map(|value| value as u32).collect())
}

fn decode<const N: usize>(
    document: &Document,
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
    scale: Option<f64>,
) -> Result<Vec<[f32; N]>> {
    let at = || format!("accessor {}", accessor.index());
    let (values, _) =
        expect(accessor, dimensions).and_then(|()| raw(document, accessor, N)).map_err(|error| error.at(at()))?;
    let convert = |value: f64| match scale {
        Some(scale) => (value / scale).max(-1.0) as f32,
        None => value as f32,
    };
    Ok(values.chunks_exact(N).map(|element| std::array::from_fn(|i| convert(element[i]))).collect())
}

fn expect(accessor: &Accessor<'_>, dimensions: Dimensions) -> Result<()> {
    if accessor.dimensions() == dimensions {
        return Ok(());
    }
    Err(Error::input(format!("its type is {:?}", accessor.dimensions())).help(format!("{dimensions:?}")))
}

/// What a normalized integer is divided by.
fn component_scale(accessor: &Accessor<'_>) -> Option<f64> {
    accessor.normalized().then_some(match accessor.data_type() {
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32767.0,
        DataType::U16 => 65535.0,
        DataType::U32 => 4294967295.0,
        DataType::F32 => return None,
    })
}

/// Components of all elements, exactly, and the number of elements.
fn raw(document: &Document, accessor: &Accessor<'_>, components: usize) -> Result<(Vec<f64>, usize)> {
    let (count, data_type) = (accessor.count(), accessor.data_type());
    let (most, noun) =
        if accessor.view().is_some() { (MOST_ELEMENTS, "") } else { (MOST_ZEROS, " without a buffer view") };
    if count > most {
        return Err(Error::input(format!("count {count}{noun}")).help(format!("at most {most}")));
    }
    let size = data_type.size() * components;
    let mut values = match accessor.view() {
        Some(view) => {
            let data = strided(document, &view, accessor.offset(), count, size)?;
            let mut values = Vec::with_capacity(count * components);
            (0..count).for_each(|i| push_element(&mut values, &data, i, data_type, components));
            values
        }
        None => vec![0.0; count * components],
    };
    if let Some(sparse) = accessor.sparse() {
        overwrite(document, &sparse, data_type, components, &mut values).map_err(|error| error.at("sparse"))?;
    }
    Ok((values, count))
}

fn overwrite(
    document: &Document,
    sparse: &gltf::accessor::sparse::Sparse<'_>,
    data_type: DataType,
    components: usize,
    values: &mut [f64],
) -> Result<()> {
    use gltf::accessor::sparse::IndexType;
    let index_type = match sparse.indices().index_type() {
        IndexType::U8 => DataType::U8,
        IndexType::U16 => DataType::U16,
        IndexType::U32 => DataType::U32,
    };
    let (indices, replacements) = (sparse.indices(), sparse.values());
    let places = strided(document, &indices.view(), indices.offset(), sparse.count(), index_type.size())?;
    let size = data_type.size() * components;
    let data = strided(document, &replacements.view(), replacements.offset(), sparse.count(), size)?;
    let count = values.len() / components;
    let mut element = Vec::with_capacity(components);
    for i in 0..sparse.count() {
        let place = component(&places.bytes[i * places.stride..], index_type) as usize;
        if place >= count {
            return Err(Error::input(format!("index {place} of an accessor with {count} elements")));
        }
        element.clear();
        push_element(&mut element, &data, i, data_type, components);
        values[place * components..(place + 1) * components].copy_from_slice(&element);
    }
    Ok(())
}

fn strided<'a>(
    document: &'a Document,
    view: &gltf::buffer::View<'_>,
    offset: usize,
    count: usize,
    size: usize,
) -> Result<Strided<'a>> {
    let bytes = view_bytes(document, view)?;
    let stride = view.stride().filter(|&stride| stride > 0).unwrap_or(size);
    let end =
        count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size)?.checked_add(offset));
    match end.filter(|&end| end <= bytes.len()) {
        Some(_) => Ok(Strided { bytes: bytes.get(offset..).unwrap_or(&[]), stride }),
        None => Err(Error::input(format!(
            "{count} elements of {size} bytes, {stride} apart, from byte {offset} on, exceed buffer view {} of {} bytes",
            view.index(),
            bytes.len()
        ))),
    }
}

/// The bytes of a buffer view.
///
/// # Errors
/// A view that exceeds its buffer.
pub fn view_bytes<'a>(document: &'a Document, view: &gltf::buffer::View<'_>) -> Result<&'a [u8]> {
    let buffer = &document.buffers[view.buffer().index()];
    view.offset().checked_add(view.length()).and_then(|end| buffer.get(view.offset()..end)).ok_or_else(|| {
        let message = format!(
            "{} bytes from byte {} on exceed buffer {} of {} bytes",
            view.length(),
            view.offset(),
            view.buffer().index(),
            buffer.len()
        );
        Error::input(message).at(format!("buffer view {}", view.index()))
    })
}

fn push_element(out: &mut Vec<f64>, data: &Strided<'_>, index: usize, data_type: DataType, components: usize) {
    let element = &data.bytes[index * data.stride..];
    out.extend((0..components).map(|i| component(&element[i * data_type.size()..], data_type)));
}

fn component(b: &[u8], data_type: DataType) -> f64 {
    match data_type {
        DataType::I8 => f64::from(b[0] as i8),
        DataType::U8 => f64::from(b[0]),
        DataType::I16 => f64::from(i16::from_le_bytes([b[0], b[1]])),
        DataType::U16 => f64::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::U32 => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        DataType::F32 => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
    }
}
