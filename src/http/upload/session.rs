//! The instances of one request on their way to the intake: a few are made durable at a time
//! while the next ones arrive.

use std::sync::Arc;

use bytes::Bytes;
use futures_util::StreamExt;
use futures_util::stream::FuturesUnordered;
use tokio::task::{JoinError, JoinHandle};
use uuid::Uuid;

use super::places::Upload;
use crate::dicom::uid::{SopInstanceUid, StudyInstanceUid};
use crate::error::{Error, Result};
use crate::http::identity::Identity;
use crate::intake::{Announced, Beginning, Encoding, Intake, Receipt, Sender, Spool};
use crate::store::SenderEnd;

/// Instances that are made durable at a time: their syncs share the disk's time.
pub(super) const AT_A_TIME: usize = 8;

/// The status of what has no room (PS3.4 table B.2-1).
const OUT_OF_RESOURCES: u16 = 0xA700;

/// What became of one instance.
#[derive(Debug)]
pub(in crate::http) struct Outcome {
    /// Its place in the request.
    pub(in crate::http) index: usize,
    /// Its file name in the archive or form; empty where it has none.
    pub(in crate::http) name: String,
    /// What the intake said.
    pub(in crate::http) result: Result<Receipt>,
}

/// The instances of one request.
pub(in crate::http) struct Session {
    intake: Intake,
    /// What the request may hold in memory.
    upload: Arc<Upload>,
    id: Uuid,
    study: Option<StudyInstanceUid>,
    running: FuturesUnordered<JoinHandle<Outcome>>,
    outcomes: Vec<Outcome>,
    begun: usize,
    /// An instance has begun to arrive and is not whole.
    within: bool,
    /// What it calls itself, where it is a file that tells.
    arriving: Option<SopInstanceUid>,
    /// What has come of it.
    beginning: Option<Beginning>,
    /// An instance could not be read to its end, or was refused for want of room.
    torn: bool,
    finished: bool,
}

/// A session whose instances are all durable or refused.
pub(in crate::http) struct Finished {
    /// Its id, with which the intake must be told how it ended.
    pub(in crate::http) id: Uuid,
    /// What became of each instance, in the order in which they came.
    pub(in crate::http) outcomes: Vec<Outcome>,
    /// Whether all that was sent arrived.
    pub(in crate::http) end: SenderEnd,
}

/// An instance that is arriving.
pub(in crate::http) struct Arriving {
    index: usize,
    name: String,
    /// The spool file, or why the rest of the instance is of no use.
    spool: Result<Spool>,
}

impl Session {
    /// A session whose instances must be of `study`, if one is given.
    pub(in crate::http) fn new(intake: Intake, upload: Arc<Upload>, study: Option<StudyInstanceUid>) -> Self {
        let id = Uuid::now_v7();
        intake.sender_begins(id);
        Self {
            intake,
            upload,
            id,
            study,
            running: FuturesUnordered::new(),
            outcomes: Vec::new(),
            begun: 0,
            within: false,
            arriving: None,
            beginning: None,
            torn: false,
            finished: false,
        }
    }

    /// An instance begins, with these bytes.
    ///
    /// # Errors
    /// Only what ends the whole request: no space, no memory, shutdown, our own failure.
    pub(in crate::http) async fn begin(&mut self, name: String, head: &[u8]) -> Result<Arriving> {
        self.upload.remember()?;
        let index = self.begun;
        self.begun += 1;
        self.arriving = Identity::of(head).sop_instance_uid;
        let spool = fatal(self.intake.begin().await)?;
        self.beginning = spool.as_ref().ok().map(Spool::beginning);
        self.within = true;
        Ok(Arriving { index, name, spool })
    }

    /// A file that is no instance is to be told of.
    ///
    /// # Errors
    /// There is no memory for that.
    pub(in crate::http) fn pass_over(&self) -> Result<()> {
        self.upload.remember()
    }

    /// Bytes of an instance come that has yet to begin, or of an archive of them.
    pub(in crate::http) fn expect_instance(&mut self) {
        (self.within, self.arriving, self.beginning) = (true, None, None);
    }

    /// Whether nothing has begun to arrive yet.
    pub(in crate::http) fn is_empty(&self) -> bool {
        self.begun == 0
    }

    /// What came was whole, whether there were instances in it or not.
    pub(in crate::http) fn expects_no_more(&mut self) {
        self.within = false;
    }

    /// The instance is whole: makes it durable in the background.
    ///
    /// # Errors
    /// Only what ends the whole request, of this or an earlier instance.
    pub(in crate::http) async fn end(&mut self, arriving: Arriving) -> Result<()> {
        self.within = false;
        let Arriving { index, name, spool } = arriving;
        let spool = match spool {
            Ok(spool) => spool,
            Err(error) => {
                self.outcomes.push(Outcome { index, name, result: Err(error) });
                return Ok(());
            }
        };
        while self.running.len() >= AT_A_TIME {
            self.next_outcome().await?;
        }
        let announced = Announced {
            encoding: Encoding::Part10,
            sop_class_uid: None,
            sop_instance_uid: None,
            study_instance_uid: self.study.clone(),
            sender: Sender::Upload { id: self.id },
        };
        let intake = self.intake.clone();
        // A task of its own: a client that goes away stops no sync half-way.
        self.running.push(tokio::spawn(async move {
            Outcome { index, name, result: intake.store(spool, announced).await }
        }));
        Ok(())
    }

    /// The instance can't be read to its end.
    pub(in crate::http) fn abandon(&mut self, arriving: Arriving, error: Error) {
        self.within = false;
        self.outcomes.push(Outcome { index: arriving.index, name: arriving.name, result: Err(error) });
    }

    /// A file of the request is nothing that can be read, where an instance was meant to be.
    pub(in crate::http) fn lacks(&self) {
        self.intake.lacks(self.id, None);
    }

    /// The archive breaks off within the instance.
    pub(in crate::http) fn broken(&mut self, arriving: Arriving, cause: String) {
        if let Some(instance) = self.arriving.take() {
            self.intake.lacks(self.id, Some(instance));
        }
        self.torn = true;
        self.abandon(arriving, Error::MalformedUpload(cause));
    }

    /// Waits for all instances.
    ///
    /// # Errors
    /// What ends the whole request.
    pub(in crate::http) async fn finish(mut self) -> Result<Finished> {
        while !self.running.is_empty() {
            self.next_outcome().await?;
        }
        self.finished = true;
        let mut outcomes = std::mem::take(&mut self.outcomes);
        outcomes.sort_by_key(|outcome| outcome.index);
        let no_room = |outcome: &Outcome| {
            let refusal = outcome.result.as_ref().err().map(Error::mapping);
            refusal.is_some_and(|mapping| mapping.dimse_status == OUT_OF_RESOURCES)
        };
        let end = match (self.torn, outcomes.iter().any(no_room)) {
            (true, _) => SenderEnd::UploadBroken,
            (false, true) => SenderEnd::InstancesRefused,
            (false, false) => SenderEnd::UploadEnded,
        };
        Ok(Finished { id: self.id, outcomes, end })
    }

    async fn next_outcome(&mut self) -> Result<()> {
        let Some(ended) = self.running.next().await else { return Ok(()) };
        let outcome: Outcome = ended.map_err(|panic: JoinError| Error::internal(panic))?;
        let result = fatal(outcome.result)?;
        self.outcomes.push(Outcome { result, ..outcome });
        Ok(())
    }
}

impl Drop for Session {
    /// A request that broke off: what came of its series waits for the long quiet time, in doubt.
    fn drop(&mut self) {
        if self.finished {
            return;
        }
        let (intake, id) = (self.intake.clone(), self.id);
        intake.sender_breaks(id);
        if self.within {
            let begun = self.beginning.as_ref().map(|beginning| (beginning, &Encoding::Part10));
            intake.cut(&Sender::Upload { id }, self.arriving.as_ref().map(|uid| uid.as_str()), begun);
        }
        let mut running = std::mem::take(&mut self.running);
        tokio::spawn(async move {
            while running.next().await.is_some() {}
            if let Err(error) = intake.sender_ended(id, SenderEnd::UploadBroken).await {
                // The quiet time completes its series all the same.
                tracing::error!(upload = %id, %error, "the upload's end was not recorded");
            }
        });
    }
}

impl Arriving {
    /// More bytes. After a refusal (it is larger than one instance may be) they are dropped.
    ///
    /// # Errors
    /// Only what ends the whole request.
    pub(in crate::http) async fn write(&mut self, bytes: &Bytes) -> Result<()> {
        if let Ok(spool) = &mut self.spool
            && let Err(error) = fatal(spool.write(bytes).await)?
        {
            self.spool = Err(error);
        }
        Ok(())
    }
}

/// Parts what concerns one instance (inner) from what ends the whole request (outer): the next
/// instance would meet the same.
fn fatal<T>(result: Result<T>) -> Result<Result<T>> {
    match result {
        Err(error) if error.is_shortage() || matches!(error, Error::ShuttingDown | Error::Internal(_)) => {
            Err(error)
        }
        other => Ok(other),
    }
}
