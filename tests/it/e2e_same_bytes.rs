//! Same input, same bytes: on any number of threads, by the service and by the command line.

use crate::support::client::Client;
use crate::support::service::{run, triplanar};
use crate::support::{pacs, phantom};

#[tokio::test(flavor = "multi_thread")]
async fn any_number_of_threads_and_the_command_line_give_the_same_bytes() {
    let series = phantom::small();
    let mut results = Vec::new();
    for threads in ["1", "2"] {
        let service = phantom::settings().with("jobs.threads", threads).start();
        let mut files = series.files.clone();
        if threads == "2" {
            // Nor does the order of arrival matter.
            files.reverse();
        }
        pacs::push(&service, &files).await;
        let client = Client::new(service.http);
        let rows = client.settled(&series.uid, 1).await;
        assert_eq!(rows[0]["state"], "succeeded", "{rows:#?}");
        let mut clouds = Vec::new();
        for plane in ["triplanar", "axial", "sagittal", "coronal"] {
            clouds.push(client.bytes(&format!("/v1/series/{}/cloud?plane={plane}", series.uid)).await);
        }
        results.push((clouds, client.bytes(&format!("/v1/series/{}/report", series.uid)).await));
    }
    assert!(results[0].0 == results[1].0, "1 and 2 threads give different clouds");
    assert!(results[0].1 == results[1].1, "1 and 2 threads give different reports");

    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("series");
    std::fs::create_dir(&input).unwrap();
    for (number, file) in series.files.iter().enumerate() {
        std::fs::write(input.join(format!("{number}.dcm")), file).unwrap();
    }
    let cloud = dir.path().join("cloud.ply");
    let mut command = triplanar();
    command.args(["reconstruct", input.to_str().unwrap(), "-o", cloud.to_str().unwrap()]);
    command.env("TRIPLANAR_PIPELINE__PROFILE", "paper");
    command.env("TRIPLANAR_PIPELINE__RADIUS_OUTLIER__MIN_NEIGHBOURS", "0");
    let output = run(command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(std::fs::read(cloud).unwrap() == results[0].0[0], "the command line gives other bytes");
}
