"""Everything of a stage that a picture shows, with its world matrix at any time: prims, native instances, PointInstancers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

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
    "ParticleField": "convert it to a mesh",
    "ParticleField3DGaussianSplat": "convert it to a mesh",
    "GenerativeProcedural": "write out what it makes",
}
# Names of what colours are taken to be, and of what has none.
_REC709 = ("lin_rec709", "lin_rec709_scene", "raw", "data", "identity", "unknown")
_DEEPEST = 8
_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


@dataclass
class Found:
    """One thing at one time: what it is, where, and whether it is seen."""

    key: tuple
    kind: str
    prim: Usd.Prim
    matrix: np.ndarray
    visible: bool
    # Whether it is the same at all times.
    still: bool


@dataclass
class _Moment:
    """A time, and what has been worked out for it."""

    time: Usd.TimeCode
    cache: UsdGeom.XformCache
    # Prototypes by their roots: kind, prim, path, matrix below the root (None for the root itself), whether it is shown.
    prototypes: dict[Usd.Prim, list[tuple[str, Usd.Prim, str, np.ndarray | None, bool]]] = field(default_factory=dict)


class Walker:
    """Lists a stage's prims once; `at` gives all of them at a time."""

    def __init__(self, stage: Usd.Stage, lost: Lost) -> None:
        self.stage, self.lost = stage, lost
        self._below: dict[Usd.Prim, list[tuple[str, Usd.Prim]]] = {}
        self._changing: dict[Usd.Prim, bool] = {}
        self._instanced: set[Usd.Prim] = set()
        self.prims = [(kind, prim, self._still(kind, prim)) for kind, prim in self._list(stage.GetPseudoRoot())]

    def _list(self, root: Usd.Prim) -> Iterator[tuple[str, Usd.Prim]]:
        """Prims under `root` with their kinds; what is below a PointInstancer is its prototypes, not drawn where it is."""
        walk = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract)))
        for prim in walk:
            if prim.IsA(UsdGeom.PointInstancer):
                walk.PruneChildren()
            if not prim.IsDefined() and root.IsPseudoRoot():
                continue
            self._name_state(prim)
            if kind := self._kind(prim, root):
                yield kind, prim

    def _kind(self, prim: Usd.Prim, root: Usd.Prim) -> str | None:
        name = prim.GetTypeName()
        if prim.IsA(UsdGeom.Camera):
            return "camera"
        if is_dome(prim):
            return "dome"
        if is_light(prim) and not prim.IsA(UsdGeom.Gprim):
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
                if (not root.IsPseudoRoot() or not self._never_seen(prim)) and self._first_of_its_kind(prim):
                    self.lost.add(str(prim.GetPath()), str(name), f"it is left out; {_NAMED[name]}")
                return None
            if is_light(prim):
                self.lost.add(str(prim.GetPath()), "mesh light", "it does not shine; give it an emissive material and add a rect light")
            if shape == "instancer":
                self._name_colours(prim)
        elif name and not prim.GetPrimTypeInfo().GetSchemaType() and (prim.HasAttribute("points") or prim.HasAttribute("extent")):
            self.lost.add(str(prim.GetPath()), f"{name}, a type that USD does not know here", "it is left out; convert it to a mesh")
        return shape

    def _first_of_its_kind(self, prim: Usd.Prim) -> bool:
        """Whether no other instance of a prim has been named: a thousand lines would say the same."""
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        new = source not in self._instanced
        self._instanced.add(source)
        return new

    def _never_seen(self, prim: Usd.Prim) -> bool:
        """Whether a prim is invisible at all times: nothing of it can be lost."""
        return not self._changes(prim) and not _visible(UsdGeom.Imageable(prim), Usd.TimeCode.EarliestTime())

    def _name_state(self, prim: Usd.Prim) -> None:
        """Name what a prim says of all below it: other primaries, and that viewers draw a model as something simpler."""
        if prim.HasAPI(Usd.ColorSpaceAPI):
            space = Usd.ColorSpaceAPI(prim).GetColorSpaceNameAttr().Get()
            if space and str(space) not in _REC709:
                self.lost.add(str(prim.GetPath()), f"colour space {space}", "its colours are taken as linear Rec.709; convert them")
        if prim.IsModel() and prim.HasAPI(UsdGeom.ModelAPI):
            api = UsdGeom.ModelAPI(prim)
            mode = api.ComputeModelDrawMode()
            applied = api.GetModelApplyDrawModeAttr().Get() or Usd.ModelAPI(prim).IsKind("component")
            if applied and mode != UsdGeom.Tokens.default_:
                self.lost.add(str(prim.GetPath()), f"model:drawMode {mode}", "it is drawn in full")

    def _name_colours(self, prim: Usd.Prim) -> None:
        """Name what colours each instance on its own."""
        for name in ("displayColor", "displayOpacity"):
            primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
            if primvar.HasAuthoredValue() and primvar.GetInterpolation() != UsdGeom.Tokens.constant:
                self.lost.add(str(prim.GetPath()), f"{name} of each instance", "instances look as their prototype; make one prototype for each colour")

    def _changes(self, prim: Usd.Prim) -> bool:
        """Whether anything of a prim or above it has values for several times."""
        if prim.IsPseudoRoot():
            return False
        if prim not in self._changing:
            self._changing[prim] = self._changes(prim.GetParent()) or any(a.ValueMightBeTimeVarying() for a in prim.GetAttributes())
        return self._changing[prim]

    def _still(self, kind: str, prim: Usd.Prim, depth: int = 0) -> bool:
        """Whether a prim is the same at all times; of a PointInstancer, all its prototypes too."""
        if self._changes(prim) or depth > _DEEPEST:
            return False
        roots = map(self.stage.GetPrimAtPath, UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()) if kind == "instancer" else ()
        return all(self._still(*below, depth + 1) for root in roots if root for below in self._prototype(root))

    def _prototype(self, root: Usd.Prim) -> list[tuple[str, Usd.Prim]]:
        if root not in self._below:
            self._below[root] = list(self._list(root))
        return self._below[root]

    def at(self, time: Usd.TimeCode, still: bool = True) -> Iterator[Found]:
        """Everything at a time, what is the same at all times if asked for; matrices are columns-as-axes, in stage units."""
        moment = _Moment(time, UsdGeom.XformCache(time))
        for kind, prim, same in self.prims:
            if same and not still:
                continue
            matrix = column(moment.cache.GetLocalToWorldTransform(prim))
            found = Found((str(prim.GetPath()),), kind, prim, matrix, _visible(UsdGeom.Imageable(prim), time), same)
            if kind == "instancer":
                yield from self._instances(found, moment, 0)
            else:
                yield found

    def _instances(self, found: Found, moment: _Moment, depth: int) -> Iterator[Found]:
        """The instances of a PointInstancer, nested ones too."""
        prim, time = found.prim, moment.time
        instancer = UsdGeom.PointInstancer(prim)
        path = str(prim.GetPath())
        if depth > _DEEPEST:
            self.lost.add(path, "PointInstancers nested more than eight deep", "flatten them")
            return
        which = instancer.GetProtoIndicesAttr().Get(time)
        paths = instancer.GetPrototypesRel().GetForwardedTargets()
        if which is None or not paths:
            return
        places = instancer.ComputeInstanceTransformsAtTime(time, time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask)
        mask = instancer.ComputeMaskAtTime(time)
        ids = instancer.GetIdsAttr().Get(time)
        if len(places) != len(which) or (ids is not None and (not hasattr(ids, "__len__") or len(ids) != len(which))):
            self.lost.add(path, "PointInstancer whose arrays differ in length", "it is left out; check it with usdchecker")
            return
        if ids is None or len(set(ids)) < len(ids):
            ids = range(len(which))
        roots = [self.stage.GetPrimAtPath(p) for p in paths]
        placed = found.matrix @ np.array(places).reshape(-1, 4, 4).transpose(0, 2, 1)
        for i, number in enumerate(which):
            if number >= len(roots) or number < 0:
                self.lost.add(path, f"prototype {number} that does not exist", "its instances are left out")
                continue
            if not roots[number]:
                self.lost.add(path, f"prototype {paths[number]} that does not exist", "its instances are left out")
                continue
            if roots[number].IsAbstract():
                self.lost.add(path, f"prototype {paths[number]} that is a class", "its instances are left out, as USD draws no classes; make it an over")
                continue
            shown = found.visible and (not mask or bool(mask[i]))
            name = (*found.key, int(ids[i]), int(number))
            for kind, below, where, local, seen in self._placed(roots[number], moment):
                part = Found((*name, where), kind, below, placed[i] if local is None else placed[i] @ local, shown and seen, found.still)
                if kind == "instancer":
                    yield from self._instances(part, moment, depth + 1)
                elif kind == "dome":
                    self.lost.add(where, "dome light in a prototype", "it does not shine; put it outside of PointInstancers")
                elif kind != "camera":
                    yield part

    def _placed(self, root: Usd.Prim, moment: _Moment) -> list[tuple[str, Usd.Prim, str, np.ndarray | None, bool]]:
        """What is drawn of a prototype at a time."""
        if root not in moment.prototypes:
            moment.prototypes[root] = [
                (
                    kind,
                    prim,
                    str(prim.GetPath()),
                    None if prim == root else column(moment.cache.ComputeRelativeTransform(prim, root)[0]),
                    _shown_below(prim, root, moment.time),
                )
                for kind, prim in self._prototype(root)
            ]
        return moment.prototypes[root]


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
