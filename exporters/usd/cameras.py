"""UsdGeomCamera: the frustum that USD itself computes, fitted to the picture as the render settings ask."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom

from ..common.document import Document
from ..common.extras import tidy
from ..common.motion import Animation, unscaled
from ..common.report import Lost


def flaw(prim: Usd.Prim, time: Usd.TimeCode) -> str | None:
    """Why no picture can be taken with a camera at a time; None where one can."""
    camera = UsdGeom.Camera(prim).GetCamera(time)
    sizes = {"horizontalAperture": camera.horizontalAperture, "verticalAperture": camera.verticalAperture}
    if camera.projection == Gf.Camera.Perspective:
        sizes["focalLength"] = camera.focalLength
    wrong = [f"{name} is {value:g}" for name, value in sizes.items() if not 0 < value < math.inf]
    return wrong[0] if wrong else None


@dataclass
class CameraTrack:
    """One camera, sampled."""

    prim: Usd.Prim
    poses: list[np.ndarray] = field(default_factory=list)
    lens: list[dict[str, float]] = field(default_factory=list)
    node: int = -1

    def sample(self, time: Usd.TimeCode, world: np.ndarray, units: float, aspect: float | None, policy: str) -> None:
        """Record pose and lens. `aspect` is the picture's, None for the camera's own."""
        camera = UsdGeom.Camera(self.prim).GetCamera(time)
        frustum = camera.frustum
        window = frustum.window
        size, middle = window.GetSize(), (window.GetMin() + window.GetMax()) / 2
        half = [size[0] / 2, size[1] / 2]
        own = half[0] / half[1]
        if aspect is not None:
            half = _conform(half, own, aspect, policy)
        lens = {"focal": camera.focalLength, "near": camera.clippingRange.min * units, "far": camera.clippingRange.max * units}
        lens |= {"shift_x": middle[0] / half[0], "shift_y": middle[1] / half[1], "aspect": half[0] / half[1]}
        lens |= {"fstop": camera.fStop, "focus": camera.focusDistance * units}
        lens["exposure"] = UsdGeom.Camera(self.prim).ComputeLinearExposureScale(time)
        if camera.projection == Gf.Camera.Orthographic:
            lens |= {"xmag": half[0] * units, "ymag": half[1] * units}
        else:
            # The window stands on the plane at distance 1.
            lens |= {"yfov": 2 * math.atan(half[1]), "width": 2 * half[0] * camera.focalLength, "height": 2 * half[1] * camera.focalLength}
        self.poses.append(unscaled(world))
        self.lens.append(lens)

    def write(self, document: Document, animation: Animation, lost: Lost) -> int:
        """Add camera, node, channels; the node's number."""
        first = self.lens[0]
        path = str(self.prim.GetPath())
        ortho = "xmag" in first
        if any(("xmag" in lens) != ortho for lens in self.lens):
            lost.add(path, "projection that changes from perspective to orthographic", "use two cameras and a cut")
            self.lens = [lens if ("xmag" in lens) == ortho else first for lens in self.lens]
        values = {k: np.array([lens[k] for lens in self.lens]) for k in first}
        if np.abs(values["exposure"] - 1).max() > 1e-6:
            lost.add(path, "exposure", "the picture is as bright as at exposure 0; expose it in compositing")
        if UsdGeom.Camera(self.prim).GetClippingPlanesAttr().Get(Usd.TimeCode.EarliestTime()):
            lost.add(path, "clipping planes", "nothing is cut away by them; cut the objects, or use clippingRange")
        kind = "orthographic" if ortho else "perspective"
        near, far = float(first["near"]), float(first["far"])
        if ortho and values["near"].min() < 0:
            lost.add(path, "near plane behind the camera", "what is behind it is not seen; move the camera back")
        body: dict[str, Any]
        if ortho:
            body = {"xmag": float(first["xmag"]), "ymag": float(first["ymag"]), "znear": max(near, 0.0), "zfar": max(far, near + 1)}
        else:
            body = {"aspectRatio": float(first["aspect"]), "yfov": float(first["yfov"]), "znear": max(near, 1e-6)}
            if math.isfinite(far) and far > near:
                body["zfar"] = far
        extras: dict[str, Any] = {"clip": [tidy(near), tidy(far)]}
        if np.abs(values["shift_x"]).max() > 0 or np.abs(values["shift_y"]).max() > 0:
            extras["shift"] = [float(first["shift_x"]), float(first["shift_y"])]
        if not ortho:
            extras["sensor"] = [tidy(first["width"]), tidy(first["height"])]
        if values["fstop"].max() > 0:
            extras["dof"] = {"focus_distance": tidy(first["focus"]), "fstop": tidy(first["fstop"]), "focal_length": tidy(first["focal"])}
            lost.add(path, "depth of field", "it is not rendered; use depth.Z in compositing")
        index = document.append("cameras", {"type": kind, kind: body, "name": self.prim.GetName(), "extras": extras})
        node: dict[str, Any] = {"name": self.prim.GetName(), "camera": index}
        self.node = document.append("nodes", node)
        animation.node(node, self.node, np.array(self.poses))
        for key, name in (("xmag", "xmag"), ("ymag", "ymag"), ("yfov", "yfov"), ("near", "znear"), ("far", "zfar")):
            if key in values and (name in body):
                animation.pointer(f"/cameras/{index}/{kind}/{name}", values[key])
        animation.pointer(f"/cameras/{index}/extras/shift", np.stack([values["shift_x"], values["shift_y"]], axis=1))
        if "dof" in extras:
            animation.pointer(f"/cameras/{index}/extras/dof/focus_distance", values["focus"])
        return self.node


def _conform(half: list[float], own: float, aspect: float, policy: str) -> list[float]:
    """UsdRenderSettings.aspectRatioConformPolicy: the window's half sizes for a picture of another aspect."""
    wider = own > aspect
    if policy in ("cropAperture", "adjustApertureWidth", "adjustApertureHeight", "expandAperture"):
        keep_width = {"expandAperture": wider, "cropAperture": not wider, "adjustApertureWidth": False, "adjustApertureHeight": True}[policy]
        return [half[0], half[0] / aspect] if keep_width else [half[1] * aspect, half[1]]
    # adjustPixelAspectRatio: the picture is squeezed, the window stays.
    return half
