//! kill -9 while a corrected identity comes in: the change is still under way after the restart, sending
//! the rest completes it, nothing is lost.

use serde_json::json;

use crate::support::client::Client;
use crate::support::scu::{CT, EXPLICIT, Request, Scu, c_store, ct_slice, pdv};
use crate::support::service::{Service, Settings, run, triplanar};

const SERIES: &str = "1.2.3.7";
const INSTANCES: u16 = 6;
/// As long as the one that `ct_slice` writes.
const CORRECTED: &str = "RIGHT-ONE";

fn settings() -> Settings {
    Settings::new().with("intake.quiet_after_association", "0.001").with("intake.min_slices", "3")
}

fn instance(index: u16) -> String {
    format!("{SERIES}.{}", index + 1)
}

fn data_set(index: u16, patient_id: &str) -> Vec<u8> {
    let mut bytes = ct_slice(SERIES, &instance(index), index, 40);
    let place = bytes.windows(9).position(|window| window == b"SECRET-ID").expect("Patient ID");
    bytes[place..place + 9].copy_from_slice(patient_id.as_bytes());
    bytes
}

/// Stores `indices` on an association that stays open.
fn stored(service: &Service, indices: std::ops::Range<u16>, patient_id: &str) -> Scu {
    let mut scu = Scu::associate(service.dimse, &Request::new(&[(1, CT, &[EXPLICIT])]));
    for index in indices {
        scu.store(1, index + 1, &instance(index), &data_set(index, patient_id), 8_000);
        assert_eq!(scu.response().status(), 0);
    }
    scu
}

async fn metric(service: &Service, line: &str) {
    let metrics = Client::new(service.http).get("/metrics").await.text().await.unwrap();
    assert!(metrics.lines().any(|told| told == line), "{line} is missing in\n{metrics}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_kill_in_the_middle_of_a_correction_loses_nothing_and_the_rest_completes_it() {
    let service = settings().start();
    stored(&service, 0..INSTANCES, "SECRET-ID").release();
    Client::new(service.http).settled(SERIES, 1).await;

    // Half of them are acknowledged, the next one is on its way.
    let mut open = stored(&service, 0..INSTANCES / 2, CORRECTED);
    metric(&service, "triplanar_corrected_instances_total 3").await;
    metric(&service, "triplanar_series_identity_changing 1").await;
    let next = data_set(INSTANCES / 2, CORRECTED);
    open.send_pdvs(&[
        pdv(1, 3, &c_store(9, CT, &instance(INSTANCES / 2))),
        pdv(1, 0, &next[..next.len() / 2]),
    ]);
    let dir = service.kill();
    drop(open);

    let service = settings().start_on(dir);
    let client = Client::new(service.http);
    let series = client.json(&format!("/v1/series/{SERIES}")).await;
    assert_eq!(
        (&series["identity_changing"], &series["patient_id"], &series["instances"], &series["revision"]),
        (&json!(true), &json!("SECRET-ID"), &json!(INSTANCES), &json!(1)),
        "{series:#}"
    );
    metric(&service, "triplanar_series_identity_changing 1").await;

    stored(&service, INSTANCES / 2..INSTANCES, CORRECTED).release();
    let series = client.json(&format!("/v1/series/{SERIES}")).await;
    assert_eq!(
        (&series["identity_changing"], &series["patient_id"], &series["instances"], &series["revision"]),
        (&json!(false), &json!(CORRECTED), &json!(INSTANCES), &json!(1)),
        "{series:#}"
    );
    metric(&service, "triplanar_series_identity_changing 0").await;
    metric(&service, "triplanar_corrected_instances_total 3").await;

    let mut command = triplanar();
    command.args(["check", "--json", "--data-dir"]).arg(service.data_dir());
    let answer = run(command);
    let told: serde_json::Value = serde_json::from_slice(&answer.stdout).expect("JSON");
    assert_eq!(answer.status.code(), Some(0), "{told:#}");
    assert_eq!((&told["instances"], &told["problems"]), (&json!(INSTANCES), &json!([])), "{told:#}");
}
