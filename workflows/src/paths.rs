//! Where the repository's folders are.

use std::path::{Path, PathBuf};

/// The root of the repository this program was built in.
pub fn repository() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_path_buf()
}

/// Run folders, one a case.
pub fn runs() -> PathBuf {
    repository().join("runs")
}

/// `workflows/cases`.
pub fn cases() -> PathBuf {
    repository().join("workflows").join("cases")
}

/// `tests/validation`.
pub fn validation() -> PathBuf {
    repository().join("tests").join("validation")
}

/// Run folders of a study.
pub fn study_runs(study: &str) -> PathBuf {
    runs().join("studies").join(study)
}

/// Pictures of the studies.
pub fn pictures() -> PathBuf {
    repository().join("docs").join("validation")
}

/// The page that studies are shown on.
pub fn page() -> PathBuf {
    repository().join("VALIDATION.md")
}

/// `tests/charts`.
pub fn charts() -> PathBuf {
    repository().join("tests").join("charts")
}

/// Run folders of a chart.
pub fn chart_runs(chart: &str) -> PathBuf {
    runs().join("charts").join(chart)
}

/// The page of the charts; their pictures lie beside it.
pub fn charts_page() -> PathBuf {
    repository().join("docs").join("charts").join("README.md")
}

/// `tests/stability`.
pub fn stability() -> PathBuf {
    repository().join("tests").join("stability")
}

/// The page of the map of methods and failures; its picture lies beside it.
pub fn stability_page() -> PathBuf {
    repository().join("docs").join("stability").join("README.md")
}

/// A path of the command line: relative to where the user called, which the launcher leaves for the repository's root.
pub fn from_caller(path: &Path) -> PathBuf {
    called_from().join(path)
}

/// A path as short as the user can type it: relative to where they are, where it lies below.
pub fn short(path: &Path) -> &Path {
    path.strip_prefix(called_from()).unwrap_or(path)
}

fn called_from() -> PathBuf {
    match std::env::var_os("TALUS_CALLED_FROM") {
        Some(folder) => folder.into(),
        None => std::env::current_dir().unwrap_or_default(),
    }
}
