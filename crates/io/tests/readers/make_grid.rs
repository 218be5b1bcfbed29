//! Files of grids made by hand.

use volery_io::ByteOrder::{self, Big, Little};

use crate::make::{VtiData, base64, zlib};

/// Points as in `vtk/make.py`: `x + 3 (y + 2 z)` at `(x, y, z)`.
pub(crate) fn points() -> Vec<f64> {
    (0..12).flat_map(|i| [i % 3, i / 3 % 2, i / 6].map(f64::from)).collect()
}

/// VTK's type and the nodes of each cell, as in `vtk/make.py`.
pub(crate) const CELLS: [(u8, &[i64]); 8] = [
    (12, &[0, 1, 4, 3, 6, 7, 10, 9]),
    (11, &[1, 2, 4, 5, 7, 8, 10, 11]),
    (10, &[0, 1, 3, 6]),
    (14, &[0, 1, 4, 3, 6]),
    (13, &[0, 1, 3, 6, 7, 9]),
    (24, &[0, 1, 3, 6, 1, 2, 4, 5, 7, 8]),
    (5, &[0, 1, 2]),
    (8, &[0, 1, 3, 4]),
];

/// The bytes of numbers in a type by its name in VTK's XML.
pub(crate) fn encode(type_name: &str, order: ByteOrder, values: &[f64]) -> Vec<u8> {
    let scalar = |value: f64| match type_name {
        "UInt8" | "Int8" => (value as i64).to_le_bytes()[..1].to_vec(),
        "UInt16" | "Int16" => (value as i64).to_le_bytes()[..2].to_vec(),
        "UInt32" | "Int32" => (value as i64).to_le_bytes()[..4].to_vec(),
        "UInt64" | "Int64" => (value as i64).to_le_bytes().to_vec(),
        "Float32" => (value as f32).to_le_bytes().to_vec(),
        _ => value.to_le_bytes().to_vec(),
    };
    let ordered = |value: &f64| {
        let mut bytes = scalar(*value);
        if order == Big {
            bytes.reverse();
        }
        bytes
    };
    values.iter().flat_map(ordered).collect()
}

/// How blocks are packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Packing {
    None,
    Zlib,
    Lz4,
}

/// How a `.vtu` holds its arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub(crate) data: VtiData,
    pub(crate) order: ByteOrder,
    pub(crate) packing: Packing,
    pub(crate) wide: bool,
}

pub(crate) const ASCII: Form =
    Form { data: VtiData::Ascii, order: Little, packing: Packing::None, wide: false };

/// An array: attributes beside the type, its type and its numbers.
pub(crate) type Array<'a> = (&'a str, &'a str, Vec<f64>);

impl Form {
    fn words(&self, values: &[usize]) -> Vec<u8> {
        let values: Vec<f64> = values.iter().map(|&value| value as f64).collect();
        encode(if self.wide { "UInt64" } else { "UInt32" }, self.order, &values)
    }

    /// Lengths and data, which base64 encodes one after the other.
    fn parts(&self, payload: &[u8]) -> [Vec<u8>; 2] {
        let pack: fn(&[u8]) -> Vec<u8> = match self.packing {
            Packing::None => return [[self.words(&[payload.len()]), payload.to_vec()].concat(), Vec::new()],
            Packing::Zlib => zlib,
            Packing::Lz4 => lz4_flex::block::compress,
        };
        let block = (payload.len() * 2 / 5).max(1);
        let packed: Vec<_> = payload.chunks(block).map(pack).collect();
        let mut table = vec![packed.len(), block, payload.len() % block];
        table.extend(packed.iter().map(Vec::len));
        [self.words(&table), packed.concat()]
    }

    /// An element, and what it adds to the appended data.
    fn array(&self, (attributes, type_name, values): &Array, appended: &mut Vec<u8>) -> String {
        let parts = self.parts(&encode(type_name, self.order, values));
        let encoded = parts.iter().map(|part| base64(part)).collect::<String>();
        let start = format!("<DataArray type=\"{type_name}\" {attributes} format=");
        let offset = appended.len();
        match self.data {
            VtiData::Ascii => {
                let words: Vec<_> = values.iter().map(f64::to_string).collect();
                return format!("{start}\"ascii\">{}</DataArray>\n", words.join(" "));
            }
            VtiData::Inline => return format!("{start}\"binary\">\n{encoded}\n</DataArray>\n"),
            VtiData::AppendedRaw => appended.extend(parts.concat()),
            VtiData::AppendedBase64 => appended.extend(encoded.into_bytes()),
        }
        format!("{start}\"appended\" offset=\"{offset}\"/>\n")
    }

    /// A file of one piece.
    pub(crate) fn vtu(&self, cells: &[(u8, &[i64])], on_points: &[Array], on_cells: &[Array]) -> Vec<u8> {
        let mut appended = Vec::new();
        let nodes: Vec<f64> = cells.iter().flat_map(|(_, nodes)| *nodes).map(|&node| node as f64).collect();
        let ends = cells.iter().scan(0, |end, (_, nodes)| {
            *end += nodes.len();
            Some(*end as f64)
        });
        let (ends, types) = (ends.collect(), cells.iter().map(|(vtk, _)| f64::from(*vtk)).collect());
        let mut section = |name: &str, arrays: &[Array]| {
            let arrays: String = arrays.iter().map(|array| self.array(array, &mut appended)).collect();
            format!("<{name}>\n{arrays}</{name}>\n")
        };
        let sections = [
            section("PointData", on_points),
            section("CellData", on_cells),
            section("Points", &[("NumberOfComponents=\"3\"", "Float64", points())]),
            section(
                "Cells",
                &[
                    ("Name=\"connectivity\"", "Int64", nodes),
                    ("Name=\"offsets\"", "Int32", ends),
                    ("Name=\"types\"", "UInt8", types),
                ],
            ),
        ];
        let order = if self.order == Big { "BigEndian" } else { "LittleEndian" };
        let compressor = match self.packing {
            Packing::None => "",
            Packing::Zlib => "compressor=\"vtkZLibDataCompressor\"",
            Packing::Lz4 => "compressor=\"vtkLZ4DataCompressor\"",
        };
        let header = if self.wide { "UInt64" } else { "UInt32" };
        let mut file = format!(
            "<VTKFile type=\"UnstructuredGrid\" byte_order=\"{order}\" header_type=\"{header}\" {compressor}>\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"12\" NumberOfCells=\"{}\">\n{}</Piece>\n\
             </UnstructuredGrid>\n",
            cells.len(),
            sections.concat()
        )
        .into_bytes();
        if let VtiData::AppendedRaw | VtiData::AppendedBase64 = self.data {
            let encoding = if self.data == VtiData::AppendedRaw { "raw" } else { "base64" };
            file.extend(format!("<AppendedData encoding=\"{encoding}\">_").into_bytes());
            file.extend(appended);
            file.extend(b"</AppendedData>\n");
        }
        file.extend(b"</VTKFile>\n");
        file
    }
}

/// The file of `vtk/make.py` with the array `p` only.
pub(crate) fn usual_vtu(form: Form) -> Vec<u8> {
    let p = (0..12).map(|i| 1.5 * f64::from(i)).collect();
    form.vtu(&CELLS, &[("Name=\"p\"", "Float32", p)], &[])
}

/// A file of netCDF-3.
#[derive(Default)]
pub(crate) struct NetCdf {
    dims: Vec<(String, u32)>,
    variables: Vec<Variable>,
}

struct Variable {
    name: String,
    /// Places of the dims.
    dims: Vec<u32>,
    elem_type: Option<String>,
    /// 2 text, 4 int, 5 float.
    number: u32,
    data: Vec<u8>,
}

impl NetCdf {
    pub(crate) fn variable(
        &mut self,
        name: &str,
        dims: &[(&str, usize)],
        kind: Option<&str>,
        values: &[f64],
    ) {
        let data = encode("Float32", Big, values);
        self.add(name, dims, kind, 5, data);
    }

    pub(crate) fn ints(&mut self, name: &str, dims: &[(&str, usize)], kind: Option<&str>, values: &[i32]) {
        let data = values.iter().flat_map(|value| value.to_be_bytes()).collect();
        self.add(name, dims, kind, 4, data);
    }

    pub(crate) fn names(&mut self, name: &str, dim: &str, names: &[&str]) {
        let data = names.iter().flat_map(|name| format!("{name:\0<8}").into_bytes()).collect();
        self.add(name, &[(dim, names.len()), ("len_string", 8)], None, 2, data);
    }

    pub(crate) fn dim(&mut self, name: &str, length: usize) -> u32 {
        let place = self.dims.iter().position(|dim| dim.0 == name).unwrap_or_else(|| {
            self.dims.push((name.to_owned(), length as u32));
            self.dims.len() - 1
        });
        place as u32
    }

    fn add(&mut self, name: &str, dims: &[(&str, usize)], kind: Option<&str>, number: u32, data: Vec<u8>) {
        let dims = dims.iter().map(|(dim, length)| self.dim(dim, *length)).collect();
        let (name, elem_type) = (name.to_owned(), kind.map(str::to_owned));
        self.variables.push(Variable { name, dims, elem_type, number, data });
    }

    fn header(&self, data_start: usize) -> Vec<u8> {
        let word = |value: usize| (value as u32).to_be_bytes().to_vec();
        let text = |text: &str| {
            let padding = vec![0; text.len().next_multiple_of(4) - text.len()];
            [word(text.len()), text.as_bytes().to_vec(), padding].concat()
        };
        let mut file = [b"CDF\x01".to_vec(), word(0), word(10), word(self.dims.len())].concat();
        for (name, length) in &self.dims {
            file.extend([text(name), word(*length as usize)].concat());
        }
        file.extend([word(0), word(0), word(11), word(self.variables.len())].concat());
        let mut start = data_start;
        for Variable { name, dims, elem_type, number, data } in &self.variables {
            file.extend([text(name), word(dims.len())].concat());
            file.extend(dims.iter().flat_map(|&dim| word(dim as usize)));
            match elem_type {
                None => file.extend([word(0), word(0)].concat()),
                Some(kind) => {
                    file.extend([word(12), word(1), text("elem_type"), word(2), text(kind)].concat());
                }
            }
            file.extend([word(*number as usize), word(data.len().next_multiple_of(4)), word(start)].concat());
            start += data.len().next_multiple_of(4);
        }
        file
    }

    pub(crate) fn file(&self) -> Vec<u8> {
        let mut file = self.header(self.header(0).len());
        for Variable { data, .. } in &self.variables {
            file.extend(data);
            file.resize(file.len().next_multiple_of(4), 0);
        }
        file
    }
}

/// Exodus II: a hexahedron and a tetrahedron over the usual points, a shell, values at nodes and on elements.
pub(crate) fn exodus() -> NetCdf {
    let mut file = NetCdf::default();
    for (name, length) in [("num_dim", 3), ("num_nodes", 12), ("num_elem", 3), ("num_el_blk", 3)] {
        file.dim(name, length);
    }
    let points = points();
    let coord: Vec<f64> = (0..3).flat_map(|axis| points.iter().skip(axis).step_by(3).copied()).collect();
    file.variable("coord", &[("num_dim", 3), ("num_nodes", 12)], None, &coord);
    let hexahedron = [1, 2, 5, 4, 7, 8, 11, 10];
    file.ints("connect1", &[("num_el_in_blk1", 1), ("num_nod_per_el1", 8)], Some("HEX8"), &hexahedron);
    file.ints("connect2", &[("num_el_in_blk2", 1), ("num_nod_per_el2", 4)], Some("tetra4"), &[2, 3, 5, 8]);
    file.ints("connect3", &[("num_el_in_blk3", 1), ("num_nod_per_el3", 4)], Some("SHELL4"), &[1, 2, 5, 4]);
    file.names("name_nod_var", "num_nod_var", &["T", "p"]);
    file.names("name_elem_var", "num_elem_var", &["q"]);
    let steps = ("time_step", 2);
    let values: Vec<f64> = (0..48).map(f64::from).collect();
    file.variable("vals_nod_var", &[steps, ("num_nod_var", 2), ("num_nodes", 12)], None, &values);
    file.variable("vals_elem_var1eb1", &[steps, ("num_el_in_blk1", 1)], None, &[7.0, 8.0]);
    file
}
