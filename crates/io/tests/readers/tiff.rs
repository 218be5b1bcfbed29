//! TIFF: what pages are, how far samples are apart, every type of number, and what is refused.

use volery_io::ByteOrder::{Big, Little};
use volery_io::{ReadOptions, read_volume};
use volery_scene::SampleType;

use crate::make_tiff::{Page, file, little, long, numbered, ratio, short, text};
use crate::{Folder, assert_values, refuse};

const DESCRIPTION: u16 = 270;

fn described(count: u64, description: &str) -> Vec<u8> {
    let mut pages = numbered(count);
    pages[0] = pages[0].clone().with(&[text(DESCRIPTION, description)]);
    little(&pages)
}

fn options(channel: Option<usize>, time_step: Option<usize>) -> ReadOptions {
    ReadOptions { channel, time_step, ..ReadOptions::default() }
}

/// What a file says, with the sizes of slices, channels and times 2, 3, 2, and which is the fastest.
const TWELVE_PAGES: [(&str, [u64; 3]); 5] = [
    ("ImageJ=1.53t\nimages=12\nchannels=3\nslices=2\nframes=2\nhyperstack=true\n", [3, 1, 6]),
    (
        "<OME xmlns=\"x\"><Image><Pixels DimensionOrder=\"XYZCT\" SizeX=\"2\" SizeY=\"1\" SizeZ=\"2\" SizeC=\"3\" SizeT=\"2\"/></Image></OME>",
        [1, 2, 6],
    ),
    (
        "<OME:OME><OME:Image><OME:Pixels DimensionOrder=\"XYTCZ\" SizeX=\"2\" SizeY=\"1\" SizeZ=\"2\" SizeC=\"3\" SizeT=\"2\"/></OME:Image></OME:OME>",
        [6, 2, 1],
    ),
    ("{\"shape\": [2, 3, 2, 1, 2], \"axes\": \"TCZYX\"}", [1, 2, 6]),
    ("{\"shape\": [2, 2, 3, 1, 2], \"axes\": \"ZTCYX\"}", [6, 1, 3]),
];

#[test]
fn slices_channels_and_times_are_told_apart() {
    let folder = Folder::new();
    for (description, [slice_step, channel_step, time_step]) in TWELVE_PAGES {
        let path = folder.put("a.tif", described(12, description));
        for channel in 0..3_u64 {
            for time in 0..2_u64 {
                let options = options(Some(channel as usize), Some(time as usize));
                let volume = read_volume(&path, &options).unwrap_or_else(|error| panic!("{error}"));
                assert_eq!(volume.grid.dims(), [2, 1, 2], "{description}");
                let page = |slice| 10 * (slice * slice_step + channel * channel_step + time * time_step);
                let expected = [0, 1].map(page).map(|first| [first, first + 1]);
                let expected: Vec<f64> = expected.concat().into_iter().map(|value| value as f64).collect();
                assert_values(&volume, &expected);
            }
        }
        let volume = folder.read("a.tif", described(12, description));
        assert_eq!(
            volume.notes,
            [
                "the file holds 2 volumes; the first is used (another, 0 to 1, can be chosen)",
                "channel 0 of 3 is used (another one, 0 to 2, can be chosen)"
            ]
        );
        assert_eq!(refuse(&path, &options(Some(3), None)), "channel asked for is 3, expected 0 to 2");
        assert_eq!(refuse(&path, &options(None, Some(2))), "time step asked for is 2, expected 0 to 1");
    }
    // A file without a word about its pages is a stack.
    assert_eq!(folder.read("a.tif", little(&numbered(12))).grid.dims(), [2, 1, 12]);
    let movie = folder.read("a.tif", described(3, "ImageJ=1.53t\nimages=3\nframes=3\n"));
    assert_eq!((movie.grid.dims(), movie.notes.len()), ([2, 1, 1], 1));
}

#[test]
fn voxel_sizes_come_from_text_and_tags() {
    let folder = Folder::new();
    let resolution = [ratio(282, 4, 1), ratio(283, 2, 1)];
    let ome = "<OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"3\" PhysicalSizeX=\"0.25\" PhysicalSizeY=\"500\" \
               PhysicalSizeYUnit=\"nm\" PhysicalSizeZ=\"0.002\" PhysicalSizeZUnit=\"mm\"/></Image></OME>";
    let cases = [
        (
            "ImageJ=1.53t\nimages=3\nslices=3\nunit=micron\nspacing=-2.0\n",
            1,
            [0.25, 0.5, 2.0],
            "the spacing is in micron",
        ),
        (ome, 2, [0.25, 0.5, 2.0], "the spacing is in \u{b5}m"),
        (
            "{\"shape\": [3, 1, 2], \"spacing\": 2, \"unit\": \"nm\"}",
            1,
            [0.25, 0.5, 2.0],
            "the spacing is in nm",
        ),
        // 4 and 2 samples for each centimetre, and for each inch.
        ("", 3, [2.5, 5.0, 2.5], "the spacing is in mm"),
        ("", 2, [6.35, 12.7, 6.35], "the spacing is in mm"),
    ];
    for (description, unit, expected, note) in cases {
        let mut pages = numbered(3);
        pages[0] =
            pages[0].clone().with(&resolution).with(&[short(296, &[unit]), text(DESCRIPTION, description)]);
        let volume = folder.read("a.tif", little(&pages));
        let found = volume.grid.spacing().to_array();
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{description}: {found:?}");
        assert!(volume.notes.iter().any(|found| found == note), "{:?}", volume.notes);
    }
    let volume = folder.read("a.tif", little(&numbered(3)));
    assert_eq!((volume.grid.spacing().to_array(), volume.notes.len()), ([1.0; 3], 0));
}

#[test]
fn large_stacks_of_one_directory_are_read_whole() {
    let folder = Folder::new();
    for description in ["ImageJ=1.53t\nimages=3\nslices=3\n", "{\"shape\": [3, 1, 2], \"truncated\": true}"] {
        for order in [Little, Big] {
            let page = Page::gray(2, 1, 16, crate::make::encode(SampleType::U16, order, &[1.0, 2.0]));
            let page = page.with(&[text(DESCRIPTION, description)]);
            let behind = crate::make::encode(SampleType::U16, order, &[300.0, 4.0, 5.0, 60_000.0]);
            let whole = file(order, false, std::slice::from_ref(&page), &behind);
            let volume = folder.read("a.tif", &whole);
            assert_eq!(volume.grid.dims(), [2, 1, 3]);
            assert_values(&volume, &[1.0, 2.0, 300.0, 4.0, 5.0, 60_000.0]);
            let line = folder.refuse("a.tif", &whole[..whole.len() - 1]);
            assert_eq!(line, "the data of all pages holds 11 bytes, expected 12");
        }
    }
    // A stack that is packed cannot go on behind its first page.
    let page = Page::gray(2, 1, 8, vec![1, 7, 7])
        .with(&[short(259, &[32_773]), text(DESCRIPTION, "ImageJ=1\nimages=3\n")]);
    assert_eq!(
        folder.refuse("a.tif", little(&[page])),
        "number of pages is 1, expected 3 by the text of ImageJ"
    );
}

#[test]
fn smaller_copies_and_masks_are_no_slices() {
    let folder = Folder::new();
    let full = numbered(2);
    let small = |kind: &[_]| Page::gray(1, 1, 8, vec![99]).with(kind);
    let mask = Page::gray(2, 1, 1, vec![0x80]).with(&[long(254, &[4])]);
    for pages in [
        vec![full[0].clone(), small(&[long(254, &[1])]), full[1].clone()],
        vec![small(&[long(254, &[1])]), full[0].clone(), full[1].clone()],
        vec![small(&[short(255, &[2])]), full[0].clone(), full[1].clone()],
        vec![full[0].clone(), full[1].clone(), small(&[])],
        vec![full[0].clone(), mask, full[1].clone()],
    ] {
        let volume = folder.read("a.tif", little(&pages));
        assert_eq!(volume.grid.dims(), [2, 1, 2]);
        assert_values(&volume, &[0.0, 1.0, 10.0, 11.0]);
        assert_eq!(volume.notes, ["pages left out, of other sizes, smaller copies or masks: 1"]);
    }
}

#[test]
fn values_are_as_stored_where_white_is_zero_and_in_palettes() {
    let folder = Folder::new();
    let palette: Vec<u64> = (0..768).map(|i| i * 85 % 65_536).collect();
    for sample in crate::make::SCALARS {
        let bits = 8 * sample.bytes() as u64;
        let format = match sample {
            SampleType::I8 | SampleType::I16 | SampleType::I32 => 2,
            SampleType::F32 | SampleType::F64 => 3,
            _ => 1,
        };
        let data = crate::make::encode(sample, Little, &[3.0, 34.0]);
        let page = Page::gray(2, 1, bits, data).with(&[short(262, &[0]), short(339, &[format])]);
        let volume = folder.read("a.tif", little(&[page]));
        assert_eq!(volume.grid.sample_type(), sample);
        assert_values(&volume, &[3.0, 34.0]);
        assert_eq!(volume.notes, ["small values are white in the file; values are as they are stored"]);
    }
    let labels = Page::gray(2, 1, 8, vec![3, 1]).with(&[short(262, &[3]), short(320, &palette)]);
    let volume = folder.read("a.tif", little(&[labels]));
    assert_values(&volume, &[3.0, 1.0]);
    assert_eq!(volume.notes, ["the values are numbers of colours in a palette, which is not used"]);
}

#[test]
fn bits_halves_and_numbers_of_64_bits() {
    let folder = Folder::new();
    for (bits, data, expected) in [
        (1, vec![0b0110_0000], vec![0.0, 1.0, 1.0]),
        (2, vec![0b1101_1000], vec![3.0, 1.0, 2.0]),
        (4, vec![0x1f, 0x30], vec![1.0, 15.0, 3.0]),
    ] {
        let volume = folder.read("a.tif", little(&[Page::gray(3, 1, bits, data)]));
        assert_eq!(volume.grid.sample_type(), SampleType::U8);
        assert_values(&volume, &expected);
    }
    for order in [Little, Big] {
        // 1.5, -2 and the smallest half above 0.
        let halves =
            [0x3e00_u16, 0xc000, 0x0001].map(|half| if order == Big { half.swap_bytes() } else { half });
        let data = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let page = Page::gray(3, 1, 16, data).with(&[short(339, &[3])]);
        let volume = folder.read("a.tif", file(order, order == Big, &[page], b""));
        assert_eq!(volume.grid.sample_type(), SampleType::F32);
        assert_values(&volume, &[1.5, -2.0, 2.0_f64.powi(-24)]);
        for (format, number) in [(1, 1_u64 << 40), (2, -3_i64 as u64)] {
            let number = if order == Big { number.swap_bytes() } else { number };
            let page = Page::gray(1, 1, 64, number.to_le_bytes().to_vec()).with(&[short(339, &[format])]);
            let volume = folder.read("a.tif", file(order, false, &[page], b""));
            assert_eq!(volume.grid.sample_type(), SampleType::F64);
            assert_values(&volume, &[if format == 1 { 1_099_511_627_776.0 } else { -3.0 }]);
        }
    }
}

#[test]
fn planes_apart_make_the_same_as_samples_together() {
    let folder = Folder::new();
    let of = |photometric, samples: u64, extra: &[u64], planar, chunks: &[&[u8]]| {
        let mut page = Page::gray(2, 1, 8, Vec::new()).with(&[
            short(258, &vec![8; samples as usize]),
            short(262, &[photometric]),
            short(277, &[samples]),
            short(284, &[planar]),
        ]);
        if !extra.is_empty() {
            page = page.with(&[short(338, extra)]);
        }
        page.chunks = chunks.iter().map(|chunk| chunk.to_vec()).collect();
        little(&[page])
    };
    for file in
        [of(2, 3, &[], 1, &[&[10, 20, 30, 11, 21, 31]]), of(2, 3, &[], 2, &[&[10, 11], &[20, 21], &[30, 31]])]
    {
        let volume = folder.read("a.tif", &file);
        assert_eq!(volume.grid.sample_type(), SampleType::Rgb8);
        assert_values(&volume, &[10.0, 20.0, 30.0, 11.0, 21.0, 31.0]);
        let green = read_volume(&folder.put("a.tif", &file), &options(Some(1), None)).unwrap();
        assert_values(&green, &[20.0, 21.0]);
    }
    for file in [
        of(2, 4, &[2], 1, &[&[1, 2, 3, 4, 5, 6, 7, 8]]),
        of(2, 4, &[2], 2, &[&[1, 5], &[2, 6], &[3, 7], &[4, 8]]),
        of(2, 5, &[1, 0], 1, &[&[1, 2, 3, 4, 99, 5, 6, 7, 8, 99]]),
    ] {
        assert_values(&folder.read("a.tif", &file), &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
    }
    let note = |file: &[u8]| folder.read("a.tif", file).notes.join("; ");
    for file in [of(1, 2, &[0], 1, &[&[7, 8, 9, 6]]), of(1, 2, &[0], 2, &[&[7, 9], &[8, 6]])] {
        assert_values(&folder.read("a.tif", &file), &[7.0, 9.0]);
        assert_eq!(note(&file), "channel 0 of 2 is used (another one, 0 to 1, can be chosen)");
        let other = read_volume(&folder.put("a.tif", &file), &options(Some(1), None)).unwrap();
        assert_values(&other, &[8.0, 6.0]);
    }
    let file = of(1, 2, &[2], 1, &[&[7, 8, 9, 6]]);
    assert_values(&folder.read("a.tif", &file), &[7.0, 9.0]);
    assert_eq!(note(&file), "the opacities beside the gray values are not used");
}

/// A page of 5 x 3 in tiles of 2 x 2, and one of 3 x 2 x 3 in bricks of 2 x 2 x 2.
#[test]
fn tiles_and_layers_lie_where_they_should() {
    let folder = Folder::new();
    let tags = |width, height, tile: [u64; 2]| {
        let page = Page { is_tiled: true, chunks: Vec::new(), ..Page::gray(width, height, 8, Vec::new()) };
        page.with(&[short(322, &tile[..1]), short(323, &tile[1..])])
    };
    let value = |x: usize, y: usize, z: usize| (x + 10 * y + 100 * z) as u8;
    let mut page = tags(5, 3, [2, 2]);
    for (ty, tx) in (0..2).flat_map(|ty| (0..3).map(move |tx| (ty, tx))) {
        let tile = (0..4).map(|i| value(2 * tx + i % 2, 2 * ty + i / 2, 0));
        page.chunks.push(tile.collect());
    }
    let volume = folder.read("a.tif", little(&[page]));
    let expected: Vec<f64> = (0..15).map(|i| f64::from(value(i % 5, i / 5, 0))).collect();
    assert_values(&volume, &expected);

    let mut page = tags(3, 2, [2, 2]).with(&[long(32_997, &[3]), long(32_998, &[2])]);
    for (tz, tx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let brick = (0..8).map(|i| value((2 * tx + i % 2).min(2), i / 2 % 2, (2 * tz + i / 4).min(2)) / 2);
        page.chunks.push(brick.collect());
    }
    let volume = folder.read("a.tif", little(&[page.clone()]));
    assert_eq!(volume.grid.dims(), [3, 2, 3]);
    let expected: Vec<f64> = (0..18).map(|i| f64::from(value(i % 3, i / 3 % 2, i / 6) / 2)).collect();
    assert_values(&volume, &expected);
    page.chunks.pop();
    let line = folder.refuse("a.tif", little(&[page]));
    assert!(line.contains("fewer strips or tiles than its size needs"), "{line}");

    // Two layers in strips of one row.
    let mut page = Page::gray(2, 2, 8, Vec::new()).with(&[long(32_997, &[2]), long(278, &[1])]);
    page.chunks = vec![vec![1, 2], vec![3, 4], vec![5, 6], vec![7, 8]];
    let volume = folder.read("a.tif", little(&[page]));
    assert_eq!(volume.grid.dims(), [2, 2, 2]);
    assert_values(&volume, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
}

#[test]
fn what_cannot_be_read_is_named_and_not_called_damaged() {
    let folder = Folder::new();
    let gray = || Page::gray(2, 1, 8, vec![1, 2]);
    let cases = [
        (
            gray().with(&[short(262, &[5]), short(277, &[4]), short(258, &[8; 4])]),
            "colour is CMYK, expected gray, RGB",
        ),
        (
            gray().with(&[short(262, &[8]), short(277, &[3]), short(258, &[8; 3])]),
            "colour is L*a*b*, expected gray",
        ),
        (gray().with(&[short(258, &[12])]), "BitsPerSample is 12, expected 1, 2, 4, 8, 16, 32 or 64"),
        (
            gray().with(&[short(258, &[24]), short(339, &[3])]),
            "BitsPerSample is 24, expected 16, 32 or 64 for real",
        ),
        (gray().with(&[short(339, &[6])]), "SampleFormat is 6, expected 1, 2 or 3"),
        (
            gray().with(&[short(277, &[2]), short(258, &[8, 16])]),
            "BitsPerSample is 8, 16, expected the same for all samples",
        ),
        (gray().with(&[short(259, &[50_000])]), "the TIFF file's way to store samples is"),
        (gray().with(&[short(259, &[34_712])]), "the TIFF file's way to store samples is"),
    ];
    for (page, expected) in cases {
        let line = folder.refuse("a.tif", little(&[page]));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let mut ring = little(&numbered(1));
    let at = ring.windows(2).rposition(|pair| pair == [0x17, 0x01]).map_or(0, |at| at + 12);
    let directory = ring[4..8].to_vec();
    ring[at..at + 4].copy_from_slice(&directory);
    assert_eq!(folder.refuse("a.tif", ring), "the TIFF file is damaged: its directories form a ring");
    let set = "<OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"2\"><TiffData IFD=\"0\" FirstZ=\"0\" PlaneCount=\"1\"/>\
               <TiffData IFD=\"5\" FirstZ=\"1\" PlaneCount=\"1\"/></Pixels></Image></OME>";
    let line = folder.refuse("a.tif", described(1, set));
    assert_eq!(
        line,
        "pages that OME-XML names is in other files, expected slices of this file: it is one of a set of files"
    );
}

#[test]
fn every_orientation_tag_says_where_row_and_column_0_are() {
    let folder = Folder::new();
    // Where the first sample, the last of the first row and the last of the first column lie, of 3 x 2.
    let corners = [
        (1, [0, 0], [2, 0], [0, 1]),
        (2, [2, 0], [0, 0], [2, 1]),
        (3, [2, 1], [0, 1], [2, 0]),
        (4, [0, 1], [2, 1], [0, 0]),
        (5, [0, 0], [0, 2], [1, 0]),
        (6, [1, 0], [1, 2], [0, 0]),
        (7, [1, 2], [1, 0], [0, 2]),
        (8, [0, 2], [0, 0], [1, 2]),
    ];
    for (orientation, first, row_end, column_end) in corners {
        let page = Page::gray(3, 2, 8, vec![1; 6]).with(&[short(274, &[orientation])]);
        let volume = folder.read("a.tif", little(&[page]));
        for (index, expected) in [([0.0, 0.0], first), ([2.0, 0.0], row_end), ([0.0, 1.0], column_end)] {
            let [x, y] = index;
            let found = volume.grid.world_from_index().transform_point3(glam::DVec3::new(x, y, 0.0));
            assert_eq!(found.to_array(), [expected[0].into(), expected[1].into(), 0.0], "{orientation}");
        }
        assert_eq!(volume.orientation().note().is_some(), orientation != 1, "{orientation}");
        assert_eq!(volume.orientation().is_mirrored(), matches!(orientation, 2 | 4 | 5 | 7), "{orientation}");
    }
}
