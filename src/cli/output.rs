//! The output folder of a command: it must be absent or empty, unless the user insists.
//!
//! It is checked before anything is computed and created once there are results, so that bad input leaves no files.

use super::{Failure, Global, console, progress};
use crate::data::config::Config;
use crate::data::io::atomic::{Claimed, clear_abandoned, folder_of};
use crate::data::scene::{Scene, SceneError};
use crate::runs::{fitted, grid_scan, run};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The observations of a config, after a note on its assumed objective.
pub fn scene(config: &Config) -> Result<Scene, SceneError> {
    note_objective(std::slice::from_ref(config));
    Scene::new(config)
}

/// The same with stellar parameters that the config leaves to the profiles.
pub fn fitted(global: &Global, scene: Scene) -> Scene {
    let spinner = progress::bar(global, None, "profiles");
    let scene = fitted::fitted(scene, &|what| spinner.set_message(what.to_owned()));
    spinner.finish_and_clear();
    scene
}

/// Reports on standard error the objective of configs that name none; for several, that of the first one.
pub fn note_objective(configs: &[Config]) {
    let mut unnamed = configs.iter().filter_map(|config| Some((config, config.assumed_objective()?)));
    if let Some((config, text)) = unnamed.next() {
        let more = unnamed.count();
        let more = if more == 0 { String::new() } else { format!(" and {more} more configs") };
        console::note(format_args!("{}{more}: {text}", config.path().display()));
    }
}

/// Prints notes on standard error on the profiles and light curves of `scene` as read, for commands whose report does
/// not contain them.
pub fn remarks(scene: &Scene) {
    for remark in &scene.measured.profiles {
        console::note(format_args!("profiles: {remark}"));
    }
    for note in &scene.measured.light_curve_notes {
        console::note(format_args!("light curve: {note}"));
    }
}

/// Options of every command that writes.
#[derive(Debug, clap::Args)]
pub struct Output {
    /// Folder for the results; created if needed, must be empty
    #[arg(long = "out", value_name = "DIR")]
    folder: PathBuf,
    /// Write into a non-empty folder; files of the same names are replaced
    #[arg(long)]
    force: bool,
}

impl Output {
    /// The default of a command.
    pub fn to(folder: PathBuf, force: bool) -> Self {
        Output { folder, force }
    }

    /// Whether results may be written there.
    pub fn check(&self) -> Result<(), Failure> {
        let folder = self.folder.display();
        let wrong = |problem: String| Err(Failure::input(format!("--out {folder}: {problem}")));
        clear_abandoned(&self.folder);
        match std::fs::read_dir(&self.folder) {
            Ok(mut entries) => match entries.next() {
                None => self.is_writable(&self.folder),
                _ if self.replaces() => self.is_writable(&self.folder),
                _ => wrong("the folder is not empty; give another one, or --force to replace the files in it".into()),
            },
            Err(e) => match obstacle(&self.folder) {
                Some(file) if file == self.folder => wrong("is not a folder".into()),
                Some(file) => wrong(format!("{} is not a folder", file.display())),
                None if e.kind() == ErrorKind::NotFound => self.is_writable(existing(&self.folder)),
                None => Err(Failure::system(&e, format!("--out {folder}: cannot be used: {e}"))),
            },
        }
    }

    /// Checks that `folder` is writable, by trying: permissions alone are not sufficient.
    fn is_writable(&self, folder: &Path) -> Result<(), Failure> {
        let probe = folder.join(format!(".dimcmc-{}", std::process::id()));
        let tried = std::fs::create_dir(&probe).and_then(|()| std::fs::remove_dir(&probe));
        tried.map_err(|e| {
            let (out, folder) = (self.folder.display(), folder.display());
            Failure::system(&e, format!("--out {out}: nothing can be written into {folder}: {e}"))
        })
    }

    /// Whether the content of the folder may be replaced: on the user's request, or because it is from a run or a
    /// likelihood grid that ended before its first result.
    pub fn replaces(&self) -> bool {
        let folder = &self.folder;
        self.force || run::is_false_start(folder, true) || grid_scan::is_false_start(folder, true)
    }

    /// Whether a run or a likelihood grid ended there before its header was written, so that it cannot be resumed.
    pub fn cannot_go_on(&self) -> bool {
        run::is_false_start(&self.folder, false) || grid_scan::is_false_start(&self.folder, false)
    }

    /// Checks that nothing which the command has read is replaced by a file that it `writes`, even on request.
    pub fn spare(&self, read: &[PathBuf], writes: impl Fn(&str) -> bool) -> Result<(), Failure> {
        self.spare_below("", read, writes)
    }

    /// The same for files in a folder `below` it.
    pub fn spare_below(&self, below: &str, read: &[PathBuf], writes: impl Fn(&str) -> bool) -> Result<(), Failure> {
        let is_written = |file: &Path| file.file_name().is_some_and(|name| writes(&name.to_string_lossy()));
        let mut targets =
            read.iter().filter(|file| is_written(file)).map(|file| (file, self.folder.join(below).join(name_of(file))));
        match targets.find(|(file, target)| is_same(file, target)) {
            Some((file, _)) => Err(read_too(&self.folder, file)),
            None => Ok(()),
        }
    }

    /// The folder as given.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The folder, created if necessary.
    pub fn create(&self) -> Result<Claimed, Failure> {
        self.check()?;
        let failed = |e| Failure::failed(format!("--out {}: cannot be created: {e}", self.folder.display()));
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        Claimed::folder(&self.folder, || self.check())
    }
}

/// The deepest existing folder of the path.
fn existing(folder: &Path) -> &Path {
    let mut way = folder.ancestors().filter(|folder| !folder.as_os_str().is_empty());
    way.find(|folder| folder.is_dir()).unwrap_or(Path::new("."))
}

/// Options of every command that writes a config.
#[derive(Debug, clap::Args)]
pub struct ConfigFile {
    /// Config to write
    #[arg(long = "out", value_name = "FILE", default_value = "star.json")]
    path: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

impl ConfigFile {
    /// The file as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the config, and another file written with it, may be written.
    pub fn check(&self, other: Option<&Path>) -> Result<(), Failure> {
        let out = self.path.display();
        let wrong = |problem: String| Err(Failure::input(format!("--out {out}: {problem}")));
        let folder = folder_of(&self.path);
        if self.path.file_name().is_none() || self.path.is_dir() {
            return wrong("is a folder; give the name of a file".into());
        }
        if !folder.is_dir() {
            return wrong(format!("{} is not a folder", folder.display()));
        }
        match [Some(self.path.as_path()), other].into_iter().flatten().find(|path| path.exists()) {
            Some(path) if !self.force => {
                wrong(format!("{} exists; give another name, or --force to replace it", path.display()))
            }
            _ => Ok(()),
        }
    }

    /// The same again before writing, with a lock against other processes while it lives.
    pub fn claim(&self, other: Option<&Path>) -> Result<Claimed, Failure> {
        Claimed::folder(folder_of(&self.path), || self.check(other))
    }

    /// Checks that neither the config nor another file written with it replaces one that the command has `read`, even
    /// on request.
    pub fn spare(&self, read: &[PathBuf], other: Option<&Path>) -> Result<(), Failure> {
        let targets = [Some(self.path.as_path()), other];
        match read.iter().find(|file| targets.into_iter().flatten().any(|target| is_same(file, target))) {
            Some(file) => Err(read_too(&self.path, file)),
            None => Ok(()),
        }
    }

    /// `file` as a path in a config at this place: relative to its folder, or absolute where the two share no root.
    pub fn relative(&self, file: &Path) -> Result<PathBuf, Failure> {
        let whole = |path: &Path| {
            path.canonicalize().map_err(|e| Failure::system(&e, format!("{}: cannot read: {e}", path.display())))
        };
        let (folder, file) = (whole(folder_of(&self.path))?, whole(file)?);
        let shared = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
        // on Windows, two drives
        if shared == 0 {
            return Ok(file);
        }
        let up = folder.components().skip(shared).map(|_| "..");
        Ok(up.map(PathBuf::from).chain(file.components().skip(shared).map(|c| PathBuf::from(c.as_os_str()))).collect())
    }

    /// The JSON Schema, if it is beside the config under its usual name.
    pub fn schema(&self) -> Option<String> {
        const NAME: &str = "dimcmc.schema.json";
        folder_of(&self.path).join(NAME).is_file().then(|| NAME.to_owned())
    }
}

/// Whether two paths lead to the same existing file, or have its name in the same folder.
fn is_same(file: &Path, other: &Path) -> bool {
    let whole = |path: &Path| path.canonicalize().ok();
    let named = |path: &Path| Some(folder_of(path).canonicalize().ok()?.join(name_of(path)));
    let same = |a: Option<PathBuf>, b: Option<PathBuf>| a.is_some() && a == b;
    same(whole(file), whole(other)) || same(named(file), named(other))
}

fn name_of(file: &Path) -> &Path {
    Path::new(file.file_name().unwrap_or_default())
}

fn read_too(out: &Path, file: &Path) -> Failure {
    let (out, file) = (out.display(), file.display());
    Failure::input(format!("--out {out}: {file} would be replaced, which the command reads; give another name"))
}

/// The existing part of the path, if that is not a folder.
fn obstacle(folder: &Path) -> Option<&Path> {
    folder.ancestors().find(|parent| parent.exists()).filter(|parent| !parent.is_dir())
}
