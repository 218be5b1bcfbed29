//! Formats that are known and not read: an error is to name them, and a way out.

use std::path::Path;

/// What a name of a volume can end in.
pub(super) const ENDINGS: &str = "one that ends in .raw, .raw.gz, .raw.zst, .nii, .nii.gz, .nrrd, .nhdr, .mha, .mhd, \
    .vti, .pvti, .vtk, .tif, .tiff, .png, .jpg or .jpeg, or dims and dtype (--dims, --dtype)";

const TO_NIFTI: &str = "a format that is read: dcm2niix makes NIfTI of it";
const TO_NRRD: &str = "a format that is read: save it as NRRD, NIfTI or TIFF";
const UNPACKED: &str = "no packing, or gzip or Zstandard: unpack it first";

/// The name of a format and what to do, by the first bytes of a file or the ending of its name in lower case.
pub(super) fn format_of(name: &str, head: &[u8]) -> Option<(&'static str, &'static str)> {
    let is_at = |at: usize, magic: &[u8]| head.get(at..at + magic.len()) == Some(magic);
    let by_content: [(usize, &[u8], &str, &str); 12] = [
        (128, b"DICM", "DICOM", TO_NIFTI),
        (208, b"MAP ", "MRC", TO_NRRD),
        (0, b"\x93NUMPY", "NumPy", TO_NRRD),
        (0, b"\x89HDF", "HDF5", TO_NRRD),
        (0, b"GIF8", "GIF", TO_NRRD),
        (0, b"BM", "BMP", TO_NRRD),
        (0, b"\0\0\0\x0cjP  ", "JPEG 2000", TO_NRRD),
        (0, b"ZISRAWFILE", "Zeiss CZI", TO_NRRD),
        (0, b"BZh", "bzip2", UNPACKED),
        (0, b"\xfd7zXZ", "xz", UNPACKED),
        (0, b"PK\x03\x04", "ZIP", UNPACKED),
        (0, b"7z\xbc\xaf", "7-Zip", UNPACKED),
    ];
    let by_ending = [
        (".dcm", "DICOM", TO_NIFTI),
        (".dicom", "DICOM", TO_NIFTI),
        (".ima", "DICOM", TO_NIFTI),
        (".mgz", "FreeSurfer MGZ", TO_NRRD),
        (".mgh", "FreeSurfer MGH", TO_NRRD),
        (".mrc", "MRC", TO_NRRD),
        (".npy", "NumPy", TO_NRRD),
        (".h5", "HDF5", TO_NRRD),
        (".hdf5", "HDF5", TO_NRRD),
        (".czi", "Zeiss CZI", TO_NRRD),
        (".nd2", "Nikon ND2", TO_NRRD),
        (".lif", "Leica LIF", TO_NRRD),
        (".jp2", "JPEG 2000", TO_NRRD),
        (".bmp", "BMP", TO_NRRD),
        (".gif", "GIF", TO_NRRD),
        (".vtr", "VTK rectilinear grid", "VTK image data or an unstructured grid"),
        (".vts", "VTK structured grid", "VTK image data or an unstructured grid"),
        (".vtp", "VTK polygons", "VTK image data or an unstructured grid"),
        (".bz2", "bzip2", UNPACKED),
        (".xz", "xz", UNPACKED),
    ];
    let content =
        by_content.iter().find(|(at, magic, ..)| is_at(*at, magic)).map(|&(.., name, way)| (name, way));
    content
        .or_else(|| by_ending.iter().find(|(end, ..)| name.ends_with(end)).map(|&(_, name, way)| (name, way)))
}

/// The same for a folder, by the files and folders in it.
pub(super) fn format_of_folder(
    path: &Path,
    files: &[std::path::PathBuf],
) -> Option<(&'static str, &'static str)> {
    let has = |name: &str| path.join(name).exists();
    if has(".zarray") || has(".zgroup") || has("zarr.json") || super::lower_name(path).ends_with(".zarr") {
        return Some(("Zarr", TO_NRRD));
    }
    // One file is enough to tell a series.
    files.iter().take(16).find_map(|file| {
        let head = super::head_of(file).ok()?;
        format_of(&super::lower_name(file), &head)
    })
}
