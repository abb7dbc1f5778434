//! The journal of a campaign: every record as it comes, so that a campaign that was killed resumes
//! after its last complete record.
//!
//! The file is a sequence of frames: the length of the content and its CRC-32, each as 4 bytes with
//! the lowest first, and the content. The first frame is the definition of the campaign in JSON; the
//! others are records in the order of the jobs. A frame that is cut off or damaged ends the journal.

use crate::CampaignError;
use crate::campaign::{Campaign, Job, Shard};
use crate::record::{BoundRecord, Record, Row, RunRecord};
use navfuse_core::files::create_growing;
use navfuse_core::input;
use navfuse_core::model::record::verdict::VerdictLevel;
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Name of the journal in the folder of the campaign.
pub const JOURNAL: &str = "campaign.journal";

/// Length in bytes above which a frame counts as damaged. A record of 10,000 epochs of 100 states
/// has 16 MB.
const LONGEST: u32 = 1 << 28;

/// Content of the first frame.
#[derive(Serialize, Deserialize)]
struct Head {
    shard: Option<String>,
    campaign: Campaign,
}

impl Head {
    fn new(campaign: &Campaign, shard: Option<Shard>) -> Self {
        Self { shard: shard.map(|s| s.to_string()), campaign: campaign.clone() }
    }
}

/// A journal that is being written.
pub struct Journal {
    path: PathBuf,
    file: File,
    /// The jobs whose records are not in the journal yet, the last one first.
    due: Vec<Job>,
    frame: Vec<u8>,
}

impl Journal {
    /// Begins a journal.
    pub fn create(
        folder: &Path,
        campaign: &Campaign,
        shard: Option<Shard>,
    ) -> Result<Self, CampaignError> {
        let path = folder.join(JOURNAL);
        let file = create_growing(&path).map_err(|e| CampaignError::file(&path, e))?;
        let mut journal = Self { path, file, due: due(campaign, shard), frame: Vec::new() };
        let head = serde_json::to_vec(&Head::new(campaign, shard));
        journal.append(&head.map_err(|e| CampaignError::file(&journal.path, e))?)?;
        Ok(journal)
    }

    /// Resumes the journal in a folder: passes its records to `each`, and returns it with their
    /// number, ready for the next record; `None` if there is no journal.
    pub fn resume(
        folder: &Path,
        campaign: &Campaign,
        shard: Option<Shard>,
        mut each: impl FnMut(Record) -> Result<(), CampaignError>,
    ) -> Result<Option<(Self, usize)>, CampaignError> {
        let path = folder.join(JOURNAL);
        let failed = |e: io::Error| CampaignError::file(&path, e);
        // a device or a pipe is refused before it is opened
        let file =
            input::open(&path).and_then(|_| OpenOptions::new().read(true).write(true).open(&path));
        let file = match file {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(failed)?,
        };
        let mut frames = Frames { reader: BufReader::new(file), end: 0 };
        let Some(head) = frames.next().map_err(failed)? else { return Ok(None) };
        check(&path, &head, campaign, shard)?;
        let mut due = due(campaign, shard);
        let mut count = 0;
        let mut end = frames.end;
        while let (Some(job), Some(frame)) = (due.last(), frames.next().map_err(failed)?) {
            let Some(record) = decode(&frame).filter(|record| job_of(record) == *job) else {
                break;
            };
            each(record)?;
            due.pop();
            count += 1;
            end = frames.end;
        }
        // a frame that was cut off is written again
        let mut file = frames.reader.into_inner();
        file.set_len(end).and_then(|()| file.seek(SeekFrom::Start(end))).map_err(failed)?;
        Ok(Some((Self { path, file, due, frame: Vec::new() }, count)))
    }

    /// Adds the record of the next job. After an interruption, jobs behind one that did not complete
    /// may have records; they are left out and done again.
    pub fn add(&mut self, record: &Record) -> Result<(), CampaignError> {
        if self.due.last() != Some(&job_of(record)) {
            return Ok(());
        }
        self.due.pop();
        let mut content = Vec::new();
        encode(record, &mut content);
        self.append(&content)
    }

    /// Removes the journal of a campaign that is complete.
    pub fn remove(self) -> Result<(), CampaignError> {
        std::fs::remove_file(&self.path).map_err(|e| CampaignError::file(&self.path, e))
    }

    /// Writes a frame at once: a program that is killed leaves all frames before it.
    fn append(&mut self, content: &[u8]) -> Result<(), CampaignError> {
        let length = u32::try_from(content.len()).ok().filter(|length| *length <= LONGEST);
        let length = length.ok_or_else(|| {
            CampaignError::content(&self.path, "a record is too long; give a longer --every")
        })?;
        self.frame.clear();
        self.frame.extend(length.to_le_bytes());
        self.frame.extend(crc32fast::hash(content).to_le_bytes());
        self.frame.extend(content);
        self.file.write_all(&self.frame).map_err(|e| CampaignError::file(&self.path, e))
    }
}

/// The jobs, the last one first.
fn due(campaign: &Campaign, shard: Option<Shard>) -> Vec<Job> {
    let mut jobs = campaign.jobs(shard);
    jobs.reverse();
    jobs
}

/// Checks that a journal belongs to this campaign.
fn check(
    path: &Path,
    head: &[u8],
    campaign: &Campaign,
    shard: Option<Shard>,
) -> Result<(), CampaignError> {
    let other = |why: String| {
        let message = format!(
            "it is of another campaign: {why}; give the command of that one, or leave out --resume \
             to begin again"
        );
        CampaignError::content(path, message)
    };
    let found: Head = serde_json::from_slice(head).map_err(|e| other(e.to_string()))?;
    if let Some(why) = found.campaign.difference(&campaign.read_back()) {
        return Err(other(why));
    }
    let name = |shard: &Option<String>| {
        shard.as_ref().map_or_else(|| "the whole".to_owned(), |s| format!("part {s}"))
    };
    let wanted = Head::new(campaign, shard).shard;
    if found.shard == wanted {
        Ok(())
    } else {
        Err(other(format!("{} instead of {}", name(&found.shard), name(&wanted))))
    }
}

fn job_of(record: &Record) -> Job {
    match record {
        Record::Bound(bound) => Job { point: bound.point, run: 0 },
        Record::Run(run) => Job { point: run.point, run: run.run },
    }
}

/// The frames of a file.
struct Frames {
    reader: BufReader<File>,
    /// End of the last complete frame, in bytes.
    end: u64,
}

impl Frames {
    /// The content of the next frame; `None` if no complete frame follows.
    fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut head = [0; 8];
        let mut content = Vec::new();
        match self.reader.read_exact(&mut head) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
            other => other?,
        }
        let [a, b, c, d, rest @ ..] = head;
        let length = u32::from_le_bytes([a, b, c, d]);
        if length > LONGEST {
            return Ok(None);
        }
        // as many bytes as there are: a damaged length allocates nothing
        self.reader.by_ref().take(length.into()).read_to_end(&mut content)?;
        let is_whole = content.len() as u64 == u64::from(length)
            && crc32fast::hash(&content) == u32::from_le_bytes(rest);
        self.end += if is_whole { 8 + u64::from(length) } else { 0 };
        Ok(is_whole.then_some(content))
    }
}

/// Appends a record: integers and numbers as 8 bytes, lists and texts with their length before.
fn encode(record: &Record, out: &mut Vec<u8>) {
    let whole = |out: &mut Vec<u8>, value: u64| out.extend(value.to_le_bytes());
    let numbers = |out: &mut Vec<u8>, values: &[f64]| {
        whole(out, values.len() as u64);
        values.iter().for_each(|v| out.extend(v.to_le_bytes()));
    };
    match record {
        Record::Bound(bound) => {
            out.push(0);
            whole(out, bound.point as u64);
            whole(out, bound.rows.len() as u64);
            for (epoch, time, filtered, smoothed) in &bound.rows {
                out.extend(epoch.to_le_bytes());
                out.extend(time.to_le_bytes());
                numbers(out, filtered);
                numbers(out, smoothed);
            }
        }
        Record::Run(run) => {
            out.push(1 + u8::from(run.failure.is_some()));
            whole(out, run.point as u64);
            whole(out, run.run as u64);
            whole(out, run.seed);
            let text = |out: &mut Vec<u8>, text: &str| {
                whole(out, text.len() as u64);
                out.extend(text.as_bytes());
            };
            if let Some(reason) = &run.failure {
                text(out, reason);
            }
            out.push(u8::from(run.unusable));
            out.push(u8::from(run.judged != VerdictLevel::Consistent));
            whole(out, run.warned.len() as u64);
            run.warned.iter().for_each(|name| text(out, name));
            text(out, run.blamed.as_deref().unwrap_or_default());
            whole(out, run.rows.len() as u64);
            for row in &run.rows {
                out.extend(row.epoch.to_le_bytes());
                out.extend(row.time.to_le_bytes());
                numbers(out, &row.values);
            }
        }
    }
}

/// The bytes of a record that are not read yet.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn eight(&mut self) -> Option<[u8; 8]> {
        let (first, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(*first)
    }

    fn whole(&mut self) -> Option<u64> {
        self.eight().map(u64::from_le_bytes)
    }

    fn flag(&mut self) -> Option<bool> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        (*first < 2).then_some(*first == 1)
    }

    fn size(&mut self) -> Option<usize> {
        self.whole().and_then(|value| usize::try_from(value).ok())
    }

    fn epoch(&mut self) -> Option<i64> {
        self.eight().map(i64::from_le_bytes)
    }

    fn number(&mut self) -> Option<f64> {
        self.eight().map(f64::from_le_bytes)
    }

    fn numbers(&mut self) -> Option<Vec<f64>> {
        let length = self.size()?;
        // a length that the bytes do not have ends the list before it allocates
        (length <= self.0.len() / 8).then(|| (0..length).map_while(|_| self.number()).collect())
    }

    fn text(&mut self) -> Option<String> {
        let length = self.size()?;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        String::from_utf8(text.to_vec()).ok()
    }

    /// A list, with its length before it.
    fn list<T>(&mut self, mut next: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let length = self.size()?;
        let mut list = Vec::new();
        for _ in 0..length {
            list.push(next(self)?);
        }
        Some(list)
    }
}

/// The record in a frame; `None` if the bytes are not one.
pub fn decode(frame: &[u8]) -> Option<Record> {
    let (kind, rest) = frame.split_first()?;
    let mut bytes = Bytes(rest);
    let record = match kind {
        0 => Record::Bound(BoundRecord {
            point: bytes.size()?,
            rows: bytes.list(|b| Some((b.epoch()?, b.number()?, b.numbers()?, b.numbers()?)))?,
        }),
        1 | 2 => {
            let (point, run, seed) = (bytes.size()?, bytes.size()?, bytes.whole()?);
            let failure = if *kind == 2 { Some(bytes.text()?) } else { None };
            let unusable = bytes.flag()?;
            let judged = match (unusable, bytes.flag()?) {
                (true, _) => VerdictLevel::DoNotUse,
                (false, true) => VerdictLevel::Doubtful,
                (false, false) => VerdictLevel::Consistent,
            };
            let warned = bytes.list(Bytes::text)?;
            let blamed = Some(bytes.text()?).filter(|name| !name.is_empty());
            let rows = bytes.list(|b| {
                Some(Row { epoch: b.epoch()?, time: b.number()?, values: b.numbers()? })
            })?;
            Record::Run(RunRecord {
                point,
                run,
                seed,
                rows,
                failure,
                unusable,
                judged,
                warned,
                blamed,
            })
        }
        _ => return None,
    };
    bytes.0.is_empty().then_some(record)
}
