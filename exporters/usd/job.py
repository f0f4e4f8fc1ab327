"""One conversion: a USD stage to a glTF file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Tf, Usd, UsdGeom, UsdRender

from ..common import extras, motion
from ..common.document import Document
from ..common.report import InputError, Lost, OutputError
from .cameras import CameraTrack, flaw
from .lights import DomeTrack, LightTrack, write_dome
from .materials import Materials
from .output import Output
from .shapes import Geometries
from .skins import bake_skins
from .stage import Said, open_stage, reason
from .textures import Textures
from .tracks import Track, distinct, stands_still
from .walk import Found, Walker

_DEFAULT_WIDTH = 1280
_LONGEST = 100_000


@dataclass
class Options:
    """What to convert; None means the stage's own."""

    frames: tuple[int, int] | None = None
    resolution: tuple[int, int] | None = None
    camera: str | None = None
    variants: list[tuple[str, str, str]] = field(default_factory=list)
    levels: int = 2
    camera_light: bool = True
    progress: Callable[[str], None] = lambda _line: None


@dataclass
class Result:
    """What was written and what could not be carried."""

    path: Path
    lost: Lost
    root: dict[str, Any]


def convert(source: Path, target: Path, options: Options) -> Result:
    """Convert the stage in `source` to `target` (.gltf or .glb)."""
    target = Path(target).resolve()
    if target.suffix not in (".gltf", ".glb"):
        raise OutputError(f"{target}: the name must end in .gltf or .glb")
    try:
        with Output(target) as output:
            return _Conversion(source, output, options).run()
    except Tf.ErrorException as error:
        # What USD itself refuses, such as an xformOp that does not exist.
        raise InputError(f"{source}: {reason(error)}; check the stage with usdchecker") from None


class _Conversion:
    def __init__(self, source: Path, output: Output, options: Options) -> None:
        self.source, self.output, self.options = Path(source), output, options
        self.lost = Lost()
        self.stage = open_stage(self.source, options.variants, self.lost)
        self.said = Said()
        self.up = UsdGeom.GetStageUpAxis(self.stage)
        self.units = UsdGeom.GetStageMetersPerUnit(self.stage)
        if not (0 < self.units < 1e9):
            raise InputError(f"{source}: metersPerUnit is {self.units}; it must be a number over 0")
        self.root = np.eye(4)
        self.root[:3, :3] *= self.units
        if self.up == UsdGeom.Tokens.z:
            self.root = self.root @ np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
        codes = self._rate("timeCodesPerSecond", self.stage.GetTimeCodesPerSecond() or 24.0)
        rated = self.stage.HasAuthoredMetadata("framesPerSecond") and self.stage.GetFramesPerSecond() > 0
        self.fps = self._rate("framesPerSecond", self.stage.GetFramesPerSecond()) if rated else codes
        self.codes_per_frame = codes[0] * self.fps[1] / (codes[1] * self.fps[0])
        self._settings()
        self.frames = options.frames or self._range()
        if self.frames[1] < self.frames[0]:
            raise InputError(f"frame range {self.frames[0]}-{self.frames[1]}: the last frame is before the first")
        if self.frames[1] - self.frames[0] > _LONGEST:
            raise InputError(f"frame range {self.frames[0]}-{self.frames[1]}: longer than {_LONGEST} frames; pass --frames FIRST-LAST")
        bake_skins(self.stage, [frame * self.codes_per_frame for frame in self.frames], self.lost, self.said, options.progress)
        self.walker = Walker(self.stage, self.lost)
        self.tracks: dict[tuple, Track] = {}
        # What never changes has one sample.
        self.still: set[tuple] = set()
        self.cameras: dict[tuple, CameraTrack] = {}
        # Cameras that cannot be used, with the reason.
        self.flaws: dict[str, str] = {}
        self.lights: dict[tuple, LightTrack] = {}
        self.domes: dict[tuple, DomeTrack] = {}
        self.geometry = Geometries(options.levels, self.lost)
        self.taken: list[float] = []

    def _rate(self, name: str, rate: float) -> tuple[int, int]:
        if not 1e-3 <= rate <= 1e6:
            raise InputError(f"{self.source}: {name} is {rate}; it must be a number over 0, such as 24")
        return extras.rational(rate)

    def _settings(self) -> None:
        """Resolution, pixel aspect, policy and camera from RenderSettings, overridden by their first product."""
        settings = UsdRender.Settings.GetStageRenderSettings(self.stage)
        prims = [settings.GetPrim()] if settings else [p for p in self.stage.Traverse() if p.IsA(UsdRender.Settings)][:1]
        for prim in prims:
            self._name_settings(UsdRender.Settings(prim))
        prims += [self.stage.GetPrimAtPath(t) for p in prims for t in UsdRender.Settings(p).GetProductsRel().GetTargets()][:1]
        prims = prims or [p for p in self.stage.Traverse() if p.IsA(UsdRender.Product)][:1]
        self.resolution, self.pixel_aspect, self.policy, self.camera = self.options.resolution, 1.0, "expandAperture", self.options.camera
        for prim in (p for p in prims if p):
            base = UsdRender.SettingsBase(prim)
            size = base.GetResolutionAttr()
            if self.options.resolution is None and (size.HasAuthoredValue() or self.resolution is None):
                self.resolution = tuple(size.Get())
            if self.resolution is not None and min(self.resolution) < 1:
                raise InputError(f"{prim.GetPath()}: its resolution is {'x'.join(map(str, self.resolution))}; pass --resolution WIDTHxHEIGHT")
            for attribute, name in ((base.GetPixelAspectRatioAttr(), "pixel_aspect"), (base.GetAspectRatioConformPolicyAttr(), "policy")):
                if attribute.HasAuthoredValue():
                    setattr(self, name, attribute.Get())
            if not 0 < self.pixel_aspect < math.inf:
                raise InputError(f"{prim.GetPath()}: pixelAspectRatio is {self.pixel_aspect}; it must be a number over 0")
            if self.options.camera is None and base.GetCameraRel().GetTargets():
                self.camera = str(base.GetCameraRel().GetTargets()[0])
            window = base.GetDataWindowNDCAttr()
            if window.HasAuthoredValue() and tuple(window.Get()) != (0, 0, 1, 1):
                self.lost.add(str(prim.GetPath()), "dataWindowNDC", "the whole picture is rendered; pass --crop to buzz-convert")
        if self.policy == "adjustPixelAspectRatio":
            self.lost.add("RenderSettings", "adjustPixelAspectRatio", "the pixel aspect of the first camera frame is used for the whole shot")

    def _name_settings(self, settings: UsdRender.Settings) -> None:
        """Name what RenderSettings ask for and do not get."""
        path = str(settings.GetPath())
        for attribute in (settings.GetIncludedPurposesAttr(), settings.GetMaterialBindingPurposesAttr()):
            usual = attribute.GetPrim().GetPrimDefinition().GetAttributeFallbackValue(attribute.GetName())
            if set(attribute.Get()) != set(usual):
                self.lost.add(path, attribute.GetName(), f"what is seen is always {', '.join(x or 'allPurpose' for x in usual)}; change purposes and bindings")
        if len(settings.GetProductsRel().GetTargets()) > 1:
            self.lost.add(path, "several products", "the first one's camera and resolution are used; convert once for each, with --camera and --resolution")

    def _range(self) -> tuple[int, int]:
        times = [self.stage.GetStartTimeCode(), self.stage.GetEndTimeCode()]
        if not self.stage.HasAuthoredTimeCodeRange():
            # What is in instances is in their prototypes, once.
            roots = [self.stage.GetPseudoRoot(), *self.stage.GetPrototypes()]
            attributes = [a for root in roots for prim in Usd.PrimRange(root) for a in prim.GetAuthoredAttributes()]
            times = [t for a in attributes for t in (a.GetSpline().GetKnots().keys() if a.HasSpline() else a.GetTimeSamples())]
        if not all(math.isfinite(t) for t in times):
            raise InputError(f"{self.source}: its time codes are no numbers; pass --frames FIRST-LAST")
        frames = [round(t / self.codes_per_frame, 6) for t in times]
        # Before the first code there is nothing to show; what comes last is shown.
        return (math.ceil(min(frames)), math.ceil(max(frames))) if frames else (0, 0)

    def run(self) -> Result:
        """Do the whole job."""
        self.options.progress(f"sampling frames {self.frames[0]}-{self.frames[1]}")
        first, last = self.frames
        static = not self._animated()
        for frame in range(first, first + 1 if static else last + 1):
            self._at(float(frame))
        if not static:
            for i, n in enumerate(self._steps()):
                for k in range(1, n):
                    self._at(first + i + k / n)
        order = np.argsort(np.array(self.taken), kind="stable")
        for key, track in self._all_tracks().items():
            if key not in self.still:
                for name, values in vars(track).items():
                    if isinstance(values, list):
                        setattr(track, name, [values[i] for i in order])
            if stands_still(distinct(track.poses)):
                self.lost.add(key[-1], "movement too far from the origin", "single precision cannot hold its steps; move the set to the origin")
        frames = [self.taken[i] for i in order]
        self.options.progress(f"writing {len(self.geometry.items)} meshes")
        document = Document()
        animation = motion.Animation(document, [(f - first) * self.fps[1] / self.fps[0] for f in frames])
        materials = Materials(document, Textures(document, self.output, self.lost), self.lost, self._time(first))
        self.geometry.write(document, materials, np.array(self.taken))
        for track in self.tracks.values():
            track.write(animation, self.geometry.items)
        for light in self.lights.values():
            light.write(document, animation, self.lost)
        for camera in self.cameras.values():
            camera.write(document, animation, self.lost)
        world = None
        for dome in self.domes.values():
            path = str(dome.prim.GetPath())
            if dome.seen is None:
                continue
            if world is not None:
                self.lost.add(path, "second dome light", "only the first is used; add their images up")
                continue
            if len(dome.states) > 1:
                self.lost.add(path, "dome light that changes", "it stays as it is where it is first seen; animate other lights instead")
            world = write_dome(dome.prim, *dome.seen, self.up, self.output, self.lost)
        cuts = self._cuts()
        if world is None and not self.lights and cuts and self.options.camera_light:
            self._camera_light(document, animation, cuts)
        animation.close()
        self.said.into(self.lost, self.source.name, "USD", "something may be missing from the picture; check the stage with usdchecker")
        self._finish(document, world, cuts)
        return Result(self.output.target, self.lost, document.root)

    def _animated(self) -> bool:
        """Whether any attribute of the stage has more than one time sample (or clips)."""
        predicate = Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)
        return any(a.ValueMightBeTimeVarying() for p in Usd.PrimRange.Stage(self.stage, predicate) for a in p.GetAttributes())

    def _all_tracks(self) -> dict[tuple, Track | LightTrack | CameraTrack]:
        return self.tracks | self.lights | self.cameras

    def _steps(self) -> np.ndarray:
        poses = [distinct(t.poses) for t in self._all_tracks().values()]
        moving = [p for p in poses if len(p) > 1]
        if not moving:
            return np.ones(max(len(self.taken) - 1, 0), dtype=int)
        places = np.concatenate([p[:, :3, 3] for p in poses])
        return motion.steps_between(np.stack(moving, axis=1), max(float(np.linalg.norm(np.ptp(places, axis=0))), 1.0))

    def _time(self, frame: float) -> Usd.TimeCode:
        return Usd.TimeCode(frame * self.codes_per_frame)

    def _at(self, frame: float) -> None:
        time, sample = self._time(frame), len(self.taken)
        seen = set()
        aspect = None
        if self.resolution is not None:
            aspect = self.resolution[0] * self.pixel_aspect / self.resolution[1]
        for found in self.walker.at(time, still=sample == 0):
            seen.add(found.key)
            if found.still:
                self.still.add(found.key)
            world = self.root @ found.matrix
            if not (np.abs(world) < 1e15).all():
                self.lost.add(str(found.prim.GetPath()), "transform that is no usable number", "it is hidden while that lasts; check its xformOps")
                found.visible, world = False, self.root
            if found.kind == "camera":
                path, wrong = str(found.prim.GetPath()), flaw(found.prim, time)
                if wrong or path in self.flaws:
                    self.flaws.setdefault(path, wrong)
                    self.cameras.pop(found.key, None)
                    continue
                track = self.cameras.setdefault(found.key, CameraTrack(found.prim))
                track.sample(time, world, self.units, aspect, self.policy)
            elif found.kind == "dome":
                self.domes.setdefault(found.key, DomeTrack(found.prim)).sample(time, world, found.visible)
            elif found.kind == "light":
                light = self.lights.setdefault(found.key, LightTrack(found.prim))
                for _ in range(len(light.poses), sample):
                    light.sample(time, world, False, self.units)
                light.sample(time, world, found.visible, self.units)
            else:
                self._drawn(found, world, time, sample)
        for key, track in [*self.tracks.items(), *self.lights.items()]:
            if key not in seen and key not in self.still:
                for name, values in vars(track).items():
                    if isinstance(values, list):
                        values.append(False if name == "visible" else values[-1])
        self.taken.append(frame)

    def _drawn(self, found: Found, world: np.ndarray, time: Usd.TimeCode, sample: int) -> None:
        shape = self.geometry.of(found.prim, found.kind, time, sample)
        if shape is None and found.key not in self.tracks:
            return
        track = self.tracks.setdefault(found.key, Track(found.prim.GetName()))
        if shape is not None:
            world = world @ self.geometry.items[shape].placed
        for visible in [False] * (sample - len(track.poses)) + [found.visible and shape is not None]:
            track.add(world, visible, shape)

    def _cuts(self) -> list[dict[str, Any]]:
        """The camera asked for, the render settings', the one bound in a viewer, or the first that moves."""
        tracks = {str(t.prim.GetPath()): t for t in self.cameras.values()}
        known, wanted = [*tracks, *self.flaws], self.camera
        if wanted is not None and wanted not in known:
            near = [p for p in known if p.endswith("/" + wanted.lstrip("/"))]
            if len(near) != 1:
                raise InputError(f"camera {wanted}: the stage has {', '.join(known) or 'none'}")
            wanted = near[0]
        if wanted is None:
            settings = self.stage.GetRootLayer().customLayerData.get("cameraSettings")
            bound = settings.get("boundCamera") if isinstance(settings, dict) else None
            moving = next((p for p, t in tracks.items() if motion.varies(np.array(t.poses))), None)
            wanted = bound if bound in tracks else moving or next(iter(known), None)
        if wanted in self.flaws:
            raise InputError(f"camera {wanted}: {self.flaws[wanted]}; it must be a number over 0")
        for path, wrong in self.flaws.items():
            self.lost.add(path, f"camera whose {wrong}", "it is left out; give it a number over 0")
        if wanted is None:
            self.lost.add(str(self.source.name), "no camera", "add a Camera to the stage, or convert with --turntable")
            return []
        return [{"frame": self.frames[0], "camera": wanted, "node": tracks[wanted].node}]

    def _camera_light(self, document: Document, animation: motion.Animation, cuts: list[dict[str, Any]]) -> None:
        """A stage without lights is lit from its camera, as usdview and usdrecord do: white that faces it comes out as 1."""
        document.use_extension("KHR_lights_punctual")
        light = {"type": "directional", "name": "camera light", "intensity": extras.LUMENS_PER_WATT * math.pi}
        document.root.setdefault("extensions", {})["KHR_lights_punctual"] = {"lights": [light]}
        node: dict[str, Any] = {"name": "camera light", "extensions": {"KHR_lights_punctual": {"light": 0}}}
        index = document.append("nodes", node)
        track = next(t for t in self.cameras.values() if t.node == cuts[0]["node"])
        animation.node(node, index, np.array(track.poses))
        self.lost.add(self.source.name, "no lights", "it is lit from the camera as usdview does; add lights, or pass --no-camera-light")

    def _finish(self, document: Document, world: dict[str, Any] | None, cuts: list[dict[str, Any]]) -> None:
        nodes = document.root.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        scene: dict[str, Any] = {"name": self.source.stem}
        top = [i for i in range(len(nodes)) if i not in below]
        if top:
            scene["nodes"] = top
        track = next((t for t in self.cameras.values() if cuts and t.node == cuts[0]["node"]), None)
        if self.resolution is None:
            # As usdrecord does it: a fixed width, and the height of the camera's own aspect.
            aspect = track.lens[0]["aspect"] if track else 16 / 9
            self.resolution = (_DEFAULT_WIDTH, max(round(_DEFAULT_WIDTH / aspect), 1))
        if self.policy == "adjustPixelAspectRatio" and track:
            self.pixel_aspect = track.lens[0]["aspect"] * self.resolution[1] / self.resolution[0]
        shutter = self._shutter(track)
        buzz = extras.scene_extras(
            generator="Buzz USD converter",
            application=f"USD {'.'.join(map(str, Usd.GetVersion()))}",
            file=str(self.source),
            fps=self.fps,
            frames=self.frames,
            resolution=self.resolution,
            pixel_aspect=self.pixel_aspect,
            shutter=shutter,
            cuts=cuts,
            world=world,
            lost=self.lost,
        )
        buzz["aspect_policy"] = self.policy
        scene["extras"] = {"buzz": buzz}
        document.root["asset"] = {"version": "2.0", "generator": buzz["generator"]}
        document.root["scenes"], document.root["scene"] = [scene], 0
        extras.check(document.root)
        self.output.finish(document)

    def _shutter(self, track: CameraTrack | None) -> float | None:
        if track is None:
            return None
        camera = UsdGeom.Camera(track.prim)
        now = self._time(self.frames[0])
        opened, closed = camera.GetShutterOpenAttr().Get(now), camera.GetShutterCloseAttr().Get(now)
        return (closed - opened) / self.codes_per_frame if closed > opened else None
