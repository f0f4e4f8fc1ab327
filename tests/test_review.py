"""What stands in `report.review`: opened by OpenTimelineIO, run by Blender, its Nuke script parsed, the movie of docs/review.md made."""

import base64
import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import opentimelineio as otio
import pytest
from PIL import Image
from sequences import ROOT, convert, read_exr

SIZE = (96, 54)
FRAMES = range(50, 70)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames 50-69 of courtyard, with a cut at 60 and key frames, under a name with a space."""
    out = tmp_path_factory.mktemp("review") / "a folder"
    convert(ROOT / "scenes/courtyard/courtyard.gltf", out, "-r", "96x54", "-f", "50-69", "--segment", "12", "--aov", "depth,class,object", "--name", "yard one.####.exr")
    return out


def review(sequence: Path) -> Path:
    """The folder with the files to look at."""
    return next(sequence.glob("*.review"))


def test_the_timeline_lists_all_frames(sequence: Path) -> None:
    """Every frame's file, in order; a clip for each shot; key frames marked."""
    path = review(sequence) / "timeline.otio"
    timeline = otio.adapters.read_from_file(str(path))
    clips = list(timeline.find_clips())
    assert [clip.name for clip in clips] == ["yard one 50-59", "yard one 60-69"]
    files = []
    for clip in clips:
        reference = clip.media_reference
        files += [path.parent / unquote(reference.target_url_for_image_number(i)) for i in range(reference.number_of_images_in_sequence())]
        assert clip.source_range == reference.available_range
    assert [f.name for f in files] == [f"yard one.{n:04}.exr" for n in FRAMES]
    assert all(f.exists() for f in files)
    assert timeline.duration().to_frames() == len(FRAMES)
    assert timeline.global_start_time.to_frames() == 50
    markers = [int(m.marked_range.start_time.value) for clip in clips for m in clip.markers]
    report = next(sequence.glob("report*.json")).read_text()
    assert markers and all(re.search(rf'"frame": {m},\s+"reason"', report) for m in markers)


@pytest.fixture(scope="module")
def across_zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames -4 to 5 of a courtyard that begins at -4, in pixels twice as wide as high."""
    folder = tmp_path_factory.mktemp("negative")
    scene = shutil.copytree(ROOT / "scenes/courtyard", folder / "scene") / "courtyard.gltf"
    document = json.loads(scene.read_text())
    extras = document["scenes"][0]["extras"]["buzz"]
    extras |= {"frame_start": -4, "frame_end": 91, "pixel_aspect": 2}
    for cut in extras["cuts"]:
        cut["frame"] -= 4
    scene.write_text(json.dumps(document))
    convert(scene, folder / "out", "-r", "48x54", "-f=-4-5", "--name", "neg.####.exr")
    return folder / "out"


def test_the_timeline_finds_frames_below_0(across_zero: Path) -> None:
    """OpenTimelineIO pads the digits alone, so there is a clip on either side of 0, without a gap between them."""
    path = review(across_zero) / "timeline.otio"
    timeline = otio.adapters.read_from_file(str(path))
    clips = list(timeline.find_clips())
    assert [clip.name for clip in clips] == ["neg -4--1", "neg 0-5"]
    references = [clip.media_reference for clip in clips]
    files = [path.parent / unquote(r.target_url_for_image_number(i)) for r in references for i in range(r.number_of_images_in_sequence())]
    assert [f.name for f in files] == ["neg.-004.exr", "neg.-003.exr", "neg.-002.exr", "neg.-001.exr", *(f"neg.{n:04}.exr" for n in range(6))]
    assert all(f.exists() for f in files)
    assert (timeline.duration().to_frames(), timeline.global_start_time.to_frames()) == (10, -4)


def test_pictures_have_the_shape_of_what_is_shown(across_zero: Path) -> None:
    """The contact sheet's and the report's, and what Nuke is told: 48x54 pixels of aspect 2 are 96 wide."""
    folder = review(across_zero)
    assert Image.open(folder / "sheet.png").size == (6 * 100 + 4, 2 * 58 + 4)
    pictures = re.findall(r"data:image/(?:jpeg|webp);base64,([\w+/=]+)", folder.with_suffix(".html").read_text())
    assert {Image.open(io.BytesIO(base64.b64decode(p))).size for p in pictures} == {(96, 54)}
    root = nuke_nodes((folder / "nuke.nk").read_text())[0][1]
    assert root["format"] == "48 54 0 0 48 54 2 Buzz"


def nuke_nodes(text: str) -> list[tuple[str, dict[str, str]]]:
    """The nodes of a Nuke script with their knobs: `Kind {\\n name value ...}`."""
    nodes = []
    for kind, body in re.findall(r"^(\w+) \{\n(.*?)^\}", text, re.MULTILINE | re.DOTALL):
        knobs = dict(re.match(r' (\w+) (?:"(.*)"|(.*))$', line).group(1, 2) for line in body.splitlines() if '"' in line)
        knobs |= dict(line.split(None, 1) for line in body.splitlines() if '"' not in line)
        nodes.append((kind, knobs))
    return nodes


def test_the_nuke_script_has_the_knobs_it_should(sequence: Path) -> None:
    """The frames, their range and rate, and colours for each class; the beauty is what the overlay is laid over."""
    path = review(sequence) / "nuke.nk"
    text = path.read_text()
    nodes = nuke_nodes(text)
    assert [kind for kind, _ in nodes] == ["Root", "Read", "Expression", "Merge2", "Viewer"]
    root, read, expression, merge, viewer = (knobs for _, knobs in nodes)
    assert (root["first_frame"], root["last_frame"], root["fps"]) == ("50", "69", "24")
    assert root["format"].startswith("96 54 ")
    assert (read["first"], read["last"], read["origfirst"], read["origlast"]) == ("50", "69", "50", "69")
    folder = read["file"].replace(r"\[file dirname \[value root.name]]", str(path.parent))
    assert (Path(folder % 57)).exists()
    assert (merge["inputs"], merge["operation"], viewer["frame_range"]) == ("2", "over", "50-69")
    assert text.index("push $Beauty") > text.index("Expression {"), "the last on the stack is the background"
    assert text.startswith("add_layer {pixelClass pixelClass.id}")
    # The expression is C's: evaluated here for each class.
    for number, red in [(0, 150), (3, 235), (9, 70)]:
        value = expression["expr0"]
        while "?" in value:
            question, answer, value = re.match(r"(.*?)\?([\d.]+):(.*)", value).groups()
            if question == f"pixelClass.id=={number}":
                value = answer
        assert float(value) == pytest.approx(((red / 255 + 0.055) / 1.055) ** 2.4, abs=1e-4)


BLENDER = """
import runpy, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
runpy.run_path(sys.argv[1], run_name="__main__")
scene = bpy.context.scene
tree = scene.compositing_node_group
image = next(n for n in tree.nodes if n.type == "IMAGE")
print("SOCKETS", [s.name for s in image.outputs if s.enabled])
print("RANGE", scene.frame_start, scene.frame_end, scene.render.resolution_x, scene.render.resolution_y, scene.render.fps)
print("ASPECT", scene.render.pixel_aspect_x, scene.render.pixel_aspect_y)
mix = next(n for n in tree.nodes if n.label == "Class overlay")
next(s for s in mix.inputs if s.name == "Factor" and s.enabled).default_value = float(sys.argv[3])
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
scene.collection.objects.link(camera)
scene.camera = camera
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
scene.view_settings.view_transform = "Standard"
scene.render.image_settings.file_format = "PNG"
scene.render.filepath = sys.argv[2]
scene.frame_set(int(sys.argv[4]))
bpy.ops.render.render(write_still=True)
"""


def on_screen(channels: dict[str, np.ndarray]) -> np.ndarray:
    """The beauty as sRGB, 0 to 255."""
    linear = np.clip(np.stack([channels[c] for c in "RGB"], axis=2), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055) * 255


def run_blender(script: Path, picture: Path, strength: float, frame: int = 57) -> tuple[str, np.ndarray]:
    """Runs the script in Blender and renders a frame of what it built."""
    command = [sys.executable, "-c", BLENDER, str(script), str(picture), str(strength), str(frame)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout, np.asarray(Image.open(picture).convert("RGB"))


def test_the_blender_script_shows_beauty_and_classes(sequence: Path, tmp_path: Path) -> None:
    """Blender's own picture of frame 57: without the overlay the beauty, with all of it the classes in their colours."""
    script = review(sequence) / "blender.py"
    channels = read_exr(sequence / "yard one.0057.exr")
    text, beauty = run_blender(script, tmp_path / "beauty.png", 0.0)
    assert "'pixelClass'" in text and "'depth'" in text and "'objectId'" in text, text
    assert "RANGE 50 69 96 54 24" in text
    assert np.abs(beauty - on_screen(channels)).max() <= 2
    _, classes = run_blender(script, tmp_path / "classes.png", 1.0)
    colors = {0: (150, 150, 150), 1: (24, 48, 84), 2: (0, 130, 140), 3: (235, 64, 52), 4: (255, 170, 0), 5: (255, 235, 80)}
    colors |= {6: (190, 80, 220), 7: (120, 220, 100), 8: (255, 120, 190), 9: (70, 110, 190)}
    seen = 0
    for number, color in colors.items():
        where = channels["pixelClass.id"] == number
        seen += where.sum()
        assert np.abs(classes[where].astype(int) - color).max(initial=0) <= 2, number
    assert seen == SIZE[0] * SIZE[1]


def test_the_blender_script_shows_frames_below_0(across_zero: Path, tmp_path: Path) -> None:
    """Frame -4 is the scene's frame 1, and so on beyond 0; the scene's pixels are twice as wide as high."""
    script = review(across_zero) / "blender.py"
    shown = [(2, "neg.-003.exr"), (5, "neg.0000.exr"), (10, "neg.0005.exr")]
    for frame, name in shown:
        text, beauty = run_blender(script, tmp_path / "beauty.png", 0.0, frame)
        assert "frame -4 is shown as frame 1" in text and "RANGE 1 10 48 54 24" in text and "ASPECT 2.0 1.0" in text, text
        assert np.abs(beauty - on_screen(read_exr(across_zero / name))).max() <= 2, name


@pytest.mark.parametrize("window", [(10, 5, 33, 19), (60, 30, 36, 24)])
def test_the_blender_script_puts_a_crop_at_its_place(tmp_path: Path, window: tuple[int, int, int, int]) -> None:
    """The crop to the pixel, of odd sizes too, and nothing around it."""
    out, (x, y, width, height) = tmp_path / "out", window
    convert(ROOT / "scenes/courtyard/courtyard.gltf", out, "-r", "96x54", "-f", "57", "--crop", ",".join(map(str, window)))
    _, beauty = run_blender(review(out) / "blender.py", tmp_path / "crop.png", 0.0)
    expected = np.zeros((SIZE[1], SIZE[0], 3))
    expected[y : y + height, x : x + width] = on_screen(read_exr(out / "courtyard.0057.exr"))
    assert beauty.shape == expected.shape
    assert np.abs(beauty - expected).max() <= 2


def test_the_contact_sheet_shows_the_frames(sequence: Path) -> None:
    """Six pictures side by side, none black."""
    sheet = np.asarray(Image.open(review(sequence) / "sheet.png").convert("RGB")).astype(int)
    width, height = SIZE[0] + 4, SIZE[1] + 4
    assert sheet.shape == (4 * height + 4, 6 * width + 4, 3)
    for i in range(len(FRAMES)):
        x, y = 4 + i % 6 * width, 4 + i // 6 * height
        assert sheet[y : y + SIZE[1], x : x + SIZE[0]].max() > 100, i


def test_the_movie_of_the_documentation_is_made(sequence: Path, tmp_path: Path) -> None:
    """The command of docs/review.md, with this sequence's names in it."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    ffmpeg = shutil.which("ffmpeg") or imageio_ffmpeg.get_ffmpeg_exe()
    line = next(li for li in (ROOT / "docs/review.md").read_text().splitlines() if li.startswith("ffmpeg "))
    movie = tmp_path / "movie.mp4"
    words = [
        {"ffmpeg": ffmpeg, "out/courtyard.%04d.exr": str(sequence / "yard one.%04d.exr"), "0": "50", "courtyard.mp4": str(movie)}.get(w, w.strip('"'))
        for w in line.split(" ")
    ]
    subprocess.run(words, check=True, capture_output=True)
    # Its pictures are the beauty as a screen shows it.
    still = tmp_path / "still.png"
    subprocess.run([ffmpeg, "-v", "error", "-i", movie, "-frames:v", "1", still], check=True)
    shown = on_screen(read_exr(sequence / "yard one.0050.exr"))
    # Detail is lost to compression, brightness is not.
    assert abs((np.asarray(Image.open(still).convert("RGB")) - shown).mean()) < 3
    probe = subprocess.run([ffmpeg, "-i", movie, "-f", "null", "-"], capture_output=True, text=True, check=True).stderr
    assert re.search(r"frame=\s*20\b", probe) and "96x54" in probe, probe
