#!/usr/bin/env python3
"""Looks at a page of `interneuron report`.

    report_page.py DIR            well-formed, asks nobody for anything, every figure is there
    report_page.py DIR BROWSER    a headless Chromium draws every chart and complains of nothing

Exit codes: 0 good, 1 not (with the reasons).
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

# Appended to a copy of the page: the title tells how many charts there are, and which are not drawn.
LOOK = """<script>
const charts = [...document.querySelectorAll('figure svg')];
const blank = charts.filter(svg => {
  const box = svg.getBBox();
  return box.width < 100 || box.height < 50 || svg.querySelectorAll('path, use, polygon, rect').length < 10;
});
document.title = 'charts ' + charts.length + ' blank ' + blank.length;
</script></body>"""


def check_text(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    problems = []
    root = ET.fromstring(page)
    charts = root.findall(".//figure/svg")
    for link in re.findall(r"https?://[^\s\"'<]*", page):
        problems.append(f"asks for {link}")
    for element in root.iter():
        for name in ("src", "href"):
            value = element.get(name, "#")
            if not value.startswith(("#", "data:")):
                problems.append(f"<{element.tag} {name}={value[:60]}> lies outside the page")
    if "prefers-color-scheme: dark" not in page:
        problems.append("no dark colours")
    if re.search(r"(stroke|fill|color)=['\"](black|rgb\( *0, *0, *0\))['\"]", page):
        problems.append("black ink in a chart")
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    if len(ids) != len(set(ids)):
        problems.append("an id is there twice")
    for name in sorted(p.stem for p in folder.glob("*.svg")):
        if not (folder / f"{name}.png").is_file():
            problems.append(f"{name}.png is not there")
        if f'id="{name}-gnuplot_canvas"' not in page:
            problems.append(f"chart {name} is not on the page")
    drawn = len(list(folder.glob("*.svg")))
    if not charts or drawn != len(charts):
        problems.append(f"{len(charts)} charts on the page, {drawn} drawn")
    return problems


def check_browser(folder, browser):
    page = (folder / "report.html").read_text(encoding="utf-8")
    charts = page.count("<svg")
    with tempfile.TemporaryDirectory() as scratch:
        copy = pathlib.Path(scratch) / "page.html"
        copy.write_text(page.replace("</body>", LOOK), encoding="utf-8")
        ran = subprocess.run(
            [browser, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
             f"--user-data-dir={scratch}/profile", "--dump-dom", copy.as_uri()],
            capture_output=True, text=True, timeout=100, check=False)
    problems = [line for line in ran.stderr.splitlines() if "CONSOLE" in line]
    title = re.search(r"<title>(.*?)</title>", ran.stdout)
    if title is None or title[1] != f"charts {charts} blank 0":
        problems.append(f"the browser says '{title[1] if title else ran.stderr[-300:]}', "
                        f"{charts} charts expected")
    return problems


def main():
    folder = pathlib.Path(sys.argv[1])
    problems = check_browser(folder, sys.argv[2]) if len(sys.argv) > 2 else check_text(folder)
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
