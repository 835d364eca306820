//! Videos, encoded by ffmpeg: frames go to it as raw pixels, one after the other. Where they came from stands in them twice: as the comment
//! that players show, where the format has one, and at their end, where we find it again whatever ffmpeg made of it.

use super::{Provenance, atomic};
use crate::{Error, Result};
use std::ffi::OsString;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tempfile::NamedTempFile;

/// Names the program where it is not the one on the path.
const VARIABLE: &str = "FFMPEG";
/// What a file's last bytes hold that we made.
const OURS: &[u8] = b"made by reprobe";
/// The bytes of a file that [`OURS`] is looked for in.
const TAIL: u64 = 64;
/// What stands before a file's provenance, which [`OURS`] follows: no JSON has such bytes.
const ORIGIN: &[u8] = b"\0provenance\0";
/// The bytes of a file that [`ORIGIN`] is looked for in.
const ORIGIN_TAIL: u64 = 1 << 20;
/// Most bytes of a part of a GIF file's comment.
const GIF_PART: usize = 255;

/// Kinds of files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// H.264 in MP4.
    Mp4,
    /// VP9 in WebM.
    Webm,
    /// An animated GIF.
    Gif,
}

impl Format {
    const ALL: [(Self, &str); 3] = [(Self::Mp4, "mp4"), (Self::Webm, "webm"), (Self::Gif, "gif")];

    /// By a file's ending.
    pub fn of(path: &Path) -> Result<Self> {
        let ends_in = |name: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
        let found = Self::ALL.iter().find(|(_, name)| ends_in(name)).map(|(format, _)| *format);
        found.ok_or_else(|| Error::input(path, "expected a name that ends in .mp4, .webm or .gif"))
    }

    /// The size of a video of such frames: even where colours are stored for two pixels at once.
    pub fn padded(self, size: [usize; 2]) -> [usize; 2] {
        size.map(|n| if self == Self::Gif { n } else { n.next_multiple_of(2) })
    }

    fn arguments(self) -> Vec<&'static str> {
        // Unsaid, it would be the matrix of old television, which players do not expect of large pictures.
        const COLOURS: &str = "-vf scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int -pix_fmt yuv420p \
            -colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv";
        let (codec, colours) = match self {
            Self::Mp4 => ("-c:v libx264 -crf 16 -movflags +faststart -f mp4", COLOURS),
            Self::Webm => ("-c:v libvpx-vp9 -crf 24 -b:v 0 -row-mt 1 -f webm", COLOURS),
            // A palette a frame: one for all would need all frames at once.
            Self::Gif => {
                ("-filter_complex split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1 -loop 0 -f gif", "")
            }
        };
        colours.split_whitespace().chain(codec.split_whitespace()).collect()
    }

    /// What is put at the end of a file so that we know it again, and how much of its end that replaces: a part that players pass over.
    fn mark(self, origin: &str) -> (Vec<u8>, i64) {
        let origin = [ORIGIN, origin.as_bytes()].concat();
        let length = (origin.len() + OURS.len()) as u64;
        match self {
            Self::Mp4 => ([&(8 + length as u32).to_be_bytes(), &b"free"[..], &origin, OURS].concat(), 0),
            // Eight bytes of length, of which the first says so.
            Self::Webm => ([&[0xec], &(length | 1 << 56).to_be_bytes()[..], &origin, OURS].concat(), 0),
            Self::Gif => {
                let part = |bytes: &[u8]| [&[bytes.len() as u8], bytes].concat();
                let parts: Vec<u8> = origin.chunks(GIF_PART).chain([OURS]).flat_map(part).collect();
                ([&[0x21, 0xfe], &parts[..], &[0, b';']].concat(), 1)
            }
        }
    }

    /// The provenance in what a file ends with, as text.
    fn origin(self, tail: &[u8]) -> Option<Vec<u8>> {
        let at = tail.windows(ORIGIN.len()).rposition(|part| part == ORIGIN)?;
        let content = match self {
            Self::Gif => parts(tail.get(at.checked_sub(1)?..)?),
            _ => tail[at..].to_vec(),
        };
        content.strip_prefix(ORIGIN)?.strip_suffix(OURS).map(<[u8]>::to_vec)
    }
}

/// Whether a file is a video that we made.
pub fn is_ours(path: &Path) -> std::io::Result<bool> {
    Ok(tail(path, TAIL)?.windows(OURS.len()).any(|part| part == OURS))
}

/// Where a video came from; `None` of one that does not say.
pub fn read_provenance(path: &Path) -> Result<Option<Provenance>> {
    let tail = tail(path, ORIGIN_TAIL).map_err(|e| Error::io(path, e))?;
    let read = |text: Vec<u8>| serde_json::from_slice(&text).map_err(|e| Error::input(path, format!("its provenance: {e}")));
    Format::of(path)?.origin(&tail).map(read).transpose()
}

/// At most so many bytes of a file's end.
fn tail(path: &Path, most: u64) -> std::io::Result<Vec<u8>> {
    let mut file = std::fs::File::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(most)))?;
    let mut tail = Vec::new();
    file.take(most).read_to_end(&mut tail)?;
    Ok(tail)
}

/// The parts of a GIF file's comment, joined: each with its length before it, up to one without any.
fn parts(mut bytes: &[u8]) -> Vec<u8> {
    let mut joined = Vec::new();
    while let Some((&length, rest)) = bytes.split_first().filter(|(length, _)| **length > 0) {
        let (part, next) = rest.split_at(rest.len().min(usize::from(length)));
        joined.extend(part);
        bytes = next;
    }
    joined
}

/// The program that encodes.
pub struct Ffmpeg(OsString);

impl Ffmpeg {
    /// The one that `$FFMPEG` names, or that is on the path.
    ///
    /// # Errors
    /// There is none, or it does not run.
    pub fn find() -> Result<Self> {
        let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
        let program = named.clone().unwrap_or_else(|| "ffmpeg".into());
        let quiet = |c: &mut Command| c.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
        match quiet(Command::new(&program).arg("-version")) {
            Ok(_) => Ok(Self(program)),
            Err(e) if named.is_some() => {
                Err(Error::Request(format!("${VARIABLE}: {}: {e}; expected the ffmpeg program", program.display())))
            }
            Err(e) if e.kind() == ErrorKind::NotFound => Err(Error::Request(format!(
                "ffmpeg is not on the PATH: install it (apt-get install ffmpeg, brew install ffmpeg, winget install ffmpeg), or say \
                 where it is with ${VARIABLE}"
            ))),
            Err(e) => Err(Error::Request(format!("ffmpeg: {e}"))),
        }
    }

    /// Begins a video at `path`, and tells it where it comes from.
    pub fn start(&self, path: &Path, size: [usize; 2], fps: f64, provenance: &Provenance) -> Result<Video> {
        let origin = serde_json::to_string(provenance).map_err(|e| Error::input(path, e.to_string()))?;
        let format = Format::of(path)?;
        let file = atomic::begin(path)?;
        if cfg!(windows) {
            // There a lock keeps other programs from writing.
            let _ = file.as_file().unlock();
        }
        let padded = format.padded(size);
        let mut target = OsString::from("file:");
        target.push(file.path());
        let said = tempfile::tempfile().map_err(|e| Error::io(path, e))?;
        let words = said.try_clone().map_err(|e| Error::io(path, e))?;
        let child = Command::new(&self.0)
            .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"])
            .args(["-s", &format!("{}x{}", padded[0], padded[1]), "-r", &fps.to_string(), "-i", "-"])
            .args(format.arguments())
            // Else a WebM file has a random number.
            .args(["-fflags", "+bitexact", "-metadata", &format!("comment={origin}")])
            .arg(target)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(words)
            .spawn()
            .map_err(|e| Error::Request(format!("{}: {e}", self.0.display())))?;
        Ok(Video { path: path.into(), format, origin, size, padded, file: Some(file), child, said })
    }
}

/// A video that is being encoded. Nothing stays of one that is not finished.
pub struct Video {
    path: std::path::PathBuf,
    format: Format,
    /// Where it comes from, as text.
    origin: String,
    size: [usize; 2],
    padded: [usize; 2],
    file: Option<NamedTempFile>,
    child: Child,
    /// What ffmpeg says.
    said: std::fs::File,
}

impl Video {
    /// Adds a frame: rows from the top, three bytes a pixel.
    pub fn add(&mut self, rgb: &[u8]) -> Result<()> {
        let pixels = padded(rgb, self.size, self.padded);
        let written = match self.child.stdin.as_mut() {
            Some(pipe) => pipe.write_all(&pixels),
            None => Err(ErrorKind::BrokenPipe.into()),
        };
        // Why it takes no more, it says itself.
        written.map_err(|e| self.failed(&e.to_string()))
    }

    /// Waits for the encoder, and gives the file its name.
    pub fn finish(mut self) -> Result<()> {
        drop(self.child.stdin.take());
        let status = self.child.wait().map_err(|e| Error::io(&self.path, e))?;
        if !status.success() {
            return Err(self.failed(&status.to_string()));
        }
        let Some(mut file) = self.file.take() else { return Ok(()) };
        let fail = |e| Error::io(&self.path, e);
        let (mark, replaced) = self.format.mark(&self.origin);
        let length = file.as_file().metadata().map_err(fail)?.len() as i64;
        file.seek(SeekFrom::End(-replaced.min(length))).and_then(|_| file.write_all(&mark)).map_err(fail)?;
        atomic::finish(file, &self.path)
    }

    /// An error with ffmpeg's last words.
    fn failed(&mut self, how: &str) -> Error {
        // Without more to read it comes to its end, and to the end of its words.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
        let mut text = Vec::new();
        let _ = self.said.rewind().and_then(|()| self.said.read_to_end(&mut text));
        let text = String::from_utf8_lossy(&text);
        let last: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        let words = last[last.len().saturating_sub(3)..].join("; ");
        Error::input(&self.path, format!("ffmpeg failed ({how}): {}", if words.is_empty() { "it said nothing" } else { &words }))
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        if self.file.is_some() {
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// The same picture with its last column and row repeated up to a size.
fn padded(rgb: &[u8], [width, height]: [usize; 2], [wide, high]: [usize; 2]) -> Vec<u8> {
    let mut pixels = Vec::with_capacity(3 * wide * high);
    for y in 0..high {
        let row = &rgb[3 * width * y.min(height - 1)..][..3 * width];
        pixels.extend_from_slice(row);
        for _ in width..wide {
            pixels.extend_from_slice(&row[3 * (width - 1)..]);
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_become_even_by_repeating_the_last_pixels() {
        let rgb: Vec<u8> = (0..9).collect();
        let wide = [0, 1, 2, 3, 4, 5, 6, 7, 8, 6, 7, 8];
        assert_eq!(padded(&rgb, [3, 1], [4, 2]), [wide, wide].concat());
        assert_eq!(padded(&rgb, [3, 1], [3, 1]), rgb);
    }

    #[test]
    fn a_mark_says_where_a_video_came_from() {
        let folder = tempfile::tempdir().unwrap();
        // Of more than one part of a GIF file's comment, with what stands before the provenance in one of its texts.
        let provenance = Provenance::new("video", "abc", 7, &vec!["\0provenance\0"; 40]);
        let text = serde_json::to_string(&provenance).unwrap();
        for (format, name) in Format::ALL {
            let path = folder.path().join(format!("walk.{name}"));
            let bytes = [&b"frames;"[..], &format.mark(&text).0].concat();
            std::fs::write(&path, &bytes).unwrap();
            assert!(is_ours(&path).unwrap(), "{name}");
            assert_eq!(read_provenance(&path).unwrap(), Some(provenance.clone()), "{name}");
            for end in 0..bytes.len() - 2 {
                std::fs::write(&path, &bytes[..end]).unwrap();
                assert_ne!(read_provenance(&path).ok().flatten(), Some(provenance.clone()), "{name} {end}");
            }
            std::fs::write(&path, b"frames;made by reprobe").unwrap();
            assert_eq!(read_provenance(&path).unwrap(), None, "{name}");
        }
        // Lengths as the formats have them.
        let [mp4, webm, gif] = [Format::Mp4, Format::Webm, Format::Gif].map(|format| format.mark("{}").0);
        assert_eq!(mp4, b"\0\0\0\x25free\0provenance\0{}made by reprobe");
        assert_eq!(webm, b"\xec\x01\0\0\0\0\0\0\x1d\0provenance\0{}made by reprobe");
        assert_eq!(gif, b"\x21\xfe\x0e\0provenance\0{}\x0fmade by reprobe\0;");
    }

    #[test]
    fn files_are_told_by_their_ending() {
        assert_eq!(Format::of(Path::new("a/walk.MP4")).unwrap(), Format::Mp4);
        for bad in ["walk.avi", "walk", "mp4"] {
            assert!(Format::of(Path::new(bad)).unwrap_err().to_string().contains(".mp4, .webm or .gif"), "{bad}");
        }
    }
}
