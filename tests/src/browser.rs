//! A real browser without a window, if one is installed: Chromium, run as a program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PROGRAMS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];
/// No sandbox, for tests run as root in containers; nothing that asks the network or a GPU for anything.
const FLAGS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=20000",
];
/// Where a page puts what its script found.
const OPEN: &str = "<pre id=\"found\">";

/// Loads a page, runs a script in it when all is loaded, and gives the JSON of what the script returns, with `problems`, whatever
/// went wrong on the page. `None` where no browser is installed.
///
/// # Panics
/// When the page cannot be read, or the browser fails.
pub fn evaluate(page: &Path, script: &str) -> Option<serde_json::Value> {
    let program = PROGRAMS.iter().find_map(|program| installed(program))?;
    let html = fs::read_to_string(page).expect("the page is there");
    let instrumented = html.replacen("<head>", &format!("<head>{LISTEN}"), 1).replacen(
        "</body>",
        &format!("<script>addEventListener(\"load\", () => {{ const found = (() => {{ {script} }})(); {REPORT} }});</script></body>"),
        1,
    );
    let copy = page.with_extension("browser.html");
    fs::write(&copy, instrumented).expect("the folder of the page is writable");
    let profile = page.with_extension("profile");
    let output = Command::new(program)
        .args(FLAGS)
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg("--dump-dom")
        .arg(format!("file://{}", copy.display()))
        .output()
        .expect("the browser starts");
    let dom = String::from_utf8_lossy(&output.stdout);
    let found = dom.split(OPEN).nth(1).and_then(|rest| rest.split("</pre>").next());
    let found = found.unwrap_or_else(|| panic!("no answer: {}", String::from_utf8_lossy(&output.stderr)));
    let found = found.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    Some(serde_json::from_str(&found).expect("the page answers with JSON"))
}

const LISTEN: &str = r#"<script>
const problems = [];
addEventListener("error", (event) => problems.push(String(event.message || event.target.outerHTML)), true);
</script>"#;

const REPORT: &str = r#"
const pre = document.createElement("pre");
pre.id = "found";
pre.textContent = JSON.stringify({ ...found, problems });
document.body.append(pre);
"#;

fn installed(program: &str) -> Option<PathBuf> {
    let paths = std::env::var_os("PATH")?;
    std::env::split_paths(&paths).map(|folder| folder.join(program)).find(|path| path.is_file())
}
