//! Acknowledged means durable, and a complete series becomes exactly one reconstruction, whatever
//! happens to the process.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use serde_json::Value;
use triplanar::dimse::scu::{Instance, store};

use crate::support::client::Client;
use crate::support::service::{Service, Settings};
use crate::support::{pacs, phantom};

/// A new seed each time; a failure prints it, `TRIPLANAR_TEST_SEED` repeats it.
fn seed() -> u64 {
    std::env::var("TRIPLANAR_TEST_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or_else(rand::random)
}

fn settings() -> Settings {
    phantom::settings().with("intake.quiet", "1").with("intake.quiet_after_association", "0.1")
}

/// The one reconstruction of the whole series, which must have succeeded.
async fn the_one_reconstruction(service: &Service, context: &str) -> Value {
    let series = phantom::small();
    let client = Client::new(service.http);
    let rows = client.settled(&series.uid, 1).await;
    assert_eq!(rows.len(), 1, "{context}: exactly one reconstruction was promised: {rows:#?}");
    assert_eq!(rows[0]["state"], "succeeded", "{context}: {:#?}", rows[0]);
    assert_eq!(rows[0]["instances"], phantom::SLICES, "{context}: an acknowledged instance is missing");
    rows[0].clone()
}

async fn cloud(service: &Service) -> Vec<u8> {
    let path = format!("/v1/series/{}/cloud", phantom::small().uid);
    Client::new(service.http).bytes(&path).await
}

#[tokio::test(flavor = "multi_thread")]
async fn acknowledged_instances_survive_kill_9() {
    let series = phantom::small();
    let seed = seed();
    let mut random = StdRng::seed_from_u64(seed);

    let service = settings().start();
    pacs::push(&service, &series.files).await;
    let acknowledged = Instant::now();
    the_one_reconstruction(&service, "without a kill").await;
    let whole = acknowledged.elapsed();
    let expected = cloud(&service).await;
    drop(service);

    for round in 0..20 {
        let moment = whole.mul_f64(random.random_range(0.0..1.0));
        let context =
            format!("round {round}, kill -9 {moment:?} after the last acknowledgement, seed {seed}");
        let service = settings().start();
        pacs::push(&service, &series.files).await;
        tokio::time::sleep(moment).await;
        let left = service.kill();
        let service = settings().start_on(left);
        the_one_reconstruction(&service, &context).await;
        assert!(cloud(&service).await == expected, "{context}: the cloud differs");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_before_a_kill_in_mid_transfer_is_there() {
    let series = phantom::small();
    // A job may be at work at each of the kills.
    let settings = || settings().with("jobs.max_attempts", "5");
    let seed = seed();
    let mut random = StdRng::seed_from_u64(seed);
    let mut service = settings().start();
    for round in 0..4 {
        let context = format!("round {round}, seed {seed}");
        let acknowledged = Mutex::new(Vec::new());
        let instances: Vec<_> = series.files.iter().cloned().map(Instance::Bytes).collect();
        let peer = pacs::peer(&service);
        let pushing = store(&peer, &instances, |outcome| {
            if outcome.answer.is_success() {
                acknowledged.lock().unwrap().push(outcome.sop_instance_uid.to_string());
            }
        });
        let moment = Duration::from_millis(random.random_range(0..400));
        let left = tokio::select! {
            _ended = pushing => service.kill(),
            () = tokio::time::sleep(moment) => service.kill(),
        };
        service = settings().start_on(left);
        let acknowledged = acknowledged.into_inner().unwrap();
        if acknowledged.is_empty() {
            continue;
        }
        let client = Client::new(service.http);
        let stored = client.json(&format!("/v1/series/{}", series.uid)).await;
        let stored = stored["instances"].as_u64().expect("a count") as usize;
        assert!(stored >= acknowledged.len(), "{context}: {stored} of {} are there", acknowledged.len());
    }
    pacs::push(&service, &series.files).await;
    let rows = Client::new(service.http).settled(&series.uid, 1).await;
    let last = rows.last().expect("a reconstruction");
    assert_eq!(
        (&last["state"], &last["instances"]),
        (&"succeeded".into(), &phantom::SLICES.into()),
        "{rows:#?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_kills_its_worker_fails_loudly_after_its_attempts() {
    let settings = settings().with("jobs.max_attempts", "2");
    let mut service = settings.start();
    pacs::push(&service, &phantom::small().files).await;
    for attempt in 1..=2 {
        wait_until_running(&service, attempt).await;
        service = settings.start_on(service.kill());
    }
    let rows = Client::new(service.http).settled(&phantom::small().uid, 1).await;
    assert_eq!(rows.len(), 1, "{rows:#?}");
    assert_eq!(rows[0]["state"], "failed", "{rows:#?}");
    assert_eq!(rows[0]["error"]["code"], "worker_died", "{rows:#?}");
    assert_eq!(rows[0]["attempts"], 2, "{rows:#?}");
    let metrics = Client::new(service.http).get("/metrics").await.text().await.unwrap();
    assert!(metrics.contains("triplanar_jobs_total{state=\"failed\"} 1"), "{metrics}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stopped_service_puts_its_job_back_and_the_attempt_does_not_count() {
    let settings = settings().with("jobs.max_attempts", "1");
    let service = settings.start();
    pacs::push(&service, &phantom::small().files).await;
    wait_until_running(&service, 1).await;
    let (status, left) = service.terminate();
    assert!(status.success(), "SIGTERM ends the service with {status}");
    let service = settings.start_on(left);
    let reconstruction = the_one_reconstruction(&service, "after SIGTERM").await;
    assert_eq!(reconstruction["attempts"], 1, "{reconstruction:#?}");
}

async fn wait_until_running(service: &Service, attempt: u32) {
    let client = Client::new(service.http);
    let begin = Instant::now();
    loop {
        let rows = client.reconstructions(&phantom::small().uid).await;
        if rows.first().is_some_and(|row| row["state"] == "running" && row["attempts"] == attempt) {
            return;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "attempt {attempt} does not begin: {rows:#?}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}
