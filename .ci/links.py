#!/usr/bin/env python3
"""Checks the links between the Markdown pages of the repository.

A link is broken if its file is missing, if the page has no heading with its anchor, or if a page of
the book is not listed in SUMMARY.md. Links into the project's repository on its public host are
checked as files of this checkout. Other links to the network are not followed.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HOST = re.compile(r"https://github\.com/navfuse/navfuse/(?:blob|tree)/main/")
BOOK = ROOT / "docs/src"
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(<?([^)\s>]*)>?(?:\s+\"[^\"]*\")?\)")


def prose(page: Path) -> str:
    """The text of a page without its blocks and spans of code."""
    text = re.sub(r"^( *)(```+|~~~+).*?^\1\2 *$", "", page.read_text(), flags=re.M | re.S)
    return re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", lambda span: "x" * len(span[0]), text)


def anchors(page: Path) -> set[str]:
    """The anchors of the headings, as mdbook and the public host write them."""
    found: set[str] = set()
    text = re.sub(r"^( *)(```+|~~~+).*?^\1\2 *$", "", page.read_text(), flags=re.M | re.S)
    for heading in re.findall(r"^#{1,6} +(.+?)\s*$", text, flags=re.M):
        if given := re.search(r"\{#([\w-]+)\}$", heading):
            found.add(given[1])
            continue
        title = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", title).replace(" ", "-")
        count = 0
        while (name := f"{slug}-{count}" if count else slug) in found:
            count += 1
        found.add(name)
    found.update(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))
    return found


def broken(page: Path) -> list[str]:
    """The broken links of a page, each with its reason."""
    faults = []
    for link in LINK.findall(prose(page)):
        inside = HOST.match(link)
        if not inside and (re.match(r"[a-z]+:", link) or not link):
            continue
        path, _, anchor = (link[inside.end() :] if inside else link).partition("#")
        target = ((ROOT if inside else page.parent) / path).resolve() if path else page
        if not target.exists():
            faults.append(f"{link}: there is no such file")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            faults.append(f"{link}: {target.relative_to(ROOT)} has no such heading")
        elif BOOK in page.parents and not inside and BOOK not in [target, *target.parents]:
            faults.append(f"{link}: outside of the book")
    return faults


def main() -> int:
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    pages = [ROOT / name for name in names.splitlines() if (ROOT / name).exists()]
    faults = [f"{p.relative_to(ROOT)}: {fault}" for p in pages for fault in broken(p)]
    summary = {(BOOK / link).resolve() for link in LINK.findall((BOOK / "SUMMARY.md").read_text())}
    unlisted = [p for p in pages if BOOK in p.parents and p not in summary | {BOOK / "SUMMARY.md"}]
    faults += [f"{p.relative_to(ROOT)}: SUMMARY.md does not list the page" for p in unlisted]
    print("\n".join(faults), file=sys.stderr) if faults else None
    print(f"{len(pages)} pages, {len(faults)} broken links")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
