//! `triplanar render`: a picture of clouds.

use std::io::Cursor;
use std::path::PathBuf;

use clap::builder::TypedValueParser;
use image::ImageFormat;

use super::evaluate::Opened;
use super::{Exit, Failed, output, values};
use crate::geometry::Frame;
use crate::render::{Colouring, Options, Subject, Theme, View, draw};

/// Draw clouds side by side, as a PNG
///
/// All panels have the same scale. `front` looks at the face: the patient's left is at the picture's
/// right.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The clouds (of a mesh: its points), in the formats that `evaluate` reads
    #[arg(value_name = "CLOUD", required = true)]
    clouds: Vec<PathBuf>,
    /// Where the picture goes
    #[arg(short, long, value_name = "PNG")]
    output: PathBuf,
    /// Sides to look from, separated by commas
    #[arg(long, value_parser = view(), value_delimiter = ',', default_value = "front,left")]
    view: Vec<View>,
    /// What the colours say: the stated error and the planes are properties of the cloud's file
    #[arg(long, value_parser = colouring(), default_value = "plane")]
    colour: Colouring,
    /// Where the colours of the error end
    #[arg(long, value_name = "MM", default_value_t = 0.5, value_parser = max_error)]
    max_error: f32,
    /// Caption of each cloud, in their order; the file's name, if not given
    #[arg(long, value_name = "TEXT")]
    caption: Vec<String>,
    /// Height of a panel, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 720, value_parser = clap::value_parser!(u32).range(64..=4096))]
    height: u32,
    /// Colours around the clouds
    #[arg(long, value_parser = theme(), default_value = "light")]
    theme: Theme,
    /// Frame of the clouds; what their files say, or lps, if not given
    #[arg(long, value_parser = values::frame())]
    frame: Option<Frame>,
}

fn view() -> impl TypedValueParser<Value = View> {
    values::named(View::ALL.map(|view| (view.name(), view)))
}

fn colouring() -> impl TypedValueParser<Value = Colouring> {
    values::named(Colouring::ALL.map(|colouring| (colouring.name(), colouring)))
}

fn theme() -> impl TypedValueParser<Value = Theme> {
    values::named([Theme::Light, Theme::Dark].map(|theme| (theme.name(), theme)))
}

fn max_error(text: &str) -> Result<f32, String> {
    let error = text.parse().ok().filter(|error: &f32| error.is_finite() && *error > 0.0);
    error.ok_or_else(|| "a length above 0, mm".to_owned())
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let is_png = args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if !is_png {
        return Err(Failed::usage(format!("{} is to be a PNG: name it .png", args.output.display())));
    }
    if args.caption.len() > args.clouds.len() {
        return Err(Failed::usage("there are more captions than clouds"));
    }
    output::all_differ([args.output.as_path()], args.clouds.iter().map(PathBuf::as_path))?;
    output::check(&args.output)?;
    let opened: Vec<Opened> =
        args.clouds.iter().map(|path| Opened::new(path, args.frame)).collect::<Result<_, _>>()?;
    if let Some((path, _)) = args.clouds.iter().zip(&opened).find(|(_, cloud)| cloud.shape.points.is_empty())
    {
        let message = format!("{} holds no usable point; check the file and how it was made", path.display());
        return Err(Failed::new(Exit::Input, message));
    }
    let property = args.colour.property();
    if let Some(name) =
        property.filter(|name| opened.iter().all(|cloud| cloud.shape.property(name).is_none()))
    {
        let message = format!(
            "no point of the files has the property {name}; choose --colour normal or height, or give a PLY or PCD that has it"
        );
        return Err(Failed::new(Exit::Input, message));
    }
    let name = |path: &PathBuf| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let subjects: Vec<Subject<'_>> = (args.clouds.iter().enumerate().zip(&opened))
        .map(|((index, path), cloud)| Subject {
            shape: &cloud.shape,
            caption: args.caption.get(index).cloned().unwrap_or_else(|| name(path)),
        })
        .collect();
    let options = Options {
        views: args.view,
        colouring: args.colour,
        max_error_mm: args.max_error,
        panel_height: args.height,
        theme: args.theme,
    };
    let mut png = Cursor::new(Vec::new());
    draw(&subjects, &options).write_to(&mut png, ImageFormat::Png).map_err(Failed::internal)?;
    output::write(&args.output, &png.into_inner())?;
    output::print(format_args!("picture      {}\n", args.output.display()))
}
