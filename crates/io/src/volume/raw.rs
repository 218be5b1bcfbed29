//! Raw files: samples and nothing else. Dims, type and spacing come from the caller, or from a name in the
//! manner of the Open SciVis Datasets, `engine_256x256x128_uint8.raw`, whose words may stand in any order.

use std::path::Path;

use super::{Decoded, compression_of_name, lower_name};
use crate::bytes::{self, Compression, has_more, open_stream, read_samples, samples_at};
use crate::choice::{checked_channel, wanted_volume};
use crate::error::{Problem, quoted};
use crate::layout::{Element, Layout, checked_spacing};
use crate::volume::ReadOptions;

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let name = lower_name(path);
    let (dims, element) = match (options.dims, options.element) {
        (Some(dims), Some(element)) => (dims.map(|n| n as u64), element),
        (dims, element) => {
            let (name_dims, name_element) = from_name(&name)?;
            (dims.map_or(name_dims, |dims| dims.map(|n| n as u64)), element.unwrap_or(name_element))
        }
    };
    let layout = Layout::new("dims", dims, element.sample, element.order, options)?;
    let mut notes = Vec::new();
    wanted_volume(1, options.time_step, &mut notes)?;
    checked_channel(1, options.channel)?;
    let spacing = checked_spacing("spacing", [1.0; 3], layout.dims, options, &mut notes)?;
    let compression = compression_of_name(path);
    let expected = layout.num_bytes();
    let samples = if compression == Compression::None {
        let bytes = bytes::load(path)?;
        let found = bytes.len() as u64;
        if found != expected {
            return Err(Problem::Size { what: "the file", found, expected });
        }
        samples_at(bytes, 0, &layout)?
    } else {
        let what = compression.stream_name();
        let mut stream = open_stream(path, compression)?;
        let samples = read_samples(&mut *stream, what, &layout)?;
        if has_more(&mut *stream, what)? {
            return Err(Problem::Size { what, found: expected + 1, expected });
        }
        samples
    };
    Ok(Decoded::new(layout.dims, spacing, samples, notes))
}

/// Dims and type as the name gives them: `.._256x256x128_uint8.raw`.
fn from_name(name: &str) -> Result<([u64; 3], Element), Problem> {
    let stem = name.split_once(".raw").map_or(name, |(stem, _)| stem);
    // Of several words that would do, the last ones.
    let words = || stem.rsplit(['_', '-', '.', ' ']);
    let element = words().find_map(|word| word.parse().ok());
    let dims = words().find_map(parse_dims);
    dims.zip(element).ok_or_else(|| {
        let expected = "one such as name_256x256x128_uint8.raw, or dims and dtype (--dims, --dtype)";
        Problem::field("file name", quoted(name), expected)
    })
}

fn parse_dims(word: &str) -> Option<[u64; 3]> {
    let mut numbers = word.split('x').map(|number| number.parse().ok());
    let dims = [numbers.next()??, numbers.next()??, numbers.next()??];
    numbers.next().is_none().then_some(dims)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::ByteOrder;
    use volery_scene::SampleType;

    #[test]
    fn names_tell_dims_and_type() {
        let (dims, element) = from_name("hydrogen_atom_128x64x3_uint8.raw.gz").unwrap();
        assert_eq!((dims, element.sample), ([128, 64, 3], SampleType::U8));
        let (_, element) = from_name("tooth16_103x94x161_uint16be.raw").unwrap();
        assert_eq!(element, Element { sample: SampleType::U16, order: ByteOrder::Big });
        for name in [
            "v-5x4x3-uint16.raw",
            "v.5x4x3_uint16.raw",
            "v_uint16_5x4x3.raw",
            "v_5x4x3_u16_le.raw",
            "v_5x4x3_ushort.raw",
        ] {
            let (dims, element) = from_name(name).unwrap();
            assert_eq!((dims, element.sample), ([5, 4, 3], SampleType::U16), "{name}");
        }
        for name in ["a.raw", "a_1x2_uint8.raw", "a_1x2x3x4_uint8.raw", "a_1x2x3_int7.raw", "_.raw", ""] {
            assert!(from_name(name).is_err(), "{name}");
        }
    }
}
