//! From the request's bytes to instances: whole bodies, forms, archives.

use std::fs::File;
use std::sync::Arc;

use bytes::BytesMut;
use tokio::io::AsyncWriteExt;
use tokio::sync::mpsc;

use super::archive::{Step, passed_over, told, walk};
use super::budget::Budget;
use super::places::Upload;
use super::session::{Arriving, Session};
use super::sniff::{HEAD, Kind, kind};
use super::source::Source;
use crate::error::{Error, Result};
use crate::http::Context;
use crate::http::body::Incoming;
use crate::http::multipart::Multipart;
use crate::http::refused::Skipped;

/// Steps of an archive that wait to be stored: bounds the memory of one upload.
const STEPS: usize = 4;

/// The instances of an upload, and what was no instance.
pub(super) struct Received {
    pub(super) session: Session,
    pub(super) skipped: Vec<Skipped>,
    budget: Budget,
}

impl Received {
    fn new(context: &Context, upload: &Arc<Upload>) -> Self {
        Self {
            session: Session::new(context.intake.clone(), Arc::clone(upload), None),
            skipped: Vec::new(),
            budget: Budget::new(&context.config.http),
        }
    }

    fn skip(&mut self, file: Skipped) -> Result<()> {
        self.session.pass_over()?;
        self.skipped.push(file);
        Ok(())
    }
}

/// The whole body is one file.
pub(super) async fn whole(
    context: &Context,
    upload: &Arc<Upload>,
    mut incoming: Incoming,
) -> Result<Received> {
    let mut received = Received::new(context, upload);
    let result = file(context, &mut received, String::new(), Source::Body(&mut incoming)).await;
    if let Err(error) = result {
        incoming.linger().await;
        return Err(error);
    }
    Ok(received)
}

/// Every part with a file name is a file.
pub(super) async fn form(
    context: &Context,
    upload: &Arc<Upload>,
    mut multipart: Multipart,
) -> Result<Received> {
    let mut received = Received::new(context, upload);
    let result = parts(context, &mut received, &mut multipart).await;
    if let Err(error) = result {
        multipart.linger().await;
        return Err(error);
    }
    Ok(received)
}

async fn parts(context: &Context, received: &mut Received, multipart: &mut Multipart) -> Result<()> {
    while let Some(headers) = multipart.next_part().await? {
        let Some(name) = headers.file_name.filter(|name| !name.is_empty()) else { continue };
        received.budget.entry()?;
        file(context, received, told(name.as_bytes()), Source::Part(multipart)).await?;
    }
    Ok(())
}

/// One file: an instance goes straight to the intake, an archive to disk first.
async fn file(
    context: &Context,
    received: &mut Received,
    name: String,
    mut source: Source<'_>,
) -> Result<()> {
    let mut head = BytesMut::new();
    let mut ended = false;
    while head.len() < HEAD && !ended {
        match source.chunk().await? {
            Some(chunk) => {
                received.session.expect_instance();
                head.extend_from_slice(&chunk);
            }
            None => ended = true,
        }
    }
    received.session.expects_no_more();
    let head = head.freeze();
    if head.is_empty() {
        let arriving = received.session.begin(name, &head).await?;
        received.session.lacks();
        received.session.abandon(arriving, Error::MalformedUpload("the file is empty".to_owned()));
        return Ok(());
    }
    if kind(&head) == Kind::Instance {
        // A form can hold a whole folder, like an archive; a single body is meant to be an instance.
        if let (Source::Part(_), Some(reason)) = (&source, passed_over(&head)) {
            return received.skip(Skipped { name, reason });
        }
        let mut arriving = received.session.begin(name, &head).await?;
        arriving.write(&head).await?;
        while let Some(chunk) = source.chunk().await? {
            arriving.write(&chunk).await?;
        }
        return received.session.end(arriving).await;
    }
    // Refuses before the body if the disk is full.
    drop(context.intake.begin().await?);
    received.session.expect_instance();
    let mut spooled = tokio::fs::File::from_std(tempfile::tempfile_in(context.store.incoming())?);
    spooled.write_all(&head).await?;
    while let Some(chunk) = source.chunk().await? {
        context.store.check_room(chunk.len() as u64)?;
        spooled.write_all(&chunk).await?;
    }
    spooled.flush().await?;
    received.session.expects_no_more();
    let mut spooled = spooled.into_std().await;
    std::io::Seek::rewind(&mut spooled)?;
    unpack(received, spooled).await
}

async fn unpack(received: &mut Received, file: File) -> Result<()> {
    let budget = received.budget;
    let (sender, mut steps) = mpsc::channel(STEPS);
    let walker = tokio::task::spawn_blocking(move || walk(file, budget, sender));
    let mut arriving = None;
    let stored = loop {
        match steps.recv().await {
            None => break Ok(()),
            Some(step) => {
                if let Err(error) = take(received, &mut arriving, step).await {
                    break Err(error);
                }
            }
        }
    };
    drop(steps);
    let walked = walker.await.map_err(Error::internal)?;
    stored?;
    if matches!(walked, Err(Error::MalformedUpload(_))) && received.session.is_empty() {
        // What should have been in it is lost.
        received.session.expect_instance();
    }
    received.budget = walked?;
    Ok(())
}

async fn take(received: &mut Received, arriving: &mut Option<Arriving>, step: Step) -> Result<()> {
    match step {
        Step::Begin(name, head) => {
            let mut begun = received.session.begin(name, &head).await?;
            begun.write(&head).await?;
            *arriving = Some(begun);
        }
        Step::Data(bytes) => {
            if let Some(arriving) = arriving {
                arriving.write(&bytes).await?;
            }
        }
        Step::End => {
            if let Some(arriving) = arriving.take() {
                received.session.end(arriving).await?;
            }
        }
        Step::Broken(cause) => {
            if let Some(arriving) = arriving.take() {
                received.session.broken(arriving, cause);
            }
        }
        Step::Skipped(name, reason) => received.skip(Skipped { name, reason })?,
    }
    Ok(())
}
