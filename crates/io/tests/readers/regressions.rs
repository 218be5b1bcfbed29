//! What the fuzzer found, kept small.

use volery_io::transfer::TransferOptions;
use volery_io::{GridOptions, read_grid, read_transfer};

use crate::Folder;
use crate::make::zlib;
use crate::make_grid::exodus;

/// A tag of 2 million values in a file of 400 bytes made the decoder allocate 64 MiB before it could be
/// limited. (The allocation itself is measured by the fuzzer's harness.)
#[test]
fn tiff_tag_with_more_values_than_the_file_has_bytes() {
    let folder = Folder::new();
    for (order, file) in [
        ("little", *b"II*\0\x08\0\0\0\x01\0\0\x01\x04\0\x01\0\x20\0\x03\0\0\0\0\0\0\0"),
        ("big", *b"MM\0*\0\0\0\x08\0\x01\x01\0\0\x04\0\x20\0\x01\0\0\0\x03\0\0\0\0"),
    ] {
        let line = folder.refuse("a.tif", file);
        assert_eq!(
            line, "count of tag 256 is 2097153, expected as many values as 26 bytes can hold",
            "{order}"
        );
    }
}

/// A colour of 4.5 was resampled first, and then each of its many points was listed as a defect.
#[test]
fn colour_map_out_of_range_is_named_by_its_own_points() {
    let folder = Folder::new();
    let text = r#"{"ColorSpace": "Lab", "RGBPoints": [0, 0.1, 0.2, 0.3, 1, 1, 0, 4.5, 2, 3, 3, 3, 3, 3, 3, 3, 4, 9, 9, 9]}"#;
    let options = TransferOptions { map: None, range: None, unit_distance: 1.0 };
    let line = read_transfer(&folder.put("map.json", text), &options).unwrap_err().to_string();
    let expected = "transfer function: point 1: colour [1.0, 0.0, 4.5], expected three numbers in [0, 1]; \
        point 2: colour [3.0, 3.0, 3.0], expected three numbers in [0, 1]; \
        point 3: colour [3.0, 3.0, 3.0], expected three numbers in [0, 1]; and 1 more";
    assert!(line.ends_with(expected), "{line}");
}

/// A palette with a part of a colour at its end, its checksum right, made the PNG decoder panic.
#[test]
fn png_palette_that_is_not_of_whole_colours() {
    let folder = Folder::new();
    let chunk = |name: &[u8; 4], data: &[u8]| {
        let named = [&name[..], data].concat();
        let mut crc = flate2::Crc::new();
        crc.update(&named);
        [&(data.len() as u32).to_be_bytes()[..], &named, &crc.sum().to_be_bytes()].concat()
    };
    for (color_type, palette) in [(3, 4), (3, 0), (3, 257 * 3), (2, 7)] {
        let file = [
            b"\x89PNG\r\n\x1a\n".to_vec(),
            chunk(b"IHDR", &[0, 0, 0, 1, 0, 0, 0, 1, 8, color_type, 0, 0, 0]),
            chunk(b"PLTE", &vec![9; palette]),
            chunk(b"tRNS", &[1, 2, 3]),
            chunk(b"IDAT", &zlib(&[0, 0, 0, 0])),
            chunk(b"IEND", &[]),
        ];
        let line = folder.refuse("a.png", file.concat());
        assert_eq!(line, format!("PLTE is {palette} bytes, expected 1 to 256 colours of 3 bytes"));
    }
}

/// Names of no letter take no byte of the file, so 262146 of them passed every check of its size and made 58 MB.
#[test]
fn exodus_names_of_no_letter() {
    let folder = Folder::new();
    let mut file = exodus().file();
    for (dim, length) in [(&b"len_string\0\0"[..], 0_u32), (b"num_nod_var\0", 262_146)] {
        let start = file.windows(dim.len()).position(|window| window == dim).unwrap() + dim.len();
        file[start..start + 4].copy_from_slice(&length.to_be_bytes());
    }
    let line = read_grid(&folder.put("a.ex2", file), &GridOptions::default()).unwrap_err().to_string();
    let expected = "name_nod_var is 262146 x 0, expected 1 to 65536 names of at least 1 letter";
    assert!(line.ends_with(expected), "{line}");
}
