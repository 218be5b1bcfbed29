//! Files of every format, made by hand, so that the readers are tested against the formats and not
//! against writers of our own.

use std::io::Write;

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use volery_io::ByteOrder::{self, Big, Little};
use volery_scene::SampleType;

pub(crate) const DIMS: [usize; 3] = [3, 2, 2];
pub(crate) const SCALARS: [SampleType; 8] = [
    SampleType::U8,
    SampleType::I8,
    SampleType::U16,
    SampleType::I16,
    SampleType::U32,
    SampleType::I32,
    SampleType::F32,
    SampleType::F64,
];
pub(crate) const ORDERS: [ByteOrder; 2] = [Little, Big];

/// Twelve values of a type, its extremes among them.
pub(crate) fn values(sample: SampleType) -> Vec<f64> {
    let [low, high] = match sample {
        SampleType::I8 => [i8::MIN.into(), i8::MAX.into()],
        SampleType::U16 => [0.0, u16::MAX.into()],
        SampleType::I16 => [i16::MIN.into(), i16::MAX.into()],
        SampleType::U32 => [0.0, u32::MAX.into()],
        SampleType::I32 => [i32::MIN.into(), i32::MAX.into()],
        SampleType::F32 => [f32::MIN.into(), f32::MIN_POSITIVE.into()],
        SampleType::F64 => [f64::MIN, f64::MIN_POSITIVE],
        _ => [0.0, 255.0],
    };
    vec![low, high, 1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 34.0, 55.0, 89.0]
}

/// The bytes of values in a type and byte order.
pub(crate) fn encode(sample: SampleType, order: ByteOrder, values: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for &value in values {
        let mut scalar = match sample {
            SampleType::I8 => (value as i8).to_le_bytes().to_vec(),
            SampleType::U16 => (value as u16).to_le_bytes().to_vec(),
            SampleType::I16 => (value as i16).to_le_bytes().to_vec(),
            SampleType::U32 => (value as u32).to_le_bytes().to_vec(),
            SampleType::I32 => (value as i32).to_le_bytes().to_vec(),
            SampleType::F32 => (value as f32).to_le_bytes().to_vec(),
            SampleType::F64 => value.to_le_bytes().to_vec(),
            _ => vec![value as u8],
        };
        if order == Big {
            scalar.reverse();
        }
        bytes.extend(scalar);
    }
    bytes
}

/// The twelve values of [`values`] as bytes.
pub(crate) fn payload(sample: SampleType, order: ByteOrder) -> Vec<u8> {
    encode(sample, order, &values(sample))
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub(crate) fn zstd(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 3).unwrap()
}

/// A header of NIfTI-1 with `dim` (rank first), and the samples at 352.
pub(crate) struct Nifti {
    pub(crate) order: ByteOrder,
    pub(crate) dim: Vec<i16>,
    pub(crate) datatype: i16,
    pub(crate) pixdim: [f32; 3],
    pub(crate) vox_offset: f32,
    pub(crate) scaling: [f32; 2],
    pub(crate) magic: [u8; 4],
}

impl Nifti {
    pub(crate) fn new(sample: SampleType, order: ByteOrder) -> Self {
        let datatype = match sample {
            SampleType::U8 => 2,
            SampleType::I8 => 256,
            SampleType::U16 => 512,
            SampleType::I16 => 4,
            SampleType::U32 => 768,
            SampleType::I32 => 8,
            SampleType::F32 => 16,
            SampleType::F64 => 64,
            SampleType::Rgb8 => 128,
            SampleType::Rgba8 => 2304,
        };
        Self {
            order,
            dim: vec![3, 3, 2, 2],
            datatype,
            pixdim: [1.0, 2.0, 0.5],
            vox_offset: 352.0,
            scaling: [0.0, 0.0],
            magic: *b"n+1\0",
        }
    }

    pub(crate) fn file(&self, payload: &[u8]) -> Vec<u8> {
        let mut file = vec![0; 352];
        let mut put = |at: usize, mut bytes: Vec<u8>| {
            if self.order == Big {
                bytes.reverse();
            }
            file[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        put(0, 348i32.to_le_bytes().to_vec());
        for (i, n) in self.dim.iter().enumerate() {
            put(40 + 2 * i, n.to_le_bytes().to_vec());
        }
        put(70, self.datatype.to_le_bytes().to_vec());
        for (i, distance) in self.pixdim.iter().enumerate() {
            put(80 + 4 * i, distance.to_le_bytes().to_vec());
        }
        put(108, self.vox_offset.to_le_bytes().to_vec());
        put(112, self.scaling[0].to_le_bytes().to_vec());
        put(116, self.scaling[1].to_le_bytes().to_vec());
        file[344..348].copy_from_slice(&self.magic);
        file.extend(payload);
        file
    }
}

pub(crate) fn nrrd_type(sample: SampleType) -> &'static str {
    match sample {
        SampleType::I8 => "signed char",
        SampleType::U16 => "unsigned short",
        SampleType::I16 => "int16_t",
        SampleType::U32 => "uint",
        SampleType::I32 => "int",
        SampleType::F32 => "float",
        SampleType::F64 => "double",
        _ => "uchar",
    }
}

pub(crate) fn order_name(order: ByteOrder) -> &'static str {
    if order == Big { "big" } else { "little" }
}

/// An attached NRRD of 3 x 2 x 2 samples.
pub(crate) fn nrrd(sample: SampleType, order: ByteOrder, encoding: &str, data: &[u8]) -> Vec<u8> {
    let mut file = format!(
        "NRRD0004\n# made by hand\ntype: {}\ndimension: 3\nspace: left-posterior-superior\nsizes: 3 2 2\n\
         space directions: (0,1,0) (2,0,0) (0,0.3,0.4)\nkinds: domain domain domain\nendian: {}\n\
         encoding: {encoding}\nkey:=value\n\n",
        nrrd_type(sample),
        order_name(order)
    )
    .into_bytes();
    file.extend(data);
    file
}

pub(crate) fn met_type(sample: SampleType) -> &'static str {
    match sample {
        SampleType::I8 => "MET_CHAR",
        SampleType::U16 => "MET_USHORT",
        SampleType::I16 => "MET_SHORT",
        SampleType::U32 => "MET_UINT",
        SampleType::I32 => "MET_INT",
        SampleType::F32 => "MET_FLOAT",
        SampleType::F64 => "MET_DOUBLE",
        _ => "MET_UCHAR",
    }
}

/// The header of a MetaImage of 3 x 2 x 2 samples.
pub(crate) fn mha_header(sample: SampleType, order: ByteOrder, compressed: bool, data_file: &str) -> String {
    let truth = |is: bool| if is { "True" } else { "False" };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = {}\nCompressedData = {}\n\
         TransformMatrix = 1 0 0 0 1 0 0 0 1\nElementSpacing = 1 2 0.5\nDimSize = 3 2 2\nElementType = {}\n\
         ElementDataFile = {data_file}\n",
        truth(order == Big),
        truth(compressed),
        met_type(sample)
    )
}

pub(crate) fn mha(sample: SampleType, order: ByteOrder, compressed: bool, data: &[u8]) -> Vec<u8> {
    [mha_header(sample, order, compressed, "LOCAL").as_bytes(), data].concat()
}

/// How a `.vti` holds its array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum VtiData {
    Ascii,
    Inline,
    AppendedRaw,
    AppendedBase64,
}

pub(crate) const VTI_DATA: [VtiData; 4] =
    [VtiData::Ascii, VtiData::Inline, VtiData::AppendedRaw, VtiData::AppendedBase64];

pub(crate) struct Vti {
    pub(crate) sample: SampleType,
    pub(crate) order: ByteOrder,
    pub(crate) data: VtiData,
    pub(crate) compressed: bool,
    pub(crate) wide: bool,
}

pub(crate) fn vti_type(sample: SampleType) -> &'static str {
    match sample {
        SampleType::I8 => "Int8",
        SampleType::U16 => "UInt16",
        SampleType::I16 => "Int16",
        SampleType::U32 => "UInt32",
        SampleType::I32 => "Int32",
        SampleType::F32 => "Float32",
        SampleType::F64 => "Float64",
        _ => "UInt8",
    }
}

pub(crate) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits = group.iter().fold(0, |bits, &byte| bits << 8 | u32::from(byte)) << (8 * (3 - group.len()));
        for i in 0..4 {
            let digit = ALPHABET[(bits >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

impl Vti {
    pub(crate) fn new(sample: SampleType, data: VtiData) -> Self {
        Self { sample, order: Little, data, compressed: false, wide: false }
    }

    fn word(&self, value: usize) -> Vec<u8> {
        let mut bytes = (value as u64).to_le_bytes()[..if self.wide { 8 } else { 4 }].to_vec();
        if self.order == Big {
            bytes.reverse();
        }
        bytes
    }

    /// The parts that are encoded one after the other: lengths and data.
    fn parts(&self, payload: &[u8]) -> [Vec<u8>; 2] {
        if !self.compressed {
            return [[self.word(payload.len()), payload.to_vec()].concat(), Vec::new()];
        }
        // Two and a bit blocks, if there is enough.
        let block = (payload.len() * 2 / 5).max(1);
        let packed: Vec<_> = payload.chunks(block).map(zlib).collect();
        let mut table = [packed.len(), block, payload.len() % block].map(|n| self.word(n)).concat();
        table.extend(packed.iter().flat_map(|block| self.word(block.len())));
        [table, packed.concat()]
    }

    /// A file of `values` with the extent given; `attributes` are added to the array.
    pub(crate) fn file_of(&self, values: &[f64], extent: &str, section: &str, attributes: &str) -> Vec<u8> {
        let payload = encode(self.sample, self.order, values);
        let parts = self.parts(&payload);
        let encoded: String = parts.iter().map(|part| base64(part)).collect();
        let (format, inline) = match self.data {
            VtiData::Ascii => {
                let words: Vec<_> = values.iter().map(|value| format!("{value}")).collect();
                ("format=\"ascii\"".to_owned(), words.join(" "))
            }
            VtiData::Inline => ("format=\"binary\"".to_owned(), encoded.clone()),
            // Eleven bytes of another array stand before.
            VtiData::AppendedRaw => ("format=\"appended\" offset=\"11\"".to_owned(), String::new()),
            VtiData::AppendedBase64 => ("format=\"appended\" offset=\"12\"".to_owned(), String::new()),
        };
        let order = if self.order == Big { "BigEndian" } else { "LittleEndian" };
        let compressor = if self.compressed { "compressor=\"vtkZLibDataCompressor\"" } else { "" };
        let header = if self.wide { "UInt64" } else { "UInt32" };
        let mut file = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"{order}\" \
             header_type=\"{header}\" {compressor}>\n<ImageData WholeExtent=\"{extent}\" Origin=\"9 9 9\" \
             Spacing=\"1 2 0.5\">\n<Piece Extent=\"{extent}\">\n<{section}>\n\
             <DataArray type=\"{}\" Name=\"density\" {attributes} {format}>\n\
             <InformationKey name=\"L2\" location=\"x\">17</InformationKey>\n{inline}\n</DataArray>\n\
             </{}>\n</Piece>\n</ImageData>\n",
            vti_type(self.sample),
            section.split(' ').next().unwrap_or_default()
        )
        .into_bytes();
        match self.data {
            VtiData::AppendedRaw => {
                // The other array's eleven bytes look like markup and are not UTF-8.
                file.extend(b"<AppendedData encoding=\"raw\">\n_<&\xff\0]]>&x;<");
                file.extend(parts.concat());
                file.extend(b"\n</AppendedData>\n");
            }
            VtiData::AppendedBase64 => {
                file.extend(b"<AppendedData encoding=\"base64\">\n   _AAAAAAAAAAAA");
                file.extend(encoded.as_bytes());
                file.extend(b"\n</AppendedData>\n");
            }
            _ => {}
        }
        file.extend(b"</VTKFile>\n");
        file
    }

    /// A file of 3 x 2 x 2 samples with an extent that does not start at 0.
    pub(crate) fn file(&self) -> Vec<u8> {
        self.file_of(&values(self.sample), "5 7 -1 0 0 1", "PointData Scalars=\"density\"", "")
    }
}
