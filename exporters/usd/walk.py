"""Everything of a stage that a picture shows, with its world matrix at any time: prims, native instances, PointInstancers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from ..common.report import Lost
from .gprims import is_gprim
from .lights import is_dome, is_light

_NAMED = {
    "BasisCurves": "convert it to a mesh",
    "NurbsCurves": "convert it to a mesh",
    "NurbsPatch": "convert it to a mesh",
    "HermiteCurves": "convert it to a mesh",
    "Points": "convert it to a mesh or a PointInstancer",
    "TetMesh": "convert its surface to a mesh",
    "Volume": "render it separately",
}
_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


@dataclass
class Found:
    """One thing at one time: what it is, where, and whether it is seen."""

    key: tuple
    kind: str
    prim: Usd.Prim
    matrix: np.ndarray
    visible: bool


class Walker:
    """Lists a stage's prims once; `at` gives all of them at a time."""

    def __init__(self, stage: Usd.Stage, lost: Lost) -> None:
        self.stage, self.lost = stage, lost
        self.prims = list(self._list(stage.GetPseudoRoot()))
        self._below: dict = {}

    def _list(self, root: Usd.Prim) -> Iterator[tuple[str, Usd.Prim]]:
        """Prims under `root` with their kinds; what is below a PointInstancer is its prototypes, not drawn where it is."""
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract)))
        for prim in walk:
            if prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
            kind = self._kind(prim)
            if kind and (prim.IsDefined() or root != self.stage.GetPseudoRoot()):
                yield kind, prim

    def _kind(self, prim: Usd.Prim) -> str | None:
        name = prim.GetTypeName()
        if prim.IsA(UsdGeom.Camera):
            return "camera"
        if is_dome(prim):
            return "dome"
        if is_light(prim) and not prim.IsA(UsdGeom.Mesh):
            return "light"
        kinds = {"mesh": prim.IsA(UsdGeom.Mesh), "instancer": prim.IsA(UsdGeom.PointInstancer), "gprim": is_gprim(prim)}
        shape = next((kind for kind, so in kinds.items() if so), None)
        if shape or name in _NAMED:
            purpose = UsdGeom.Imageable(prim).ComputePurpose()
            if purpose not in _PURPOSES:
                return None
            if purpose != UsdGeom.Tokens.render and prim.GetAttribute("renderVisibility").Get() == UsdGeom.Tokens.invisible:
                self.lost.add(str(prim.GetPath()), "renderVisibility without purpose render", "USD heeds it for that purpose only: it is drawn; set visibility")
            if name in _NAMED:
                self.lost.add(str(prim.GetPath()), str(name), f"it is left out; {_NAMED[name]}")
                return None
            if prim.HasAPI("MeshLightAPI"):
                self.lost.add(str(prim.GetPath()), "mesh light", "it does not shine; give it an emissive material and add a rect light")
            if shape == "instancer":
                self._name_colours(prim)
        return shape

    def _name_colours(self, prim: Usd.Prim) -> None:
        """Name what colours each instance on its own."""
        for name in ("displayColor", "displayOpacity"):
            primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
            if primvar.HasAuthoredValue() and primvar.GetInterpolation() != UsdGeom.Tokens.constant:
                self.lost.add(str(prim.GetPath()), f"{name} of each instance", "instances look as their prototype; make one prototype for each colour")

    def at(self, time: Usd.TimeCode) -> Iterator[Found]:
        """Everything at a time; matrices are columns-as-axes, in stage units."""
        cache = UsdGeom.XformCache(time)
        for kind, prim in self.prims:
            matrix = column(cache.GetLocalToWorldTransform(prim))
            visible = _visible(UsdGeom.Imageable(prim), time)
            if kind == "instancer":
                yield from self._instances(prim, matrix, visible, (str(prim.GetPath()),), time, cache, 0)
            else:
                yield Found((str(prim.GetPath()),), kind, prim, matrix, visible)

    def _instances(self, prim, matrix, visible, key, time, cache, depth) -> Iterator[Found]:
        """The instances of a PointInstancer, nested ones too."""
        instancer = UsdGeom.PointInstancer(prim)
        path = str(prim.GetPath())
        if depth > 8:
            self.lost.add(path, "PointInstancers nested more than eight deep", "flatten them")
            return
        which = instancer.GetProtoIndicesAttr().Get(time)
        roots = instancer.GetPrototypesRel().GetForwardedTargets()
        if which is None or not roots:
            return
        places = instancer.ComputeInstanceTransformsAtTime(time, time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask)
        mask = instancer.ComputeMaskAtTime(time)
        ids = instancer.GetIdsAttr().Get(time)
        if len(places) != len(which) or (ids is not None and (not hasattr(ids, "__len__") or len(ids) != len(which))):
            self.lost.add(path, "PointInstancer whose arrays differ in length", "it is left out; check it with usdchecker")
            return
        if ids is None or len(set(ids)) < len(ids):
            ids = range(len(which))
        for i, number in enumerate(which):
            if number >= len(roots) or number < 0:
                self.lost.add(path, f"prototype {number} that does not exist", "its instances are left out")
                continue
            root = self.stage.GetPrimAtPath(roots[number])
            if not root:
                self.lost.add(path, f"prototype {roots[number]} that does not exist", "its instances are left out")
                continue
            if root not in self._below:
                self._below[root] = list(self._list(root))
            shown = visible and (not mask or bool(mask[i]))
            place = matrix @ column(places[i])
            name = (*key, int(ids[i]), int(number))
            for kind, below in self._below[root]:
                local = place if below == root else place @ column(cache.ComputeRelativeTransform(below, root)[0])
                seen = shown and _shown_below(below, root, time)
                whole = (*name, str(below.GetPath()))
                if kind == "instancer":
                    yield from self._instances(below, local, seen, whole, time, cache, depth + 1)
                elif kind not in ("camera", "dome"):
                    yield Found(whole, kind, below, local, seen)


def _visible(imageable: UsdGeom.Imageable, time: Usd.TimeCode) -> bool:
    """Visibility, and for what is there for final pictures only also its `renderVisibility`."""
    final = imageable.ComputePurpose() == UsdGeom.Tokens.render
    purpose = UsdGeom.Tokens.render if final else UsdGeom.Tokens.default_
    return imageable.ComputeEffectiveVisibility(purpose, time) != UsdGeom.Tokens.invisible


def _shown_below(prim: Usd.Prim, root: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Whether nothing from a prim up to its prototype's root is invisible."""
    while prim:
        imageable = UsdGeom.Imageable(prim)
        if imageable and imageable.GetVisibilityAttr().Get(time) == UsdGeom.Tokens.invisible:
            return False
        if prim == root:
            return True
        prim = prim.GetParent()
    return True


def column(matrix) -> np.ndarray:
    """A Gf matrix (row vectors) as a numpy matrix for column vectors."""
    return np.array(matrix).T
