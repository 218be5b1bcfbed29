use volery_io::{Format, ReadOptions, read_volume};
use volery_scene::SampleType;

use crate::make::{ORDERS, SCALARS, VTI_DATA, Vti, VtiData, values};
use crate::{Folder, assert_values, assert_volume, refuse};

#[test]
fn every_type_order_encoding_compression_and_header_width() {
    let folder = Folder::new();
    for sample in SCALARS {
        for order in ORDERS {
            for data in VTI_DATA {
                for (compressed, wide) in [(false, false), (false, true), (true, false), (true, true)] {
                    let vti = Vti { sample, order, data, compressed, wide };
                    let volume = folder.read("a.vti", vti.file());
                    assert_eq!(volume.format, Format::Vti);
                    assert_eq!(volume.array.as_deref(), Some("density"));
                    assert_volume(&volume, sample, [1.0, 2.0, 0.5], &values(sample));
                }
            }
        }
    }
}

#[test]
fn colours_of_three_and_four_components() {
    let folder = Folder::new();
    let values: Vec<f64> = (0..24).map(f64::from).collect();
    for data in VTI_DATA {
        for (components, extent, dims) in [(3, "0 3 0 1 0 0", [4, 2, 1]), (4, "0 2 0 0 0 1", [3, 1, 2])] {
            let attributes = format!("NumberOfComponents=\"{components}\"");
            let file = Vti::new(SampleType::U8, data).file_of(&values, extent, "PointData", &attributes);
            let volume = folder.read("a.vti", file);
            assert_eq!(volume.grid.dims(), dims);
            assert_values(&volume, &values);
        }
    }
}

#[test]
fn cell_data_become_samples_at_cell_centres() {
    let folder = Folder::new();
    let file = Vti::new(SampleType::I16, VtiData::AppendedRaw);
    let values = values(SampleType::I16);
    let volume = folder.read("a.vti", file.file_of(&values, "0 3 0 2 4 6", "CellData", ""));
    assert_eq!(volume.grid.dims(), [3, 2, 2]);
    assert_values(&volume, &values);
    assert_eq!(volume.notes.len(), 1);
    // A flat image has one layer of cells.
    let volume = folder.read("a.vti", file.file_of(&values, "0 4 0 3 7 7", "CellData", ""));
    assert_eq!(volume.grid.dims(), [4, 3, 1]);
}

const SEVERAL: &str = r#"<VTKFile type="ImageData" byte_order="LittleEndian">
<!-- the older form, without header_type -->
<ImageData WholeExtent="0 1 0 0 0 0" Spacing="1 1 1"><Piece Extent="0 1 0 0 0 0">
<PointData Scalars="b&amp;c">
<DataArray type="Float32" Name="velocity" NumberOfComponents="3" format="ascii">1 2 3 4 5 6</DataArray>
<DataArray type="UInt8" Name="a" format="ascii">1 2</DataArray>
<DataArray type="UInt8" Name="b&amp;c" format="ascii"> 3
 4 </DataArray>
</PointData>
<CellData Scalars="x"><DataArray type="UInt8" Name="x" format="ascii">5</DataArray></CellData>
</Piece></ImageData></VTKFile>"#;

#[test]
fn the_array_is_the_one_asked_for_else_active_else_first_that_can_be_read() {
    let folder = Folder::new();
    let path = folder.put("a.vti", SEVERAL);
    let read = |name: &str| {
        read_volume(&path, &ReadOptions { array: Some(name.to_owned()), ..ReadOptions::default() }).unwrap()
    };
    assert_values(&read("a"), &[1.0, 2.0]);
    assert_values(&read("x"), &[5.0]);
    let active = folder.read("a.vti", SEVERAL);
    assert_eq!(active.array.as_deref(), Some("b&c"));
    assert_values(&active, &[3.0, 4.0]);
    let first = folder.read("a.vti", SEVERAL.replace(r#" Scalars="b&amp;c""#, ""));
    assert_eq!(first.array.as_deref(), Some("a"));
    folder.put("a.vti", SEVERAL);
    let options = |name: &str| ReadOptions { array: Some(name.to_owned()), ..ReadOptions::default() };
    let line = refuse(&path, &options("q"));
    assert_eq!(line, "array is 'q', expected one of 'velocity, a, b&c, x'");
    let velocity = read("velocity");
    assert_values(&velocity, &[14.0, 77.0].map(|squares: f64| f64::from(squares.sqrt() as f32)));
    assert!(velocity.notes[0].contains("3 components; their magnitude is used"), "{:?}", velocity.notes);
}

/// What to replace by what in [`SEVERAL`], and how the refusal begins.
const LIES: &[(&str, &str, &str)] = &[
    ("type=\"ImageData\"", "type=\"PolyData\"", "type is 'PolyData', expected ImageData"),
    ("LittleEndian", "MiddleEndian", "byte_order is 'MiddleEndian', expected LittleEndian or BigEndian"),
    (
        "byte_order",
        "compressor=\"vtkBrotliDataCompressor\" byte_order",
        "compressor is 'vtkBrotliDataCompressor', expected",
    ),
    ("byte_order", "header_type=\"UInt8\" byte_order", "header_type is 'UInt8', expected UInt32 or UInt64"),
    ("<VTKFile", "<svg/><VTKFile", "root element is 'svg', expected VTKFile"),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"0 1 0 0 0\"",
        "Extent is '0 1 0 0 0', expected 6 numbers",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"1 0 0 0 0 0\"",
        "Extent is '[1, 0, 0, 0, 0, 0]', expected rising",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"-9223372036854775808 9223372036854775807 0 0 0 0\"",
        "Extent is",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"0 9223372036854775806 0 9 0 9\"",
        "the volume needs 922337203685477580700 bytes",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"0 2 0 0 0 0\"",
        "count of numbers in the array is 2, expected 3",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"0 0 0 0 0 0\"",
        "count of numbers in the array is more, expected 1",
    ),
    (
        "Piece Extent=\"0 1 0 0 0 0\"",
        "Piece Extent=\"0 60000000000 0 0 0 0\"",
        "count of numbers in the array is 2, expected 60000000001",
    ),
    (
        "</Piece>",
        "</Piece><Piece Extent=\"1 2 0 0 0 0\"></Piece>",
        "array 'b&c' is missing, expected one as in",
    ),
    ("Spacing=\"1 1 1\"", "Spacing=\"nan 1 1\"", "Spacing of axis 0 is NaN"),
    ("Spacing=\"1 1 1\"", "Spacing=\"1 1\"", "Spacing is '1 1', expected 3 numbers"),
    ("Spacing=\"1 1 1\"", "Spacing=\"0 1 1\"", "Spacing of axis 0 is 0"),
    ("> 3", "> 333", "the data of the array is '333', expected a number of its type"),
    (
        "\"b&amp;c\" format=\"ascii\"",
        "\"b&amp;c\" format=\"hex\"",
        "format is 'hex', expected ascii, binary or appended",
    ),
    (
        "\"b&amp;c\" format=\"ascii\"",
        "\"b&amp;c\" format=\"appended\" offset=\"0\"",
        "AppendedData is missing",
    ),
    ("\"b&amp;c\" format=\"ascii\"", "\"b&amp;c\" format=\"binary\"", "the data of the array is damaged"),
    ("</ImageData></VTKFile>", "</VTKFile>", "the XML is damaged: "),
    ("</PointData>", "<DataArray></PointData>", "the XML is damaged: "),
];

#[test]
fn lying_attributes() {
    let folder = Folder::new();
    for &(from, to, expected) in LIES {
        assert!(SEVERAL.contains(from), "{from}");
        let line = folder.refuse("a.vti", SEVERAL.replacen(from, to, 1));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let none =
        "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 1\"><Piece/></ImageData></VTKFile>";
    assert_eq!(folder.refuse("a.vti", none), "DataArray is missing, expected one in PointData or CellData");
    assert_eq!(
        folder.refuse("a.vti", "hello"),
        "DataArray is missing, expected one in PointData or CellData"
    );
    assert!(folder.refuse("a.vti", b"<VTKFile \xff\xfe>").starts_with("the XML is damaged"));
}

#[test]
fn truncated_at_every_byte_before_the_data_end() {
    let folder = Folder::new();
    for data in VTI_DATA {
        for compressed in [false, true] {
            let vti = Vti { compressed, ..Vti::new(SampleType::U16, data) };
            let file = vti.file();
            // Raw appended data need no end tag: what follows them does not matter.
            let end = match data {
                VtiData::AppendedRaw => file.len() - "\n</AppendedData>\n</VTKFile>\n".len(),
                VtiData::AppendedBase64 => file.len() - "=\n</AppendedData>\n</VTKFile>\n".len(),
                _ => {
                    file.len()
                        - "\n</DataArray>".len()
                        - "</PointData>\n</Piece>\n</ImageData>\n</VTKFile>\n".len()
                }
            };
            for cut in 0..end {
                folder.refuse("a.vti", &file[..cut]);
            }
        }
    }
}

#[test]
fn block_tables_that_lie() {
    let folder = Folder::new();
    let table = |words: &[u32], data: &[u8]| {
        let mut file =
            br#"<VTKFile type="ImageData" byte_order="LittleEndian" compressor="vtkZLibDataCompressor">
<ImageData WholeExtent="0 2 0 1 0 1"><Piece><PointData><DataArray type="UInt8" format="appended" offset="0"/>
</PointData></Piece></ImageData><AppendedData encoding="raw">_"#
                .to_vec();
        file.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(data);
        file
    };
    let packed = crate::make::zlib(&[7; 12]);
    let size = packed.len() as u32;
    assert_values(&folder.read("a.vti", table(&[1, 12, 0, size], &packed)), &[7.0; 12]);
    assert_values(&folder.read("a.vti", table(&[1, 99, 12, size], &packed)), &[7.0; 12]);
    for (words, expected) in [
        (&[0, 0, 0][..], "the array by its block table holds 0 bytes, expected 12"),
        (&[0, 12, 12], "the array by its block table holds 0 bytes, expected 12"),
        (&[2, 12, 0, size, size], "the array by its block table holds 24 bytes, expected 12"),
        (&[u32::MAX, u32::MAX, 5], "the array by its block table holds 18446744060824649735 bytes"),
        (&[12, 1, 0, size, size], "the data of the array is damaged"),
        (&[1, 12, 0, size + 1], "the data of the array is damaged: a block has"),
        (&[1, 12, 0, u32::MAX], "the data of the array is damaged: a block has"),
        (&[1, 12, 0, 0], "the data of the array "),
        (&[1, 12, 0, size - 6], "the data of the array "),
        (&[1], "the data of the array "),
    ] {
        let line = folder.refuse("a.vti", table(words, &packed));
        assert!(
            line.starts_with(expected) || line.starts_with("the array by") || line.starts_with("a length"),
            "{line}, expected {expected}"
        );
    }
}

#[test]
fn offsets_outside_the_appended_data() {
    let folder = Folder::new();
    let file = Vti::new(SampleType::U8, VtiData::AppendedRaw).file();
    let file = String::from_utf8_lossy(&file).into_owned();
    for (offset, expected) in
        [("99999", "offset is 99999"), ("18446744073709551615", "offset is 1844"), ("-1", "offset is '-1'")]
    {
        let line = folder.refuse("a.vti", file.replace("offset=\"11\"", &format!("offset=\"{offset}\"")));
        assert!(line.starts_with(expected), "{line}");
    }
    let line = folder.refuse("a.vti", file.replace("offset=\"11\"", ""));
    assert!(line.starts_with("offset is missing"), "{line}");
    let line = folder.refuse("a.vti", file.replace("\n_<", "\nxx"));
    assert!(line.starts_with("underscore before the appended data is missing"), "{line}");
    let line = folder.refuse("a.vti", file.replace("encoding=\"raw\"", "encoding=\"hex\""));
    assert!(line.starts_with("encoding of AppendedData is 'hex'"), "{line}");
}
