//! Formats that are known and not read: the error names them and a way out.

use volery_io::ReadOptions;

use crate::{Folder, refuse};

#[test]
fn known_formats_are_named_with_a_way_out() {
    let folder = Folder::new();
    let dicom = [&[0; 128][..], b"DICM\x02\0\0\0"].concat();
    let mrc = [&[0; 208][..], b"MAP DA"].concat();
    let cases: [(&str, &[u8], &str); 9] = [
        ("IM000.dcm", &dicom, "format is DICOM, expected a format that is read: dcm2niix"),
        ("IM000", &dicom, "format is DICOM, expected"),
        ("a.mrc", &mrc, "format is MRC, expected a format that is read: save it as NRRD"),
        ("a.npy", b"\x93NUMPY\x01\0", "format is NumPy, expected"),
        ("a.h5", b"\x89HDF\r\n\x1a\n", "format is HDF5, expected"),
        ("a.mgz", b"nothing known", "format is FreeSurfer MGZ, expected"),
        ("a.raw.bz2", b"BZh9", "format is bzip2, expected no packing"),
        ("a.vtr", b"<VTKFile type=\"RectilinearGrid\">", "format is VTK rectilinear grid, expected"),
        ("a.xyz", b"nothing known", "file name is 'a.xyz', expected one that ends in .raw, .raw.gz"),
    ];
    for (name, bytes, expected) in cases {
        let line = folder.refuse(name, bytes);
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let series = folder.path("series");
    std::fs::create_dir(&series).unwrap();
    std::fs::write(series.join("IM000"), &dicom).unwrap();
    let line = refuse(&series, &ReadOptions::default());
    assert!(line.starts_with("format is DICOM in a folder, expected a format that is read"), "{line}");
    std::fs::remove_file(series.join("IM000")).unwrap();
    std::fs::write(series.join(".zarray"), "{}").unwrap();
    assert!(refuse(&series, &ReadOptions::default()).starts_with("format is Zarr in a folder"));
}

#[test]
fn channels_and_times_that_are_not_there_are_refused() {
    let folder = Folder::new();
    let path = folder.put("a_2x1x1_uint8.raw", [1, 2]);
    let options = |channel, time_step| ReadOptions { channel, time_step, ..ReadOptions::default() };
    assert!(volery_io::read_volume(&path, &options(Some(0), Some(0))).is_ok());
    assert_eq!(refuse(&path, &options(Some(1), None)), "channel asked for is 1, expected 0: there is one");
    assert_eq!(
        refuse(&path, &options(None, Some(1))),
        "time step asked for is 1, expected 0: the file holds one"
    );
    let color = crate::images::png(2, 1, png::ColorType::Rgb, png::BitDepth::Eight, &[1, 2, 3, 4, 5, 6]);
    let path = folder.put("a.png", color);
    let green = volery_io::read_volume(&path, &options(Some(1), None)).unwrap();
    crate::assert_values(&green, &[2.0, 5.0]);
    assert_eq!(refuse(&path, &options(Some(3), None)), "channel asked for is 3, expected 0 to 2");
}
