//! Arguments as typed.

use super::parse;
use buzz::sequence::Settings;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Renders an animated camera move: traces key frames, infers the frames between them, writes EXRs.
#[derive(Debug, Parser)]
#[command(
    name = "buzz-convert",
    version,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Exit status: 0 done, 1 a frame failed, 2 usage, 3 input missing, invalid or unsupported, \
                  4 output not writable, in use or there already, 130/143 interrupted (finished frames are whole).\n\
                  Example: buzz-convert anim.gltf out/ -r 1920x1080 -f 1-100"
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
    #[command(flatten)]
    pub convert: ConvertArgs,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show the key frames and segments, and why they are there; renders nothing.
    Plan(PlanArgs),
    /// Show what the scene holds, what it requires and what will be ignored.
    Inspect(InspectArgs),
    /// Measure the error of a sequence against a reference, frame by frame.
    Compare(CompareArgs),
    /// Measure what each quality costs and gets wrong, all on the same frames.
    Trade(TradeArgs),
}

/// Optional for the parser's sake only: a subcommand takes their place.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// The scene: .gltf, .glb, or .obj (with --camera-from or --turntable).
    #[arg(required = true)]
    pub input: Option<PathBuf>,
    /// Folder for the EXR sequence and report.json; made with all above it if it is not there.
    #[arg(required = true)]
    pub out_dir: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub image: ImageArgs,
    #[command(flatten)]
    pub output: OutputArgs,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// The scene: .gltf, .glb, or .obj (with --camera-from or --turntable).
    pub input: PathBuf,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub image: ImageArgs,
    /// Plan for so many machines that render at the same time: the last one is done as soon as possible.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub workers: u32,
    /// How to print; openjd is a job for a render farm.
    #[arg(long, value_enum, default_value = "text")]
    pub format: PlanFormat,
    /// Options that the tasks of --format openjd convert with, besides those given here: -- --aov all.
    #[arg(last = true, value_name = "CONVERT OPTIONS", allow_hyphen_values = true)]
    pub convert: Vec<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "What is required, and the stages that follow from it: docs/requirements.md")]
pub struct InspectArgs {
    /// The scene: .gltf, .glb or .obj.
    pub input: PathBuf,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    pub format: Format,
}

#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Folder with the sequence to measure.
    pub dir: PathBuf,
    /// Folder with the sequence to measure it against.
    pub reference: PathBuf,
    /// How to print.
    #[arg(long, value_enum, default_value = "text")]
    pub format: Format,
    /// Exit with 1 if any frame's PSNR is under this.
    #[arg(long, value_name = "DB", allow_negative_numbers = true)]
    pub fail_below: Option<f64>,
    /// Write a PNG a frame there: the frame, its reference, and their difference times 4. Replaces those of before.
    #[arg(long, value_name = "FOLDER")]
    pub differences: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct TradeArgs {
    /// The scene: .gltf, .glb, or .obj (with --camera-from or --turntable).
    pub input: PathBuf,
    /// Folder for trade.html, trade.txt, trade.csv and trade.json.
    pub out_dir: PathBuf,
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub render: RenderArgs,
    /// Measure the segments that hold these frames, whole [default: segments from all over, some 48 frames].
    #[arg(short, long, allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// How to show progress.
    #[arg(long, value_enum, default_value = "auto")]
    pub progress: ProgressArg,
}

/// What to read, and how.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// Frames per second: 24, 23.976 or 24000/1001 [default: the scene's, else 24].
    #[arg(long, allow_hyphen_values = true)]
    pub fps: Option<String>,
    /// Camera by name or index [default: the scene's cuts, else the first animated camera, else the first].
    #[arg(short, long)]
    pub camera: Option<String>,
    /// Renumber: the first frame gets this number.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub start_frame: Option<i64>,
    /// Orbit the scene in so many frames, for a file without a camera.
    #[arg(long, value_name = "FRAMES")]
    pub turntable: Option<u32>,
    /// Add static geometry from an OBJ file; may be given again.
    #[arg(long, value_name = "OBJ")]
    pub geometry: Vec<PathBuf>,
    /// Take cameras, lights and animation from this glTF, for an OBJ input.
    #[arg(long, value_name = "GLTF")]
    pub camera_from: Option<PathBuf>,
    /// Treat a scene feature that would be ignored as an error.
    #[arg(long)]
    pub strict: bool,
}

/// What a frame looks like, and how accurate it is.
#[derive(Debug, Args)]
pub struct ImageArgs {
    /// Accuracy of the frames that are not key frames.
    #[arg(short, long, value_enum, default_value = "centred")]
    pub quality: QualityArg,
    #[command(flatten)]
    pub render: RenderArgs,
}

/// What every quality has in common.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Image size: 1920x1080, or a share of the scene's own: 50% [default: the scene's, else 1280x720].
    #[arg(short, long)]
    pub resolution: Option<String>,
    /// Shadow rays to each light that has a size; a single one goes to its middle.
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub light_samples: u32,
    /// Rays a point to the world, for ambient occlusion; without any the world shines through everything.
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(..=4096))]
    pub ambient_samples: u32,
    /// Longest segment in frames, or auto.
    #[arg(long, default_value = "auto")]
    pub segment: String,
    /// Threads for everything, encoding included [default: all].
    #[arg(short = 'j', long)]
    pub threads: Option<usize>,
}

#[derive(Debug, Args)]
pub struct OutputArgs {
    /// Frames: 1-100, 1-100x2 or 1-100:2 (every second), 1-10,20-30, -3--1, 1-20&10-30 (those in both) [default: the scene's own range].
    #[arg(short, long, allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Render only this part: x,y,width,height in pixels of the full frame.
    #[arg(long, allow_hyphen_values = true)]
    pub crop: Option<String>,
    /// Colour and alpha are 0 where only the world is seen, and what is blended or thin is see-through before it.
    #[arg(long)]
    pub transparent: bool,
    /// Stops applied to the colour channels.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = parse::stops)]
    pub exposure: f32,
    /// Depth of reflection and refraction.
    #[arg(long, default_value_t = 4, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(..=64))]
    pub bounces: u32,
    /// Levels of super-sampling: 1 is one sample a pixel, 2 and 3 take up to 3x3 and 5x5 where neighbours differ.
    #[arg(long, value_name = "LEVELS", default_value_t = 1, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MOST_LEVELS)))]
    pub aa: u32,
    /// Render a pair of eyes so far apart, metres, about each camera: a file for the left and one for the right.
    #[arg(long, value_name = "DISTANCE", allow_negative_numbers = true, value_parser = parse::metres)]
    pub stereo: Option<f64>,
    /// Distance of what both eyes see at the same place, metres [default: infinite, parallel eyes].
    #[arg(long, value_name = "DISTANCE", requires = "stereo", allow_negative_numbers = true, value_parser = parse::metres)]
    pub convergence: Option<f64>,
    /// Cast a ray to every reused sample and report how many are hidden (slow).
    #[arg(long)]
    pub audit: bool,
    /// Layers beside the beauty: depth class normal position motion object diffuse specular emission lights crypto,
    /// by commas; or all, or beauty (depth,class).
    #[arg(long, default_value = "depth,class")]
    pub aov: String,
    /// Compression of the EXR files.
    #[arg(long, value_enum, default_value = "zip")]
    pub compression: CompressionArg,
    /// File names, with %04d or #### for the frame number; `<stem>.%04d.exr` if not given. In stereo, the eye's
    /// name is put before the number.
    #[arg(long, value_name = "PATTERN")]
    pub name: Option<String>,
    /// Keep the frames that are there, complete and of this scene and these settings; render the others, and replace those of other ones.
    #[arg(long, conflicts_with = "overwrite")]
    pub skip_existing: bool,
    /// Replace the frames that are there.
    #[arg(long)]
    pub overwrite: bool,
    /// Where to write the report [default: report.json in the output folder].
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Replay a plan that plan --format json has printed.
    #[arg(long, value_name = "FILE", conflicts_with = "segment")]
    pub plan: Option<PathBuf>,
    /// Refuse to render if the estimate of the memory it takes is over this: 2GiB (a number alone is bytes). [default: what the machine has]
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<String>,
    /// How to show progress.
    #[arg(long, value_enum, default_value = "auto")]
    pub progress: ProgressArg,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    Text,
    Json,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlanFormat {
    Text,
    Json,
    /// Open Job Description: a template for openjd run and Deadline Cloud.
    Openjd,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum QualityArg {
    /// Every frame traced.
    Full,
    /// The paper's guarantee: every reused sample lies inside its pixel.
    HalfPixel,
    /// Every sample at its pixel's centre; rays at edges of surfaces and shadows.
    Centred,
    /// Centred, and every reused sample proven visible.
    Verified,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CompressionArg {
    None,
    Rle,
    Zips,
    Zip,
    Piz,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressArg {
    /// A bar on a terminal, lines otherwise.
    Auto,
    Bar,
    Plain,
    /// Open Job Description's messages.
    Openjd,
    None,
}
