//! What the text in a TIFF file says of its pages: by ImageJ, by OME-XML, or by tifffile (`{"shape": ..}`).
//!
//! Each says how many slices, channels and times there are, in which order the pages hold them, and how far samples
//! are apart.

use std::collections::BTreeMap;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use serde_json::Value;

/// Text longer than this is not looked at: a million planes of OME take less.
const MAX_BYTES: usize = 256 << 20;

/// More pages than this no text can say.
const MAX_PAGES: u64 = 1 << 24;

/// What pages are numbered along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PageAxis {
    Slice,
    Channel,
    /// Times, and everything else.
    Time,
}

/// What a text says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Description {
    /// Who wrote it, for notes.
    pub(super) writer: &'static str,
    /// Sizes of the axes along which pages are numbered, the fastest first.
    pub(super) axes: Vec<(PageAxis, u64)>,
    /// The pages of this file by their plane, in the order of the axes, where the text lists them.
    pages: Option<BTreeMap<u64, u64>>,
    /// Distances of columns, rows and slices where they are said.
    pub(super) spacing: [Option<f64>; 3],
    pub(super) unit: Option<String>,
    pub(super) notes: Vec<String>,
}

impl Description {
    /// What a text says of so many pages, each of so many numbers in all and at one place; `None` if it is none of
    /// the three.
    pub(super) fn parse(text: &str, num_pages: u64, samples_each: u64, channels_each: u64) -> Option<Self> {
        if text.len() > MAX_BYTES {
            return None;
        }
        let found = if text.starts_with("ImageJ=") {
            Some(imagej(text))
        } else if text.starts_with('{') {
            shaped(text, samples_each, channels_each)
        } else if text.contains("<OME") || text.contains(":OME") {
            ome(text, num_pages, channels_each)
        } else {
            None
        };
        found.filter(|found| (1..=MAX_PAGES).contains(&found.num_pages()))
    }

    /// Pages that there should be.
    pub(super) fn num_pages(&self) -> u64 {
        self.axes.iter().fold(1, |pages, (_, size)| pages.saturating_mul(*size))
    }

    /// Values along one axis, all of its kind together.
    pub(super) fn size(&self, axis: PageAxis) -> u64 {
        self.axes.iter().filter(|(own, _)| *own == axis).fold(1, |n, (_, size)| n.saturating_mul(*size))
    }

    /// The page of a slice of one channel and one time; `None` where another file has it.
    pub(super) fn page(&self, slice: u64, channel: u64, time: u64) -> Option<u64> {
        let (mut plane, mut stride) = (0, 1);
        let mut rest = [slice, channel, time];
        for &(axis, size) in &self.axes {
            let rest = &mut rest[axis as usize];
            plane += *rest % size * stride;
            *rest /= size;
            stride *= size;
        }
        match &self.pages {
            None => Some(plane),
            Some(pages) => pages.get(&plane).copied(),
        }
    }
}

/// ImageJ: lines of `name=value`; channels are the fastest, then slices, then frames.
fn imagej(text: &str) -> Description {
    let value = |name: &str| {
        text.lines()
            .filter_map(|line| line.split_once('='))
            .find(|(own, _)| *own == name)
            .map(|(_, value)| value.trim())
    };
    let count = |name: &str| value(name).and_then(|text| text.parse::<u64>().ok()).filter(|&n| n > 0);
    let images = count("images");
    let sizes = [count("channels"), count("slices"), count("frames")];
    let product = sizes.iter().flatten().fold(1, |n: u64, size| n.saturating_mul(*size));
    let mut notes = Vec::new();
    let axes = match images {
        // Without axes, or with ones that do not fit, a stack.
        Some(images) if images != product => {
            if product > 1 {
                notes.push(format!("ImageJ says images={images}, but other channels, slices and frames"));
            }
            vec![(PageAxis::Slice, images)]
        }
        _ => {
            let kinds = [PageAxis::Channel, PageAxis::Slice, PageAxis::Time];
            kinds.into_iter().zip(sizes.map(|size| size.unwrap_or(1))).collect()
        }
    };
    let spacing = value("spacing").and_then(|text| text.parse::<f64>().ok()).map(f64::abs);
    let unit = value("unit").filter(|unit| !matches!(*unit, "" | "pixel" | "pixels"));
    // ImageJ writes the sign of micro as an escape.
    let unit = unit.map(|unit| unit.replace("\\u00B5", "\u{b5}"));
    Description {
        writer: "ImageJ",
        axes,
        spacing: [None, None, spacing.filter(|&spacing| spacing.is_finite() && spacing > 0.0)],
        unit,
        notes,
        ..Description::default()
    }
}

/// tifffile: the shape of the whole array, the slowest axis first, maybe with a letter for each axis.
fn shaped(text: &str, samples_each: u64, channels_each: u64) -> Option<Description> {
    let json: Value = serde_json::from_str(text).ok()?;
    let shape: Vec<u64> = json.get("shape")?.as_array()?.iter().map(Value::as_u64).collect::<Option<_>>()?;
    let total = shape.iter().try_fold(1_u64, |total, &n| total.checked_mul(n)).filter(|&total| total > 0)?;
    if total % samples_each != 0 {
        return None;
    }
    // The axes of a page are the last ones: they make up its samples.
    let (mut left, mut within) = (samples_each, shape.len());
    while left > 1 && within > 0 {
        within -= 1;
        left = if left.is_multiple_of(shape[within]) { left / shape[within] } else { return None };
    }
    // Axes of one do not matter, here least of all.
    while within > 0 && shape[within - 1] == 1 {
        within -= 1;
    }
    let letters: Vec<char> = json.get("axes").and_then(Value::as_str).unwrap_or_default().chars().collect();
    let has_letters = letters.len() == shape.len();
    let has_slices = letters[..within.min(letters.len())].contains(&'Z');
    let kind = |axis: usize| match letters.get(axis) {
        Some('Z') if has_letters => PageAxis::Slice,
        Some('C' | 'S') if has_letters && channels_each == 1 => PageAxis::Channel,
        Some('T' | 'C' | 'S') if has_letters => PageAxis::Time,
        // What has no name is slices, if it is the axis next to the pages.
        _ if axis + 1 == within && !(has_letters && has_slices) => PageAxis::Slice,
        _ => PageAxis::Time,
    };
    let axes = (0..within).rev().map(|axis| (kind(axis), shape[axis])).collect();
    let number = |name: &str| json.get(name).and_then(Value::as_f64).filter(|n| n.is_finite() && *n > 0.0);
    Some(Description {
        writer: "tifffile",
        axes,
        spacing: [
            number("PhysicalSizeX"),
            number("PhysicalSizeY"),
            number("spacing").or(number("PhysicalSizeZ")),
        ],
        unit: json.get("unit").and_then(Value::as_str).map(str::to_owned),
        ..Description::default()
    })
}

/// OME-XML: the first image.
fn ome(text: &str, num_pages: u64, channels_each: u64) -> Option<Description> {
    let mut reader = Reader::from_str(text);
    let (mut found, mut images) = (None::<Description>, 0);
    let mut sizes = [1; 3];
    loop {
        match reader.read_event().ok()? {
            Event::Start(element) | Event::Empty(element) => match element.local_name().as_ref() {
                "Pixels" => {
                    images += 1;
                    if images == 1 {
                        (found, sizes) = pixels(&element, channels_each)?;
                    }
                }
                "TiffData" if images == 1 => {
                    let description = found.as_mut()?;
                    add_planes(description, &element, sizes, num_pages)?;
                }
                _ => {}
            },
            Event::Eof => break,
            _ => {}
        }
    }
    let mut found = found?;
    if images > 1 {
        found.notes.push(format!("the file holds {images} images; the first is used"));
    }
    Some(found)
}

fn attribute(element: &BytesStart, name: &str) -> Option<String> {
    let attribute = element.try_get_attribute(name).ok()??;
    attribute.normalized_value(XmlVersion::Implicit1_0).ok().map(|value| value.into_owned())
}

fn whole(element: &BytesStart, name: &str) -> Option<u64> {
    attribute(element, name)?.trim().parse().ok()
}

/// Sizes, order and distances of the planes of an image, and the sizes by themselves: slices, channels, times.
fn pixels(element: &BytesStart, channels_each: u64) -> Option<(Option<Description>, [u64; 3])> {
    let size = |name: &str| whole(element, name).filter(|&n| n > 0).unwrap_or(1);
    // What the samples of a page hold is no axis of pages.
    let sizes = [size("SizeZ"), size("SizeC").div_ceil(channels_each), size("SizeT")];
    let order = attribute(element, "DimensionOrder").unwrap_or_else(|| "XYZCT".to_owned());
    let axes: Vec<(PageAxis, u64)> = order
        .chars()
        .filter_map(|letter| match letter {
            'Z' => Some((PageAxis::Slice, sizes[0])),
            'C' => Some((PageAxis::Channel, sizes[1])),
            'T' => Some((PageAxis::Time, sizes[2])),
            _ => None,
        })
        .collect();
    if axes.len() != 3 {
        return None;
    }
    let unit =
        |axis: &str| attribute(element, &format!("PhysicalSize{axis}Unit")).unwrap_or("\u{b5}m".to_owned());
    let first =
        ["X", "Y", "Z"].into_iter().find(|axis| attribute(element, &format!("PhysicalSize{axis}")).is_some());
    let common = first.map(unit);
    let length = |axis: &str| {
        let length: f64 = attribute(element, &format!("PhysicalSize{axis}"))?.trim().parse().ok()?;
        let factor =
            meters(&unit(axis)).zip(common.as_deref().and_then(meters)).map(|(own, common)| own / common);
        // Units that are no lengths are kept if they are the same.
        let factor = factor.or((Some(unit(axis)) == common).then_some(1.0))?;
        Some(length * factor).filter(|length| length.is_finite() && *length > 0.0)
    };
    let spacing = ["X", "Y", "Z"].map(length);
    Some((
        Some(Description { writer: "OME-XML", axes, spacing, unit: common, ..Description::default() }),
        sizes,
    ))
}

/// The length of a unit in metres.
fn meters(unit: &str) -> Option<f64> {
    Some(match unit {
        "m" => 1.0,
        "cm" => 1e-2,
        "mm" => 1e-3,
        "\u{b5}m" | "\u{3bc}m" | "um" | "micron" => 1e-6,
        "nm" => 1e-9,
        "pm" => 1e-12,
        "\u{c5}" | "\u{212b}" => 1e-10,
        "in" | "inch" => 0.0254,
        _ => return None,
    })
}

/// Which pages hold which planes; those of other files have none here.
fn add_planes(
    description: &mut Description,
    element: &BytesStart,
    [slices, channels, times]: [u64; 3],
    num_pages: u64,
) -> Option<()> {
    let first = [whole(element, "FirstZ"), whole(element, "FirstC"), whole(element, "FirstT")];
    let ifd = whole(element, "IFD");
    let count = whole(element, "PlaneCount");
    let total = description.num_pages();
    if total > MAX_PAGES || (ifd, count, first) == (None, None, [None; 3]) {
        // All planes in their order, which is what is done without any list.
        return Some(());
    }
    let pages = description.pages.get_or_insert_default();
    let indices = first.map(|index| index.unwrap_or(0));
    if indices[0] >= slices || indices[1] >= channels || indices[2] >= times {
        return None;
    }
    let (mut plane, mut stride) = (0, 1);
    for &(axis, size) in &description.axes {
        plane += indices[axis as usize] * stride;
        stride *= size;
    }
    // Without a count one plane where a page is named, otherwise all that are left.
    let count = count.unwrap_or(if ifd.is_some() { 1 } else { total }).min(total - plane);
    let ifd = ifd.unwrap_or(0);
    // Pages that are not there need no place.
    for step in 0..count.min(num_pages.saturating_sub(ifd)) {
        pages.insert(plane + step, ifd + step);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slices, channels and times of every order: each page is what a walk through the order says.
    #[test]
    fn pages_of_every_order_of_ome() {
        for order in ["XYZCT", "XYZTC", "XYCZT", "XYCTZ", "XYTZC", "XYTCZ"] {
            let text = format!(
                "<OME><Image><Pixels DimensionOrder=\"{order}\" SizeX=\"5\" SizeY=\"4\" SizeZ=\"3\" SizeC=\"2\" SizeT=\"4\"/></Image></OME>"
            );
            let description = Description::parse(&text, 24, 20, 1).unwrap();
            let size = |letter| match letter {
                'Z' => 3,
                'C' => 2,
                _ => 4,
            };
            let mut page = 0;
            let letters: Vec<char> = order[2..].chars().collect();
            for slowest in 0..size(letters[2]) {
                for middle in 0..size(letters[1]) {
                    for fastest in 0..size(letters[0]) {
                        let index = |letter| {
                            let place = letters.iter().position(|own| *own == letter).unwrap();
                            [fastest, middle, slowest][place]
                        };
                        let found = description.page(index('Z'), index('C'), index('T'));
                        assert_eq!(found, Some(page), "{order}");
                        page += 1;
                    }
                }
            }
            assert_eq!(page, description.num_pages());
        }
    }

    #[test]
    fn units_of_ome_become_one() {
        let text = "<OME:OME><OME:Pixels SizeZ=\"2\" PhysicalSizeX=\"0.25\" PhysicalSizeY=\"250\" \
                    PhysicalSizeYUnit=\"nm\" PhysicalSizeZ=\"0.002\" PhysicalSizeZUnit=\"mm\"/></OME:OME>";
        let found = Description::parse(text, 3, 1, 1).unwrap();
        let spacing = found.spacing.map(Option::unwrap);
        assert!(spacing.iter().zip([0.25, 0.25, 2.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{spacing:?}");
        assert_eq!(found.unit.as_deref(), Some("\u{b5}m"));
    }

    #[test]
    fn planes_that_ome_lists_are_where_it_says() {
        let text = "<OME><Pixels SizeZ=\"3\" SizeC=\"1\"><TiffData IFD=\"2\" FirstZ=\"0\"/>\
                    <TiffData IFD=\"0\" FirstZ=\"1\" PlaneCount=\"1\"/></Pixels></OME>";
        let found = Description::parse(text, 3, 1, 1).unwrap();
        assert_eq!([0, 1, 2].map(|slice| found.page(slice, 0, 0)), [Some(2), Some(0), None]);
    }
}
