"""Opens a report in a headless browser without network: report.py BROWSER REPORT SCREENSHOT.

Fails unless the browser builds every figure with a picture that has a size, asks for nothing but the file, and logs no fault.
"""

import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as tree

browser, report, screenshot = sys.argv[1], pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
address = report.as_uri()
with tempfile.TemporaryDirectory() as folder:
    netlog = pathlib.Path(folder) / "net.json"
    common = [
        browser,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={folder}/profile",
        "--hide-scrollbars",
        "--window-size=1240,1700",
    ]

    def opened(*more):
        """What the browser says on standard output and on standard error."""
        done = subprocess.run([*common, *more, address], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        return done.stdout, done.stderr

    opened(f"--screenshot={screenshot}")
    page, said = opened("--dump-dom", "--enable-logging=stderr", f"--log-net-log={netlog}")
    faults = [line for line in said.splitlines() if "CONSOLE" in line or "Content Security Policy" in line]
    assert not faults, faults
    # The log of the network ends in the middle of a list where the browser was stopped: read what there is of addresses.
    asked = {line.split('"url":"')[1].split('"')[0] for line in netlog.read_text().splitlines() if '"url":"' in line}
    elsewhere = sorted(url for url in asked if url.startswith(("http", "ws", "ftp")))
    assert not elsewhere, f"the page asks for {elsewhere}"

body = page[page.index("<body") : page.index("</body>") + len("</body>")]
figures = body.count("<figure ")
in_file = report.read_text()
assert figures == in_file.count("<figure ") > 5, figures
assert body.count("<svg ") == figures, "a picture in every figure"
assert body.count("<h2>") == in_file.count("<h2>")
data = pathlib.Path(screenshot).read_bytes()
assert data.startswith(b"\x89PNG") and len(data) > 50_000, "the page is not empty"
tree.parse(report)
print(f"{figures} figures")
