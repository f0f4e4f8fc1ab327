"""Building blocks for USD test stages."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdShade


def stage(up: str = "Y", units: float = 1.0, frames: tuple[int, int] | None = (1, 5), rate: float = 24.0) -> Usd.Stage:
    """An empty stage in memory."""
    made = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(made, up)
    UsdGeom.SetStageMetersPerUnit(made, units)
    made.SetTimeCodesPerSecond(rate)
    if frames:
        made.SetStartTimeCode(frames[0])
        made.SetEndTimeCode(frames[1])
    made.SetDefaultPrim(UsdGeom.Xform.Define(made, "/World").GetPrim())
    return made


def camera(made: Usd.Stage, path: str = "/World/Camera", **attributes) -> UsdGeom.Camera:
    """A camera at (0, 1, 8)."""
    prim = UsdGeom.Camera.Define(made, path)
    UsdGeom.XformCommonAPI(prim).SetTranslate((0, 1, 8))
    for name, value in attributes.items():
        prim.GetPrim().GetAttribute(name).Set(value)
    return prim


def quad(made: Usd.Stage, path: str, size: float = 2.0, scheme: str = "none") -> UsdGeom.Mesh:
    """A square in the XY plane."""
    prim = UsdGeom.Mesh.Define(made, path)
    h = size / 2
    prim.CreatePointsAttr([(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)])
    prim.CreateFaceVertexCountsAttr([4])
    prim.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    prim.CreateSubdivisionSchemeAttr(scheme)
    return prim


def cube(made: Usd.Stage, path: str, scheme: str = "none") -> UsdGeom.Mesh:
    """A cube of size 2 as a mesh."""
    prim = UsdGeom.Mesh.Define(made, path)
    prim.CreatePointsAttr([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    prim.CreateFaceVertexCountsAttr([4] * 6)
    prim.CreateFaceVertexIndicesAttr([i for f in faces for i in f])
    prim.CreateSubdivisionSchemeAttr(scheme)
    return prim


def preview(made: Usd.Stage, path: str, **inputs) -> UsdShade.Material:
    """A UsdPreviewSurface material with constant inputs."""
    from pxr import Sdf

    material = UsdShade.Material.Define(made, path)
    shader = UsdShade.Shader.Define(made, f"{path}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    for name, value in inputs.items():
        kind = Sdf.ValueTypeNames.Color3f if isinstance(value, tuple) else Sdf.ValueTypeNames.Int if isinstance(value, int) else Sdf.ValueTypeNames.Float
        shader.CreateInput(name, kind).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def bind(prim, material: UsdShade.Material) -> None:
    """Bind a material."""
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def texture(made: Usd.Stage, material: UsdShade.Material, name: str, file: str, output: str = "rgb", st: str = "st", **inputs):
    """Connect a UsdUVTexture to an input of a material's surface; the texture shader."""
    from pxr import Sdf

    path = str(material.GetPath())
    shader = UsdShade.Shader(made.GetPrimAtPath(f"{path}/Surface"))
    node = UsdShade.Shader.Define(made, f"{path}/{name}Texture")
    node.CreateIdAttr("UsdUVTexture")
    node.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
    reader = UsdShade.Shader.Define(made, f"{path}/{name}Reader")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(st)
    node.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    for key, value in inputs.items():
        kind = Sdf.ValueTypeNames.Token if isinstance(value, str) else Sdf.ValueTypeNames.Float4
        node.CreateInput(key, kind).Set(value)
    kind = Sdf.ValueTypeNames.Color3f if output == "rgb" else Sdf.ValueTypeNames.Float
    found = shader.GetInput(name) or shader.CreateInput(name, kind)
    found.ConnectToSource(node.ConnectableAPI(), output)
    return node


def uv(prim: UsdGeom.Mesh, values, interpolation: str = "vertex", name: str = "st", indices=None) -> None:
    """A texture coordinate primvar."""
    from pxr import Sdf

    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    primvar.Set([Gf.Vec2f(*v) for v in values])
    if indices is not None:
        primvar.SetIndices(indices)


def matrix(prim, time: float) -> np.ndarray:
    """Local-to-world of a prim, columns as axes."""
    return np.array(UsdGeom.XformCache(Usd.TimeCode(time)).GetLocalToWorldTransform(prim.GetPrim())).T
