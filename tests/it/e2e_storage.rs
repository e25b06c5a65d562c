//! Bounded by the disk: a full one is told before acceptance, loses nothing, and is got over.

use std::path::Path;
use std::process::Command;

use reqwest::StatusCode;
use serde_json::json;

use crate::support::client::Client;
use crate::support::{pacs, phantom};

#[tokio::test(flavor = "multi_thread")]
async fn below_the_watermark_the_sender_is_told_and_later_it_goes_through() {
    let full = phantom::settings().with("storage.min_free_bytes", "1000000000000000000");
    let service = full.start();
    let series = phantom::small();
    let client = Client::new(service.http);
    let statuses = pacs::statuses(&service, &series.files).await;
    assert!(statuses.iter().all(|status| *status == 0xA700), "{statuses:04X?}");
    let (status, body) = client.upload("application/dicom", series.files[0].clone()).await;
    assert_eq!(status, StatusCode::INSUFFICIENT_STORAGE, "{body}");
    assert_eq!(body["type"], json!("urn:triplanar:problem:out-of-storage"));
    assert_eq!(client.get("/readyz").await.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(client.get("/healthz").await.status(), StatusCode::OK);

    let service = phantom::settings().start_on(service.kill());
    pacs::push(&service, &series.files).await;
    let rows = Client::new(service.http).settled(&series.uid, 1).await;
    assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
}

/// A file system of its own, which can be filled. Unmounted when dropped.
struct SmallDisk {
    dir: tempfile::TempDir,
}

impl SmallDisk {
    fn new(mib: u64) -> Self {
        let dir = tempfile::tempdir().expect("a temporary directory");
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={mib}m"), "tmpfs"])
            .arg(dir.path())
            .output()
            .expect("mount runs");
        assert!(mount.status.success(), "{}", String::from_utf8_lossy(&mount.stderr));
        Self { dir }
    }

    fn path(&self) -> &Path {
        self.dir.path()
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _shown_by_a_left_over_mount = Command::new("umount").arg("-l").arg(self.dir.path()).status();
    }
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(may_mount), ignore = "this process may not mount a file system")]
async fn a_disk_that_runs_full_in_mid_transfer_loses_nothing_that_was_acknowledged() {
    let disk = SmallDisk::new(32);
    // The watermark is out of the way, so that writing itself fails.
    let settings = phantom::settings().with("storage.min_free_bytes", "0");
    let mut service = settings.start_on(tempfile::tempdir_in(disk.path()).expect("a directory on it"));
    let ballast = disk.path().join("ballast");
    leave_free(disk.path(), &ballast, 3 << 20);

    let series = phantom::small();
    let statuses = pacs::statuses(&service, &series.files).await;
    let acknowledged = statuses.iter().filter(|status| **status == 0).count();
    assert!(statuses.iter().all(|status| matches!(status, 0 | 0xA700)), "{statuses:04X?}");
    assert!(
        (1..phantom::SLICES).contains(&acknowledged),
        "the disk was not full in mid transfer: {statuses:04X?}"
    );
    assert!(service.is_alive());

    std::fs::remove_file(&ballast).expect("the ballast goes");
    let client = Client::new(service.http);
    let stored = client.json(&format!("/v1/series/{}", series.uid)).await;
    assert_eq!(stored["instances"], acknowledged, "what was acknowledged is there, and nothing else");
    pacs::push(&service, &series.files).await;
    let rows = client.settled(&series.uid, 1).await;
    let last = rows.last().expect("a reconstruction");
    assert_eq!(
        (&last["state"], &last["instances"]),
        (&json!("succeeded"), &json!(phantom::SLICES)),
        "{rows:#?}"
    );
}

/// Fills the file system but for so many bytes.
fn leave_free(disk: &Path, ballast: &Path, bytes: u64) {
    let state = rustix::fs::statvfs(disk).expect("the disk can be asked");
    let free = state.f_bavail * state.f_frsize;
    std::fs::write(ballast, vec![0; usize::try_from(free.saturating_sub(bytes)).expect("a small disk")])
        .expect("there is room");
}
