//! What the demo leaves behind: cloud, report and picture.

use std::fmt;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use image::ImageFormat;

use crate::cli::evaluate::Opened;
use crate::cli::{Failed, output};
use crate::pipeline::Profile;
use crate::render::{Colouring, Options, Subject, Theme, View, draw};

/// Where the error's colours end in the picture, mm. The demo's scan is good.
const MAX_ERROR_MM: f32 = 0.2;

/// Height of a view in the picture, pixels.
const HEIGHT: u32 = 720;

/// The files' places. Displayed, a line for each.
pub(super) struct Results {
    cloud: PathBuf,
    report: PathBuf,
    picture: PathBuf,
}

impl Results {
    /// Makes the folder; refuses one in which they can't be written.
    pub(super) fn new(folder: &Path) -> Result<Self, Failed> {
        std::fs::create_dir_all(folder)
            .map_err(|error| Failed::internal(format!("{} can't be made: {error}", folder.display())))?;
        let [cloud, report, picture] = ["skin.ply", "report.json", "skin.png"].map(|name| folder.join(name));
        [&cloud, &report, &picture].into_iter().try_for_each(|path| output::check(path))?;
        Ok(Self { cloud, report, picture })
    }

    /// Writes the cloud and the report as the service keeps them, and draws the cloud.
    pub(super) fn write(&self, cloud: &[u8], report: &[u8], profile: Profile) -> Result<(), Failed> {
        output::write(&self.cloud, cloud)?;
        output::write(&self.report, report)?;
        let shape = Opened::new(&self.cloud, None)?.shape;
        let options = Options {
            views: vec![View::Front, View::Left],
            colouring: if profile == Profile::Precise { Colouring::Error } else { Colouring::Plane },
            max_error_mm: MAX_ERROR_MM,
            panel_height: HEIGHT,
            theme: Theme::Light,
        };
        let mut png = Cursor::new(Vec::new());
        draw(&[Subject { shape: &shape, caption: profile.name().to_owned() }], &options)
            .write_to(&mut png, ImageFormat::Png)
            .map_err(Failed::internal)?;
        output::write(&self.picture, &png.into_inner())
    }
}

impl fmt::Display for Results {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "cloud    {}", self.cloud.display())?;
        writeln!(f, "report   {}", self.report.display())?;
        write!(f, "picture  {}", self.picture.display())
    }
}
