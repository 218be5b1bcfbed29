//! The undamaged files.

use std::io::Cursor;

use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};
use volery_io::ByteOrder::{Big, Little};
use volery_io::{GlbOptions, write_glb};
use volery_scene::SampleType;

use crate::make::{self, Nifti, VTI_DATA, Vti};
use crate::make_grid::{self, CELLS, Form, Packing, usual_vtu};
use crate::make_mesh;
use crate::make_stack::stack;
use crate::make_tiff;

fn big() -> Vec<u8> {
    make::payload(SampleType::U16, Big)
}

pub(crate) fn raw() -> Vec<Vec<u8>> {
    vec![big()]
}

pub(crate) fn raw_gzip() -> Vec<Vec<u8>> {
    vec![make::gzip(&big()), [make::gzip(&big()[..5]), make::gzip(&big()[5..])].concat()]
}

pub(crate) fn raw_zstd() -> Vec<Vec<u8>> {
    vec![make::zstd(&big()), zstd::bulk::compress(&big(), 19).unwrap(), make::zstd(&[7; 24])]
}

pub(crate) fn nifti() -> Vec<Vec<u8>> {
    let scaled = Nifti { scaling: [2.0, 1.0], ..Nifti::new(SampleType::U8, Little) };
    let series = Nifti { dim: vec![4, 3, 2, 2, 2], ..Nifti::new(SampleType::U8, Little) };
    let vector = Nifti { dim: vec![5, 3, 2, 1, 1, 2], datatype: 1024, ..Nifti::new(SampleType::U8, Little) };
    // Both orientations hold.
    let mut placed = vector.file(&[5; 96]);
    (placed[252], placed[254], placed[280], placed[283]) = (1, 1, 0x80, 0x3f);
    // The second version: zeros but for what must be there.
    let mut second = vec![0; 556];
    second[..12].copy_from_slice(b"\x1c\x02\0\0n+2\0\r\n\x1a\n");
    (second[12], second[16], second[24], second[32], second[40], second[168], second[169]) =
        (2, 3, 3, 2, 2, 0x20, 2);
    second[104 + 15] = 0x3f;
    vec![
        Nifti::new(SampleType::U16, Big).file(&big()),
        scaled.file(&[5; 12]),
        series.file(&[5; 24]),
        placed,
        second,
    ]
}

pub(crate) fn nifti_gzip() -> Vec<Vec<u8>> {
    // Stored blocks, so that changes reach the header.
    nifti().into_iter().flat_map(|file| [make::gzip(&file), stored(&file)]).collect()
}

fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn nrrd() -> Vec<Vec<u8>> {
    let colours = b"NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 2 1 2\nkinds: vector space space space\n\
        space directions: none (1,0,0) (0,1,0) (0,0,1)\nbyte skip: -1\nencoding: raw\n\n123456789abc";
    let big = big();
    let raw = make::nrrd(SampleType::U16, Big, "raw", &big);
    vec![raw, make::nrrd(SampleType::U16, Big, "gzip", &make::gzip(&big)), colours.to_vec()]
}

pub(crate) fn metaimage() -> Vec<Vec<u8>> {
    let colours =
        b"NDims = 2\nDimSize = 2 2\nElementType = MET_UCHAR\nElementNumberOfChannels = 3\nHeaderSize = 0\n\
        ElementSize = 1 2\nElementDataFile = LOCAL\n123456789abc";
    let big = big();
    let packed = make::mha(SampleType::U16, Big, true, &make::zlib(&big));
    vec![make::mha(SampleType::U16, Big, false, &big), packed, colours.to_vec()]
}

pub(crate) fn vti() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for data in VTI_DATA {
        for compressed in [false, true] {
            let vti = Vti { sample: SampleType::U16, order: Big, data, compressed, wide: compressed };
            files.push(vti.file());
            let vti = Vti { compressed, ..Vti::new(SampleType::U8, data) };
            files.push(vti.file_of(&[9.0; 12], "0 2 0 2 0 1", "CellData", "NumberOfComponents=\"3\""));
        }
    }
    files
}

/// What VTK wrote and what is made by hand, in every form.
pub(crate) fn vtu() -> Vec<Vec<u8>> {
    let mut files = vec![
        include_bytes!("../readers/vtk/ascii.vtu").to_vec(),
        include_bytes!("../readers/vtk/lz4_inline_wide.vtu").to_vec(),
        include_bytes!("../readers/vtk/lzma_raw.vtu").to_vec(),
        include_bytes!("../readers/vtk/lzma_base64_big_wide.vtu").to_vec(),
    ];
    for data in VTI_DATA {
        for packing in [Packing::None, Packing::Zlib, Packing::Lz4] {
            let form = Form { data, packing, order: Big, wide: packing == Packing::None };
            files.push(usual_vtu(form));
            let ghosts = ("Name=\"vtkGhostType\"", "UInt8", vec![1.0; 8]);
            let values = ("Name=\"q\" NumberOfComponents=\"2\"", "Int16", vec![3.0; 16]);
            files.push(form.vtu(&CELLS, &[], &[ghosts, values]));
        }
    }
    files
}

/// Names of pieces: one is itself, which is no piece, others are not there.
pub(crate) fn pvtu() -> Vec<Vec<u8>> {
    let text =
        br#"<VTKFile type="PUnstructuredGrid" byte_order="LittleEndian"><PUnstructuredGrid GhostLevel="0">
        <PPointData Scalars="p"><PDataArray type="Float32" Name="p"/></PPointData>
        <Piece Source="a.pvtu"/><Piece Source="../nowhere.vtu"/></PUnstructuredGrid></VTKFile>"#;
    vec![text.to_vec()]
}

/// Names of steps: one is itself, which is no step, others are not there.
pub(crate) fn pvd() -> Vec<Vec<u8>> {
    let text = br#"<VTKFile type="Collection" byte_order="LittleEndian"><Collection>
        <DataSet timestep="0" group="" part="0" file="a.pvd"/><DataSet timestep="0" part="1" file="b.vtu"/>
        <DataSet timestep="2.5" file="../nowhere.vtu"/></Collection></VTKFile>"#;
    vec![text.to_vec()]
}

pub(crate) fn exodus() -> Vec<Vec<u8>> {
    vec![make_grid::exodus().file()]
}

pub(crate) fn legacy_vtk() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../readers/vtk/ascii_42.vtk").to_vec(),
        include_bytes!("../readers/vtk/ascii_51.vtk").to_vec(),
        include_bytes!("../readers/vtk/binary_42.vtk").to_vec(),
        include_bytes!("../readers/vtk/binary_51.vtk").to_vec(),
    ]
}

/// Names of pieces: one is itself, which is no piece, others are not there.
pub(crate) fn pvti() -> Vec<Vec<u8>> {
    let text = br#"<VTKFile type="PImageData" byte_order="LittleEndian"><PImageData WholeExtent="0 3 0 2 0 1"
        Spacing="1 2 3" Direction="1 0 0 0 1 0 0 0 1"><Piece Extent="0 1 0 2 0 1" Source="a.pvti"/>
        <Piece Source="../nowhere.vti"/></PImageData></VTKFile>"#;
    vec![text.to_vec()]
}

pub(crate) fn structured_points() -> Vec<Vec<u8>> {
    let header = |form: &str| {
        format!(
            "# vtk DataFile Version 5.1\ntitle\n{form}\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 1\nSPACING 1 2 3\n\
             ORIGIN 4 5 6\nPOINT_DATA 6\n"
        )
    };
    let text = "SCALARS s short 1\nLOOKUP_TABLE default\n1 2 3 4 5 6\nFIELD f 2\nvtkGhostType 1 6 unsigned_char\n\
                0 2 0 0 1 0\nMETADATA\nCOMPONENT_NAMES\n\nINFORMATION 0\n\nv 3 6 float\n\
                1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9\nCELL_DATA 2\nSCALARS c double\nLOOKUP_TABLE default\n7 8\n";
    let data = b"SCALARS s unsigned_char 1\nLOOKUP_TABLE default\n\x01\x02\x03\x04\x05\x06\n";
    let binary = [header("BINARY").into_bytes(), data.to_vec()];
    vec![header("ASCII").into_bytes().into_iter().chain(text.bytes()).collect(), binary.concat()]
}

/// Every kind of text, plane, tile and number.
pub(crate) fn tiff_axes() -> Vec<Vec<u8>> {
    use make_tiff::{Page, file, little, long, numbered, ratio, short, text};
    let described = |count, description: &str| {
        let mut pages = numbered(count);
        pages[0] = pages[0].clone().with(&[text(270, description), ratio(282, 4, 1), short(296, &[3])]);
        pages
    };
    let ome = "<OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"2\" SizeC=\"3\" PhysicalSizeX=\"0.5\" \
               PhysicalSizeZ=\"2\"><TiffData IFD=\"0\" FirstZ=\"0\" PlaneCount=\"6\"/></Pixels></Image></OME>";
    let mut tiled = Page { is_tiled: true, ..Page::gray(3, 2, 8, Vec::new()) };
    tiled = tiled.with(&[short(322, &[2]), short(323, &[2]), long(32_997, &[3]), long(32_998, &[2])]);
    tiled.chunks = vec![vec![5; 8]; 4];
    let mut planar = Page::gray(2, 1, 16, Vec::new());
    planar = planar.with(&[short(258, &[16; 3]), short(262, &[2]), short(277, &[3]), short(284, &[2])]);
    planar.chunks = vec![vec![1, 2, 3, 4]; 3];
    let jpeg = {
        let mut file = Cursor::new(Vec::new());
        let image = image::GrayImage::from_fn(8, 8, |x, y| image::Luma([(x * 31 + y * 17) as u8]));
        image.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        Page::gray(8, 8, 8, file.into_inner()).with(&[short(259, &[7])])
    };
    vec![
        little(&described(6, "ImageJ=1\nimages=6\nchannels=3\nslices=2\nspacing=2\nunit=um\n")),
        little(&described(6, ome)),
        little(&described(6, "{\"shape\": [3, 2, 1, 2], \"axes\": \"TZYX\", \"spacing\": 2}")),
        file(Big, false, &described(1, "ImageJ=1\nimages=3\nslices=3\n"), &[1, 2, 3, 4]),
        file(Big, true, &[tiled], b""),
        little(&[planar]),
        little(&[Page::gray(9, 2, 1, vec![0xa5; 4]).with(&[short(262, &[0])]), Page::gray(1, 1, 8, vec![1])]),
        little(&[jpeg]),
    ]
}

pub(crate) fn nrrd_axes() -> Vec<Vec<u8>> {
    let header = |fields: &str, data: &[u8]| [b"NRRD0005\n", fields.as_bytes(), b"\n\n", data].concat();
    vec![
        header(
            "type: float\ndimension: 4\nsizes: 3 2 2 2\nspace: LPS\nspace directions: (1,0,0) (0,1,0) none (0,0,2)\n\
             space origin: (1,2,3)\nkinds: domain domain list domain\nendian: big\nencoding: raw",
            &[3; 96],
        ),
        header("type: int64\ndimension: 3\nsizes: 3 2 1\nendian: little\nencoding: raw\nspacings: 1 -2 nan", &[9; 48]),
        header("type: short\ndimension: 2\nsizes: 3 2\nkinds: vector domain\nencoding: text", b"1 2 3 4 5 6"),
        header("type: uint8\ndimension: 2\nsizes: 3 2\nencoding: hex\nline skip: 1", b"x\n01 02 03 04 05 06"),
        b"NRRD0005\ntype: uint8\ndimension: 2\nsizes: 3 2\nencoding: raw\ndata file: LIST\naxes.nrrd\naxes.nrrd\n".to_vec(),
        b"NRRD0005\ntype: uint8\ndimension: 2\nsizes: 3 2\nencoding: raw\ndata file: a%02d.raw 0 1 1\n".to_vec(),
    ]
}

pub(crate) fn png() -> Vec<Vec<u8>> {
    use png::{BitDepth::*, ColorType::*};
    let mut files = Vec::new();
    for (color, depth, bytes) in [
        (Grayscale, One, 1),
        (Grayscale, Eight, 5),
        (Grayscale, Sixteen, 10),
        (Rgb, Eight, 15),
        (Rgb, Sixteen, 30),
        (Rgba, Eight, 20),
        (GrayscaleAlpha, Eight, 10),
        (Indexed, Four, 3),
    ] {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, 5, 4);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == Indexed {
            encoder.set_palette((0..48).collect::<Vec<u8>>());
            encoder.set_trns(vec![1, 2, 3]);
        }
        let data: Vec<u8> = (0..bytes * 4).map(|i| (i * 37) as u8).collect();
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&data).unwrap();
        writer.finish().unwrap();
        files.push(file);
    }
    files
}

pub(crate) fn jpeg() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for (width, height) in [(1, 1), (17, 9), (40, 33)] {
        let mut file = Cursor::new(Vec::new());
        let image = image::GrayImage::from_fn(width, height, |x, y| image::Luma([(x * 31 + y * 17) as u8]));
        image.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        files.push(file.into_inner());
        let mut file = Cursor::new(Vec::new());
        let image =
            image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x * 31) as u8, (y * 17) as u8, 90]));
        image.write_to(&mut file, image::ImageFormat::Jpeg).unwrap();
        files.push(file.into_inner());
    }
    files
}

pub(crate) fn tiff() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for compression in [
        Compression::Uncompressed,
        Compression::Lzw,
        Compression::Deflate(DeflateLevel::Fast),
        Compression::Packbits,
    ] {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression);
        encoder.write_image::<colortype::Gray16>(3, 2, &[1, 2, 3, 4, 5, 60_000]).unwrap();
        encoder.write_image::<colortype::Gray16>(3, 2, &[6, 7, 8, 9, 10, 11]).unwrap();
        files.push(file.into_inner());
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap().with_compression(compression);
        encoder.write_image::<colortype::RGB8>(2, 2, &[7; 12]).unwrap();
        files.push(file.into_inner());
    }
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new_big(&mut file).unwrap();
    encoder.write_image::<colortype::Gray32Float>(2, 1, &[0.5, 1.5]).unwrap();
    files.push(file.into_inner());
    files
}

pub(crate) fn mesh_obj() -> Vec<Vec<u8>> {
    let strange =
        "\u{feff}V 0 0 0 # \\\nv 1 0 \\\r\n0\rv 0 1 0 #c\nusemtl a\\\nF 1 2 3 # x\ncurv 0 1 \\\n2 3\n";
    vec![make_mesh::OBJ.as_bytes().to_vec(), strange.as_bytes().to_vec()]
}

pub(crate) fn mesh_gltf() -> Vec<Vec<u8>> {
    let (_, bytes) = make_mesh::gltf("");
    let uri = format!("\"uri\": \"data:;base64,{}\", ", make::base64(&bytes));
    vec![make_mesh::gltf(&uri).0.into_bytes()]
}

pub(crate) fn mesh_glb() -> Vec<Vec<u8>> {
    let (text, bytes) = make_mesh::gltf("");
    vec![make_mesh::glb(&text, &bytes)]
}

pub(crate) fn scene() -> Vec<Vec<u8>> {
    let text = br#"{"name": "tooth", "input": {"kind": "volume", "file": "tooth.raw", "dims": [103, 94, 161],
        "dtype": ">u2", "spacing": [1, 1, 2.5]}, "size": [512, 256], "background": [0, 0.5, 1],
        "camera": {"projection": "perspective", "eye": [240, -150, 180], "target": [51, 46.5, 80], "up": [0, 0, 1],
        "fov_y_deg": 30}, "transfer_function": {"points": [{"value": 0, "color": [0, 0, 0], "opacity": 0}],
        "unit_distance": 1.0}}"#;
    vec![text.to_vec()]
}

pub(crate) fn transfer() -> Vec<Vec<u8>> {
    let ours = br#"{"points": [{"value": 1, "color": [0, 0.5, 1], "opacity": 0}], "unit_distance": 2.5}"#;
    let mut files = vec![ours.to_vec()];
    for space in ["RGB", "HSV", "Lab", "Diverging", "Step"] {
        let text = format!(
            r#"[{{"Name": "A", "ColorSpace": "{space}", "RGBPoints": [0, 0.1, 0.2, 0.3, 2, 1, 0, 0.5, 3, 0, 0, 0,],
            "Points": [0, 0, 0.5, 0, 1, 0.2, 0.3, 0.6, 2, 0.9, 0.5, 1, 3, 1, 0.5, 0]}}]"#
        );
        files.push(text.into_bytes());
    }
    files
}

pub(crate) fn transfer_2d() -> Vec<Vec<u8>> {
    let palette = r#"{"values": [0, 255], "magnitudes": [0, 40.5], "columns": 2, "rows": 3, "colors": [[0, 0, 1],
        [1, 0, 0], [0, 1, 1], [1, 1, 0], [0.5, 0.25, 1e-3], [1, 1, 1]], "opacities": [0, 0.1, 0, 0.8, 1, 0.5],
        "unit_distance": 2.5"#;
    let sliders = r#", "global_opacity": 0.5, "gradient_weight": 1, "selection": {"mean": 30, "range": 10}"#;
    ["", sliders].map(|sliders| format!("{palette}{sliders}}}").into_bytes()).to_vec()
}

pub(crate) fn stack_vsl() -> Vec<Vec<u8>> {
    [false, true].map(|has_gradients| stack(2, 3, has_gradients).encode()).to_vec()
}

pub(crate) fn stack_glb() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stack.glb");
    let file = |(is_coded, has_gradients)| {
        let mesh = stack(2, 3, has_gradients).expand();
        write_glb(&path, &mesh, |_| [0.5; 4], GlbOptions { is_coded }).unwrap();
        std::fs::read(&path).unwrap()
    };
    [(false, false), (true, false), (true, true)].map(file).to_vec()
}
