//! A page with the pictures of all everyday objects.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    time::Duration,
};

use grasp_everyday::EverydayObject;

use super::{
    super::asked::Asked,
    results::{human_mass, outcome_name},
};
use crate::{Failure, format::human_time, output::write_file};

const STYLE: &str = "\
body { font: 15px/1.4 system-ui, sans-serif; margin: 2em; color: #222; background: #fafafa; }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(26em, 1fr)); gap: 1.2em; }
figure { margin: 0; padding: .6em; background: #fff; border-top: 4px solid #3a8a4a; }
figure.none { border-color: #c03030; }
figure.beyond { border-color: #8a8a8a; }
img { width: 100%; }
h3 { margin: .2em 0; }
p { margin: 0; }";

/// Writes `index.html`, which shows the pictures next to it; returns its path.
pub(super) fn write(
    folder: &Path,
    asked: &[Asked<EverydayObject>],
    budget: Duration,
) -> Result<PathBuf, Failure> {
    let path = folder.join("index.html");
    write_file(&path, page(asked, budget).as_bytes())?;
    Ok(path)
}

fn page(asked: &[Asked<EverydayObject>], budget: Duration) -> String {
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Everyday objects</title>\n\
         <style>\n{STYLE}\n</style>\n<h1>Everyday objects</h1>\n<p>Time limit: {}.</p>\n",
        human_time(budget.as_secs_f64())
    );
    for (title, class) in SECTIONS {
        let here: Vec<_> = asked.iter().filter(|asked| class_of(asked) == class).collect();
        let _ = write!(html, "<h2>{title}: {}</h2>\n<main>\n", here.len());
        for asked in here {
            write_figure(&mut html, asked);
        }
        html.push_str("</main>\n");
    }
    html.push_str("</html>\n");
    html
}

/// The parts of the page: their titles, and the classes of their figures in the style sheet.
const SECTIONS: [(&str, &str); 3] = [
    ("Found", "found"),
    ("Not found in time", "none"),
    ("Beyond one hand", "beyond"),
];

/// The class of an object's figure.
fn class_of(asked: &Asked<EverydayObject>) -> &'static str {
    match (asked.beyond(), asked.is_found()) {
        (Some(_), _) => "beyond",
        (None, true) => "found",
        (None, false) => "none",
    }
}

fn write_figure(html: &mut String, asked: &Asked<EverydayObject>) {
    let object = &asked.what;
    let how = asked.answer.grasp().map_or_else(String::new, |_| {
        let [grasp_type, comfort] = asked.type_and_comfort();
        format!(", {grasp_type}, comfort E {comfort}")
    });
    let (mass, surface) = (human_mass(object.mass_kg()), object.surface.name());
    let (outcome, attempts) = (outcome_name(asked), asked.answer.attempts());
    let [time, _] = asked.times();
    let mut lines = vec![
        format!("{}. {mass}, {surface}.", object.what),
        format!("{outcome}{how}: {attempts} attempts, {time}"),
    ];
    lines.extend(asked.beyond().map(|why| format!("Two hands: {why}.")));
    let (class, name) = (class_of(asked), asked.name);
    let _ = write!(
        html,
        "<figure class=\"{class}\">\n<a href=\"{name}.glb\"><img src=\"{name}.png\" alt=\"{name}\" loading=\"lazy\"></a>\n\
         <h3>{name}</h3>\n"
    );
    for line in lines {
        let _ = writeln!(html, "<p>{}</p>", escaped(&line));
    }
    html.push_str("</figure>\n");
}

/// Text with the characters replaced that mean something in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_markup() {
        assert_eq!(escaped("a < b & c > d"), "a &lt; b &amp; c &gt; d");
    }
}
