//! Documentation in Markdown as pages of a site.

use super::export::{Site, hash, page_file, with_head};
use super::server::StudioError;
use crate::bundle::{plain, relative};
use haptograph_signal::files;
use pulldown_cmark::{CowStr, Event, Options, Parser, Tag, TagEnd, html};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The folder of the pages in a site, and the page that all are made of.
const FOLDER: &str = "docs";
const FRAME: &str = "docs.html";
const OFFLINE: &str = "<script type=\"module\" src=\"../offline.js\"></script>";

/// What links lead to.
struct Library<'a> {
    folder: &'a Path,
    /// Pages by the file that they are made of.
    pages: BTreeMap<PathBuf, String>,
    /// Files of the site by the hash of their content, and names of its graphs by their path.
    known: BTreeMap<String, String>,
    graphs: &'a BTreeMap<String, String>,
    /// Files beside the pages that these show.
    shown: BTreeSet<PathBuf>,
}

/// Writes a page for each file of a folder and for the `README.md` beside the folder; returns their names. Links to `graphs`, by
/// path in the site, run these.
pub(super) fn write(
    site: &mut Site<'_>,
    folder: &Path,
    graphs: &BTreeMap<String, String>,
) -> Result<Vec<String>, StudioError> {
    let folder = plain(folder);
    let failed = |path: &Path, error| StudioError::Other(format!("cannot read {}: {error}", path.display()));
    let read = |path: &Path| files::read(path, files::MAX_SITE_BYTES).map_err(|error| failed(path, error));
    let mut sources = files::list(&folder);
    sources.retain(|path| path.extension().is_some_and(|ending| ending == "md"));
    let named = sources.into_iter().map(|path| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        (path, if stem == "README" { "index.html".to_owned() } else { format!("{stem}.html") })
    });
    let mut pages: BTreeMap<PathBuf, String> = named.collect();
    let front = folder.with_file_name("README.md");
    if front.is_file() {
        pages.insert(front, "readme.html".to_owned());
    }
    let of_site = site.sha256.iter().filter(|(name, _)| name.starts_with("files/"));
    let known = of_site.map(|(name, hash)| (hash.clone(), name.clone())).collect();
    let mut library =
        Library { folder: &folder, pages: pages.clone(), known, graphs, shown: BTreeSet::new() };
    let frame = String::from_utf8_lossy(page_file(FRAME));
    for (source, name) in &pages {
        let text = String::from_utf8_lossy(&read(source)?).into_owned();
        let (title, content) = library.page(source, &text);
        let page = with_head(&frame, OFFLINE).replacen("TITLE", &title, 1).replacen("CONTENT", &content, 1);
        site.write(&Path::new(FOLDER).join(name), page.as_bytes())?;
    }
    for path in &library.shown {
        site.write(&Path::new(FOLDER).join(relative(path, &folder)), &read(path)?)?;
    }
    Ok(pages.into_values().collect())
}

impl Library<'_> {
    /// The title and the content of a page as HTML.
    fn page(&mut self, source: &Path, text: &str) -> (String, String) {
        let mut events = Vec::new();
        let (mut open, mut offered) = (Vec::new(), BTreeSet::new());
        for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
            match event {
                Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
                    let (address, graph) = self.target(source, &dest_url);
                    open.push((address.is_some(), graph));
                    if let Some(address) = address {
                        events.push(Event::Start(Tag::Link {
                            link_type,
                            dest_url: address.into(),
                            title,
                            id,
                        }));
                    }
                }
                Event::End(TagEnd::Link) => {
                    let (is_link, graph) = open.pop().unwrap_or_default();
                    if is_link {
                        events.push(event);
                    }
                    if let Some(name) = graph.filter(|name| offered.insert(name.clone())) {
                        let button =
                            format!(" <button class=\"run\" data-graph=\"{name}\">Run it here</button>");
                        events.push(Event::InlineHtml(button.into()));
                    }
                }
                Event::Start(Tag::Image { link_type, dest_url, title, id }) => {
                    let dest_url = self.target(source, &dest_url).0.map_or(dest_url, CowStr::from);
                    events.push(Event::Start(Tag::Image { link_type, dest_url, title, id }));
                }
                event => events.push(event),
            }
        }
        let title = name_headings(&mut events);
        let mut content = String::new();
        html::push_html(&mut content, events.into_iter());
        (title, content)
    }

    /// The address of what a link leads to, if the site has it, and the graph that it runs.
    fn target(&mut self, source: &Path, link: &str) -> (Option<String>, Option<String>) {
        let (path, part) = link.split_once('#').map_or((link, ""), |(path, part)| (path, part));
        if path.is_empty() || path.contains(':') {
            return (Some(link.to_owned()), None);
        }
        let part = if part.is_empty() { String::new() } else { format!("#{part}") };
        let target = source.with_file_name("").join(path);
        let target = plain(&target);
        if let Some(page) = self.pages.get(&target) {
            return (Some(format!("{page}{part}")), None);
        }
        let Ok(bytes) = files::read(&target, files::MAX_SITE_BYTES) else { return (None, None) };
        if target.starts_with(self.folder) {
            let name = relative(&target, self.folder);
            self.shown.insert(target);
            return (Some(name), None);
        }
        let Some(file) = self.known.get(&hash(&bytes)) else { return (None, None) };
        match file.strip_prefix("files/").and_then(|path| self.graphs.get(path)) {
            Some(name) => (Some(format!("../studio.html?graph={name}")), Some(name.clone())),
            None => (Some(format!("../{file}")), None),
        }
    }
}

/// Gives headings the names that links use, as forges do; returns the text of the first.
fn name_headings(events: &mut [Event<'_>]) -> String {
    let (mut first, mut counts) = (None, BTreeMap::<String, usize>::new());
    for start in 0..events.len() {
        if !matches!(events[start], Event::Start(Tag::Heading { .. })) {
            continue;
        }
        let within =
            events[start..].iter().take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
        let text: String = within
            .filter_map(|event| match event {
                Event::Text(text) | Event::Code(text) => Some(&**text),
                _ => None,
            })
            .collect();
        let kept = text.to_lowercase();
        let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let count = counts.entry(name.clone()).or_default();
        let name = if *count == 0 { name } else { format!("{name}-{count}") };
        *count += 1;
        if let Event::Start(Tag::Heading { id, .. }) = &mut events[start] {
            *id = Some(name.into());
        }
        first.get_or_insert(text);
    }
    first.unwrap_or_default().replace('&', "&amp;").replace('<', "&lt;")
}
