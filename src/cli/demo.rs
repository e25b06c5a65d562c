//! `triplanar demo`: the main job, end to end, on this machine.

mod results;
mod score;
mod summary;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use tokio::runtime::Runtime;

use super::signals::Signals;
use super::{Exit, Failed, output, values};
use crate::cloud::ply;
use crate::config::Config;
use crate::dicom::uid::SeriesInstanceUid;
use crate::dimse::scu::{self, Instance, Peer};
use crate::phantom::{Options, Phantom};
use crate::pipeline::Profile;
use crate::reconstruction::Report;
use crate::service::Service;
use crate::store::{ReconstructionFilter, ReconstructionRecord, ReconstructionState};
use crate::telemetry::init_logging;
use results::Results;
use score::Score;
use summary::Summary;

/// Far beyond what the series takes to be noticed as complete and to be reconstructed.
const PATIENCE: Duration = Duration::from_secs(600);

/// How often progress is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Start the service on free ports and a temporary directory, push a synthetic head CT to it by
/// C-STORE, wait for the cloud, check it against the known skin
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// End once the summary is printed, instead of serving until Ctrl-C
    #[arg(long)]
    once: bool,
    /// Folder in which cloud, report and picture are left
    #[arg(long, value_name = "DIR", default_value = "./triplanar-demo")]
    output: PathBuf,
    /// Which pipeline; the default one if not given
    #[arg(long, value_parser = values::profile())]
    profile: Option<Profile>,
}

pub(super) fn run(args: Args) -> Result<(), Failed> {
    let runtime = Runtime::new().map_err(Failed::internal)?;
    let outcome = runtime.block_on(demo(args));
    runtime.shutdown_background();
    outcome
}

async fn demo(args: Args) -> Result<(), Failed> {
    let results = Results::new(&args.output)?;
    let mut signals = Signals::new().map_err(Failed::internal)?;
    let dir = tempfile::tempdir().map_err(Failed::internal)?;
    let mut config = settings(dir.path())?;
    config.pipeline.profile = args.profile.unwrap_or(config.pipeline.profile);
    init_logging(&config.log).map_err(Failed::internal)?;
    let ae_title = config.dimse.ae_title.clone();
    let service = Service::start(config).await.map_err(Failed::internal)?;
    output::print(format_args!("{} serves http://{}\n", crate::SOFTWARE, service.http_addr()))?;
    output::print(format_args!(
        "  DICOM {ae_title}@{}, data in {}\n",
        service.dimse_addr(),
        dir.path().display()
    ))?;

    let shown = tokio::select! {
        shown = show(&service, &ae_title, &results) => shown,
        () = signals.next() => Err(Failed::internal("interrupted")),
    };
    if let (Ok(series), false) = (&shown, args.once) {
        let url = format!("http://{}/v1/series/{series}", service.http_addr());
        output::print(format_args!(
            "\nthe same of the service: {url}/cloud, {url}/report\nserving until Ctrl-C\n"
        ))?;
        signals.next().await;
    }
    service.shutdown().await;
    shown.map(|_| ())
}

/// Compiled-in defaults on free loopback ports: no setting of this machine reaches the demo.
fn settings(dir: &std::path::Path) -> Result<Config, Failed> {
    let mut config = Config::load(None, std::iter::empty()).map_err(Failed::internal)?;
    config.http.listen = ([127, 0, 0, 1], 0).into();
    config.dimse.listen = ([127, 0, 0, 1], 0).into();
    config.storage.data_dir = dir.to_owned();
    "warn".clone_into(&mut config.log.filter);
    Ok(config)
}

/// The main job; the Series Instance UID of what was made.
async fn show(service: &Service, ae_title: &str, results: &Results) -> Result<SeriesInstanceUid, Failed> {
    output::print(format_args!("making a synthetic head CT …\n"))?;
    let (phantom, instances) = tokio::task::spawn_blocking(|| {
        let phantom = Phantom::new(Options::default())?;
        let instances: Vec<_> =
            phantom.instances().into_iter().map(|(_, bytes)| Instance::Bytes(bytes)).collect();
        Ok::<_, crate::phantom::InvalidOptions>((phantom, instances))
    })
    .await
    .map_err(Failed::internal)?
    .map_err(Failed::internal)?;
    let series = phantom.identity().series_instance_uid;

    push(service, ae_title, &instances).await?;
    drop(instances);
    let began = Instant::now();
    let record = finished(service, &series).await?;
    let what = format!("reconstruction {} {}", record.id, record.state);
    if record.state != ReconstructionState::Succeeded {
        let code = record.error_code.unwrap_or_default();
        let detail = record.error_detail.unwrap_or_default();
        return Err(Failed::internal(format!("{what}: {code}: {detail}")));
    }
    output::print(format_args!("{what} {:.1} s after the last instance\n\n", began.elapsed().as_secs_f64()))?;

    let told = service.store().report(record.id).await.map_err(Failed::internal)?;
    let report: Report = serde_json::from_slice(&told).map_err(Failed::internal)?;
    output::print(Summary(&report))?;
    let stored = service.store().cloud(record.id, None).await.map_err(Failed::internal)?;
    let (cloud, _) = ply::decode(&stored).map_err(Failed::internal)?;
    let score = Score::new(&cloud, &phantom);
    output::print(format_args!(
        "\n{} points against the phantom's known skin, nothing registered: rms {:.2} mm, bias {:+.2} mm, \
         stray {:.2} %\n",
        score.points,
        score.rms_mm,
        score.bias_mm,
        100.0 * score.stray
    ))?;
    results.write(&stored, &told, report.parameters.profile)?;
    output::print(format_args!("\n{results}\n"))?;
    if score.is_absurd() {
        return Err(Failed::new(Exit::Internal, "the cloud does not lie on the phantom's known skin"));
    }
    Ok(series)
}

/// C-STORE of all instances over one association, as a PACS does it.
async fn push(service: &Service, ae_title: &str, instances: &[Instance]) -> Result<(), Failed> {
    let peer = Peer {
        address: service.dimse_addr().to_string(),
        called_ae_title: ae_title.to_owned(),
        calling_ae_title: "DEMO".to_owned(),
        timeout: Duration::from_secs(30),
    };
    let bar = bar("C-STORE", instances.len() as u64);
    let sent = scu::store(&peer, instances, |_| bar.inc(1)).await;
    bar.finish_and_clear();
    let outcomes = sent.map_err(Failed::internal)?;
    match outcomes.iter().find(|outcome| !outcome.answer.is_success()) {
        Some(refused) => Err(Failed::internal(format!(
            "instance {} was refused: {:?}",
            refused.sop_instance_uid, refused.answer
        ))),
        None => {
            output::print(format_args!(
                "sent {} instances by C-STORE, each acknowledged with status 0x0000\n",
                outcomes.len()
            ))?;
            Ok(())
        }
    }
}

/// Waits for the series' one reconstruction to end.
async fn finished(service: &Service, series: &SeriesInstanceUid) -> Result<ReconstructionRecord, Failed> {
    let filter = ReconstructionFilter { series_instance_uid: Some(series.clone()), state: None };
    let bar = bar("waiting", 1000);
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let page = service.store().list_reconstructions(&filter, None, 1).await.map_err(Failed::internal)?;
        if let Some(record) = page.rows.into_iter().next() {
            if record.state.is_final() {
                bar.finish_and_clear();
                return Ok(record);
            }
            bar.set_message(record.stage.map_or("queued", |stage| stage.name()));
            bar.set_position((1000.0 * record.fraction) as u64);
        }
        tokio::time::sleep(LOOK).await;
    }
    Err(Failed::internal(format!("no reconstruction after {} s", PATIENCE.as_secs())))
}

/// A bar on a terminal, nothing elsewhere.
fn bar(message: &'static str, length: u64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:12} {wide_bar} {percent:>3} %")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style).with_message(message)
}
