"""USD geometry that is damaged: passed over or named, and the export goes on."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from pxr import Gf


def test_endless_numbers_are_one_clear_error(usd_convert):
    from exporters.common.report import InputError

    made = u.stage()
    u.camera(made, clippingRange=Gf.Vec2f(math.inf, math.inf))
    with pytest.raises(InputError, match="cameras/0"):
        usd_convert(made)


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_faces_without_area_are_passed_over(usd_convert, scheme):
    """Faces of two corners and of none, beside one that is seen."""
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card", scheme=scheme)
    u.uv(prim, [(0, 0), (1, 0), (1, 1), (0, 1)])
    whole = usd_convert(made)
    prim.GetFaceVertexCountsAttr().Set([2, 4, 0])
    prim.GetFaceVertexIndicesAttr().Set([0, 1, 0, 1, 2, 3])
    gltf = usd_convert(made)
    np.testing.assert_allclose(gltf.triangles(gltf.node("Card")), whole.triangles(whole.node("Card")))
    assert not gltf.lost_features("/World/Card")


@pytest.mark.parametrize("counts", [[0], [2, 2], []])
def test_meshes_of_no_faces_are_named(usd_convert, counts):
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    prim.GetFaceVertexCountsAttr().Set(counts)
    prim.GetFaceVertexIndicesAttr().Set([0, 1, 2, 3][: sum(counts)])
    assert usd_convert(made).lost_features("/World/Card") == ["mesh without faces"]


def test_creases_and_corners_that_do_not_exist(usd_convert):
    """What names no point sharpens none."""
    made = u.stage()
    u.camera(made)
    prim = u.cube(made, "/World/Box", scheme="catmullClark")
    plain = usd_convert(made)
    prim.CreateCornerIndicesAttr([-9, 99])
    prim.CreateCornerSharpnessesAttr([9.0, 9.0])
    prim.CreateCreaseIndicesAttr([0, 99])
    prim.CreateCreaseLengthsAttr([-2, 2])
    prim.CreateCreaseSharpnessesAttr([3.0])
    gltf = usd_convert(made)
    np.testing.assert_allclose(gltf.triangles(gltf.node("Box")), plain.triangles(plain.node("Box")))


def test_attributes_of_a_wrong_type(usd_convert, tmp_path):
    """A mistyped layer is named, not a failure."""
    path = tmp_path / "mistyped.usda"
    path.write_text(
        """#usda 1.0
def Camera "Camera" {}
def Mesh "Mesh" {
    float[] points = [0, 1, 2, 3]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}
def Cone "Cone" {
    token axis = "W"
}
"""
    )
    gltf = usd_convert(path)
    assert gltf.lost_features("/Mesh") == ["mesh without faces"]
    assert gltf.node("Cone") is not None
