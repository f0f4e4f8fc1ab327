"""Reading EXR files and rendering with Cycles, for comparisons."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """All channels of an EXR file by name, as float arrays (height, width)."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        parts = [part.channels for part in file.parts]
        return {name: np.array(channel.pixels, dtype=np.float64) for channels in parts for name, channel in channels.items()}


def rgb(channels: dict[str, np.ndarray]) -> np.ndarray:
    """(height, width, 3) of the root layer."""
    return np.stack([channels[c] for c in "RGB"], axis=2)


def cycles_settings(bpy) -> None:
    """One sample through each pixel's centre, direct light only, nothing done to the numbers."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 1, False, False
    cycles.max_bounces = 0
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", 0.01
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.view_settings.view_transform = "Standard"
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_object_index = True


def cycles_render(bpy, path: Path, frame: int | None = None, layers: bool = True) -> dict[str, np.ndarray]:
    """Render the current frame; Combined as R, G, B, A, with layers also depth and object index as `Z` and `index`."""
    scene = bpy.context.scene
    if frame is not None:
        scene.frame_set(frame)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if layers else "IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER" if layers else "OPEN_EXR", "32"
    settings.color_mode = "RGBA"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    if not layers:
        return read_exr(path)
    out = {}
    for name, values in read_exr(path).items():
        tail = name.split(".", 1)[-1]
        if tail.startswith("Combined.") and name[-1] in "RGBA":
            out[name[-1]] = values
        elif tail.startswith("Depth."):
            out["Z"] = values
        elif "Index" in tail:
            out["index"] = values
    return out


def mask_difference(a: np.ndarray, b: np.ndarray) -> float:
    """Share of pixels where two label pictures disagree; labels are matched by where they lie most often."""
    wrong = 0
    for label in np.unique(a):
        inside = b[a == label]
        _, counts = np.unique(inside, return_counts=True)
        wrong += inside.size - counts.max()
    for label in np.unique(b):
        inside = a[b == label]
        _, counts = np.unique(inside, return_counts=True)
        wrong += inside.size - counts.max()
    return wrong / 2 / a.size


def frames_of(folder: Path) -> dict[int, Path]:
    """EXR files by frame number (the last number in the name)."""
    return {int(p.stem.rsplit(".", 1)[-1]): p for p in sorted(folder.glob("*.exr"))}
