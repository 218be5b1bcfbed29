"""Draws peer scenes with VTK for `cargo xtask bench peers`: one JSON request a line in, one JSON reply a line out.

  {"do": "probe"}                                                        {"vtk", "window", "device"}
  {"do": "load", "scene": FILE, "data": DIR, "reference": NPY or null}   {"name", "dims"}
  {"do": "draw", "mapper": "gpu"|"fixed", "step": VOXELS, "frames": N}   {"seconds": [..], "errors": {..}}
  {"do": "load_plane", "scene": FILE, "data": DIR, "reference": NPY}     {"name", "dims"}
  {"do": "reslice", "frames": N}                                         {"seconds": [..], "errors": {..}}
  {"do": "load_grid", "scene": FILE, "data": DIR, "reference": NPY}      {"name", "cells"}
  {"do": "draw_grid", "mapper": "bunyk"|"tetrahedra", "frames": N}       {"seconds": [..], "errors": {..}}
  {"do": "load_cut", "file": FILE, "count": N, "normal": [X, Y, Z]}      {"cells"}
  {"do": "cut", "frames": N}                                             {"seconds": [..], "polygons": N}

A draw makes a window, draws one frame that is not timed (upload, shader compilation) and keeps it as the picture,
then times N frames with the camera turned by a ten-thousandth of a degree between them. A frame ends when OpenGL has
finished; reading it back is not in the time. Errors are of the whole picture, channel by channel, in [0, 1]:
against the f64 reference, and against VTK's own picture at a sixteenth of a voxel. VTK's picture has 8 bits a channel.
VTK's mappers of grids draw tetrahedra, made before and not in the time, and take a control point's opacity for an
extinction per unit distance: the reference given for them is to have that meaning.
"""

import gzip
import json
import os
import sys
import time

if "DISPLAY" not in os.environ:
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np
import vtk
import zstandard
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

CONVERGED_STEP_VOXELS = 1 / 16
TURN_DEGREES = 1e-4


def open_raw(file):
    if file.endswith(".zst"):
        return zstandard.open(file, "rb")
    return (gzip.open if file.endswith(".gz") else open)(file, "rb")


def read_volume(file, layout):
    """The samples of a raw or NIfTI file as a vtkImageData whose first sample is at the origin."""
    if file.endswith((".nii", ".nii.gz")):
        reader = vtk.vtkNIFTIImageReader()
        reader.SetFileName(file)
        reader.Update()
        read = reader.GetOutput()
        dims, spacing = read.GetDimensions(), read.GetSpacing()
        samples = vtk_to_numpy(read.GetPointData().GetScalars())
    else:
        with open_raw(file) as stream:
            stored = np.frombuffer(stream.read(), dtype=layout["dtype"])
        dims, spacing = layout["dims"], layout.get("spacing", (1, 1, 1))
        samples = stored.astype(stored.dtype.newbyteorder("="))
    volume = vtk.vtkImageData()
    volume.SetDimensions(dims)
    volume.SetSpacing(spacing)
    volume.GetPointData().SetScalars(numpy_to_vtk(samples, deep=True))
    return volume


def look_of(transfer):
    """Unshaded, linearly interpolated, with the opacities of `transfer` per its unit distance."""
    look = vtk.vtkVolumeProperty()
    look.ShadeOff()
    look.SetInterpolationTypeToLinear()
    colors, opacities = vtk.vtkColorTransferFunction(), vtk.vtkPiecewiseFunction()
    for point in transfer["points"]:
        colors.AddRGBPoint(point["value"], *point["color"])
        opacities.AddPoint(point["value"], point["opacity"])
    look.SetColor(colors)
    look.SetScalarOpacity(opacities)
    look.SetScalarOpacityUnitDistance(transfer["unit_distance"])
    return look


def mapper_of(kind, step_world):
    """VTK's mapper of that kind with a fixed step and none of its automatic loss of quality."""
    if kind == "gpu":
        mapper = vtk.vtkGPUVolumeRayCastMapper()
        mapper.SetUseJittering(False)
        mapper.SetMaxMemoryInBytes(4 << 30)
    else:
        mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        mapper.LockSampleDistanceToInputSpacingOff()
        mapper.SetInteractiveSampleDistance(step_world)
        mapper.SetImageSampleDistance(1)
    mapper.SetAutoAdjustSampleDistances(False)
    mapper.SetSampleDistance(step_world)
    return mapper


def read_grid(file):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(file)
    reader.Update()
    return reader.GetOutput()


class Cut:
    """A grid cut by parallel planes, evenly over its extent, the first half a distance inside, by vtkCutter."""

    def __init__(self, file, count, normal):
        self.grid = read_grid(file)
        normal = np.array(normal) / np.linalg.norm(normal)
        along = vtk_to_numpy(self.grid.GetPoints().GetData()).astype(float) @ normal
        low, high = along.min(), along.max()
        plane = vtk.vtkPlane()
        plane.SetNormal(normal)
        plane.SetOrigin(0, 0, 0)
        self.cutter = vtk.vtkCutter()
        self.cutter.SetInputData(self.grid)
        self.cutter.SetCutFunction(plane)
        self.cutter.GenerateTrianglesOff()
        for index in range(count):
            self.cutter.SetValue(index, low + (index + 0.5) * (high - low) / count)

    def run(self, frames):
        """Number of polygons, and the seconds of each of `frames` cuts after one that is not timed."""
        self.cutter.Update()
        seconds = []
        for _ in range(frames):
            self.cutter.Modified()
            start = time.perf_counter()
            self.cutter.Update()
            seconds.append(time.perf_counter() - start)
        return self.cutter.GetOutput().GetNumberOfCells(), seconds


class Plane:
    """The plane through the target of a scene's orthographic camera, seen straight, cut by vtkImageReslice."""

    def __init__(self, file, data_folder, reference_file):
        with open(file, encoding="utf-8") as stream:
            self.described = json.load(stream)
        source, camera = self.described["input"], self.described["camera"]
        self.volume = read_volume(os.path.join(data_folder, source["file"]), source)
        self.reference = np.load(reference_file).astype(float)
        width, height = self.described["size"]
        pixel = camera["height"] / height
        forward = np.subtract(camera["target"], camera["eye"])
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, camera["up"])
        right = right / np.linalg.norm(right)
        up = np.cross(right, forward)
        axes = vtk.vtkMatrix4x4()
        for column, axis in enumerate([right, up, -forward, camera["target"]]):
            for row in range(3):
                axes.SetElement(row, column, axis[row])
        self.reslice = vtk.vtkImageReslice()
        self.reslice.SetInputData(self.volume)
        self.reslice.SetResliceAxes(axes)
        self.reslice.SetOutputDimensionality(2)
        self.reslice.SetInterpolationModeToLinear()
        # Else it goes on for half a voxel beyond the samples.
        self.reslice.BorderOff()
        self.reslice.SetOutputSpacing(pixel, pixel, 1)
        self.reslice.SetOutputExtent(0, width - 1, 0, height - 1, 0, 0)
        self.reslice.SetOutputOrigin(-(width - 1) / 2 * pixel, -(height - 1) / 2 * pixel, 0)
        self.reslice.SetBackgroundLevel(0)

    def draw(self, frames):
        """The picture as rows of RGB in [0, 1], top row first, and the seconds of each of `frames` further cuts."""
        self.reslice.Update()
        width, height = self.described["size"]
        values = vtk_to_numpy(self.reslice.GetOutput().GetPointData().GetScalars()).reshape(height, width, 1)
        seconds = []
        for _ in range(frames):
            self.reslice.Modified()
            start = time.perf_counter()
            self.reslice.Update()
            seconds.append(time.perf_counter() - start)
        return np.repeat(values[::-1] / 255.0, 3, axis=2), seconds


class View:
    """What a scene says about camera and picture."""

    def __init__(self, file):
        with open(file, encoding="utf-8") as stream:
            self.described = json.load(stream)

    def shown(self, mapper, frames):
        """The picture as rows of RGB in [0, 1], top row first, and the seconds of each of `frames` further frames."""
        actor = vtk.vtkVolume()
        actor.SetMapper(mapper)
        actor.SetProperty(look_of(self.described["transfer_function"]))
        renderer = vtk.vtkRenderer()
        renderer.SetBackground(self.described.get("background", (0, 0, 0)))
        renderer.AddVolume(actor)
        camera = self.place_camera(renderer)
        window = vtk.vtkRenderWindow()
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(0)
        window.SetSize(self.described["size"])
        window.AddRenderer(renderer)

        self.finish_frame(window)
        picture, seconds = picture_of(window), []
        for _ in range(frames):
            camera.Azimuth(TURN_DEGREES)
            start = time.perf_counter()
            self.finish_frame(window)
            seconds.append(time.perf_counter() - start)
        window.Finalize()
        return picture, seconds

    def place_camera(self, renderer):
        camera, described = renderer.GetActiveCamera(), self.described["camera"]
        camera.SetPosition(described["eye"])
        camera.SetFocalPoint(described["target"])
        camera.SetViewUp(described["up"])
        if described.get("projection") == "orthographic":
            camera.ParallelProjectionOn()
            camera.SetParallelScale(described["height"] / 2)
        else:
            camera.SetViewAngle(described["fov_y_deg"])
        renderer.ResetCameraClippingRange()
        return camera

    @staticmethod
    def finish_frame(window):
        window.Render()
        window.WaitForCompletion()


class Grid(View):
    """A loaded grid as tetrahedra, and its true picture."""

    def __init__(self, file, data_folder, reference_file):
        super().__init__(file)
        source = self.described["input"]
        grid = read_grid(os.path.join(data_folder, source["file"]))
        grid.GetPointData().SetActiveScalars(source["array"])
        split = vtk.vtkDataSetTriangleFilter()
        split.SetInputData(grid)
        split.TetrahedraOnlyOn()
        split.Update()
        self.tetrahedra = split.GetOutput()
        self.reference = np.load(reference_file).astype(float)

    def draw(self, kind, frames):
        if kind == "bunyk":
            mapper = vtk.vtkUnstructuredGridVolumeRayCastMapper()
            mapper.SetAutoAdjustSampleDistances(False)
            mapper.SetImageSampleDistance(1)
        else:
            mapper = vtk.vtkProjectedTetrahedraMapper()
        mapper.SetInputData(self.tetrahedra)
        return self.shown(mapper, frames)


class Scene(View):
    """A loaded scene; the reference picture and VTK's converged one come with it."""

    def __init__(self, file, data_folder, reference_file):
        super().__init__(file)
        source = self.described["input"]
        self.volume = read_volume(os.path.join(data_folder, source["file"]), source)
        self.reference = None if reference_file is None else np.load(reference_file).astype(float)
        self.converged, _ = self.draw("gpu", CONVERGED_STEP_VOXELS, frames=0)

    def draw(self, kind, step_voxels, frames):
        """The picture as rows of RGB in [0, 1], top row first, and the seconds of each of `frames` further frames."""
        mapper = mapper_of(kind, step_voxels * min(self.volume.GetSpacing()))
        mapper.SetInputData(self.volume)
        return self.shown(mapper, frames)

    def errors(self, picture):
        truths = {"reference": self.reference, "vtk_converged": self.converged}
        return {name: error(picture, truth) for name, truth in truths.items() if truth is not None}


def picture_of(window):
    capture = vtk.vtkWindowToImageFilter()
    capture.SetInput(window)
    capture.SetInputBufferTypeToRGB()
    capture.ReadFrontBufferOff()
    capture.Update()
    image = capture.GetOutput()
    width, height, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1] / 255.0


def error(picture, truth):
    difference = picture - truth
    return {"rmse": float(np.sqrt(np.mean(difference**2))), "max": float(np.abs(difference).max())}


def probe():
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.Render()
    lines = window.ReportCapabilities().splitlines()
    device = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("OpenGL renderer string")), "")
    return {"vtk": vtk.vtkVersion.GetVTKVersion(), "window": window.GetClassName(), "device": device}


def main():
    scene = plane = grid = cut = None
    for line in sys.stdin:
        request = json.loads(line)
        if request["do"] == "probe":
            reply = probe()
        elif request["do"] == "load":
            scene = Scene(request["scene"], request["data"], request["reference"])
            reply = {"name": scene.described["name"], "dims": scene.volume.GetDimensions()}
        elif request["do"] == "load_plane":
            plane = Plane(request["scene"], request["data"], request["reference"])
            reply = {"name": plane.described["name"], "dims": plane.volume.GetDimensions()}
        elif request["do"] == "reslice":
            picture, seconds = plane.draw(request["frames"])
            reply = {"seconds": seconds, "errors": {"reference": error(picture, plane.reference)}}
        elif request["do"] == "load_grid":
            grid = Grid(request["scene"], request["data"], request["reference"])
            reply = {"name": grid.described["name"], "cells": grid.tetrahedra.GetNumberOfCells()}
        elif request["do"] == "draw_grid":
            picture, seconds = grid.draw(request["mapper"], request["frames"])
            reply = {"seconds": seconds, "errors": {"reference": error(picture, grid.reference)}}
        elif request["do"] == "load_cut":
            cut = Cut(request["file"], request["count"], request["normal"])
            reply = {"cells": cut.grid.GetNumberOfCells()}
        elif request["do"] == "cut":
            polygons, seconds = cut.run(request["frames"])
            reply = {"seconds": seconds, "polygons": polygons}
        else:
            picture, seconds = scene.draw(request["mapper"], request["step"], request["frames"])
            reply = {"seconds": seconds, "errors": scene.errors(picture)}
        print(json.dumps(reply), flush=True)


if __name__ == "__main__":
    main()
