"""Writes the files beside it with VTK itself (pip package vtk 9.7.2), so that readers meet another program.

    python make.py FOLDER

The mesh: 12 points, x + 3 (y + 2 z) at (x, y, z); a hexahedron, a voxel, a tetrahedron, a pyramid, a wedge, a
quadratic tetrahedron, a triangle and a pixel. p = 1.5 i at point i, velocity = (i, 2, -i), q = 10 c on cell c.
"""
import sys
import vtk

CELLS = [
    (12, [0, 1, 4, 3, 6, 7, 10, 9]), (11, [1, 2, 4, 5, 7, 8, 10, 11]), (10, [0, 1, 3, 6]), (14, [0, 1, 4, 3, 6]),
    (13, [0, 1, 3, 6, 7, 9]), (24, [0, 1, 3, 6, 1, 2, 4, 5, 7, 8]), (5, [0, 1, 2]), (8, [0, 1, 3, 4]),
]


def array(kind, name, components, tuples):
    found = kind()
    found.SetName(name)
    found.SetNumberOfComponents(components)
    for values in tuples:
        found.InsertNextTuple(values)
    return found


def mesh():
    grid, points = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for i in range(12):
        points.InsertNextPoint(i % 3, i // 3 % 2, i // 6)
    grid.SetPoints(points)
    for kind, nodes in CELLS:
        grid.InsertNextCell(kind, len(nodes), nodes)
    grid.GetPointData().AddArray(array(vtk.vtkFloatArray, "velocity", 3, [(i, 2, -i) for i in range(12)]))
    grid.GetPointData().SetScalars(array(vtk.vtkFloatArray, "p", 1, [(1.5 * i,) for i in range(12)]))
    grid.GetCellData().AddArray(array(vtk.vtkIntArray, "q r", 1, [(10 * c,) for c in range(len(CELLS))]))
    return grid


def vtu(folder, name, mode, compressor, wide, big):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary}.get(mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode == "base64")
    {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib,
     "lz4": writer.SetCompressorTypeToLZ4, "lzma": writer.SetCompressorTypeToLZMA}[compressor]()
    # Several blocks for each array.
    writer.SetBlockSize(64)
    (writer.SetHeaderTypeToUInt64 if wide else writer.SetHeaderTypeToUInt32)()
    (writer.SetByteOrderToBigEndian if big else writer.SetByteOrderToLittleEndian)()
    writer.SetInputData(mesh())
    writer.SetFileName(f"{folder}/{name}.vtu")
    assert writer.Write()


def legacy(folder, name, binary, version):
    writer = vtk.vtkUnstructuredGridWriter()
    (writer.SetFileTypeToBinary if binary else writer.SetFileTypeToASCII)()
    writer.SetFileVersion(version)
    writer.SetInputData(mesh())
    writer.SetFileName(f"{folder}/{name}.vtk")
    assert writer.Write()


def main(folder, everything):
    vtu(folder, "ascii", "ascii", "none", False, False)
    vtu(folder, "lz4_inline_wide", "binary", "lz4", True, False)
    vtu(folder, "lzma_raw", "raw", "lzma", False, False)
    vtu(folder, "lzma_base64_big_wide", "base64", "lzma", True, True)
    for binary in (False, True):
        for version in (42, 51):
            legacy(folder, f"{'binary' if binary else 'ascii'}_{version}", binary, version)
    if everything:
        for mode in ("ascii", "binary", "raw", "base64"):
            for compressor in ("none", "zlib", "lz4", "lzma"):
                for wide in (False, True):
                    for big in (False, True):
                        vtu(folder, f"{mode}_{compressor}_{wide:d}_{big:d}", mode, compressor, wide, big)


main(sys.argv[1], "--everything" in sys.argv)
