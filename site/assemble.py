"""Puts the pages of the site together: the documents as they are, a reference of the Python package, a gallery.

Called by site/build.sh: ``assemble.py FOLDER [LEAFDYN]`` with the program, which draws the pictures of the gallery;
without it there are none.
"""

import ast
import base64
import json
import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINK = re.compile(r"(?<=\]\()([^)#\s]+)((?:#[^)\s]*)?)(?=\))")

# Scenarios of the gallery: what to look at, and the numbers with sliders. Each opens on the page in web/check.mjs.
GALLERY = json.loads((ROOT / "site/gallery.json").read_text())

# Questions with which the live page begins, by their names in its address.
QUESTIONS = {
    "ripple": "Why do leaf margins ripple?",
    "snap": "Why does a bent strip snap?",
    "arch": "Why does a grass leaf arch and not fall?",
}


def documents(to: Path) -> None:
    """Copies the documents with all they link to, below the same folders, so that links stay right."""
    pages = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    pages += sorted(path for path in (ROOT / "docs").rglob("*") if path.is_file())
    known: set[Path] = set()
    while pages:
        page = pages.pop()
        if page in known:
            continue
        known.add(page)
        copy = to / page.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        if page.suffix != ".md":
            shutil.copy(page, copy)
            continue

        def linked(found: re.Match[str]) -> str:
            link, anchor = found.groups()
            if "://" in link:
                return found[0]
            target = (page.parent / link).resolve()
            if not target.exists():
                sys.exit(f"{page.relative_to(ROOT)}: {link} leads nowhere")
            if target.is_dir():
                list_folder(target, to)
                pages.extend(path for path in target.iterdir() if path.is_file())
                return f"{link}/index.md"
            pages.append(target)
            return link + anchor

        copy.write_text(LINK.sub(linked, page.read_text()))


def list_folder(folder: Path, to: Path) -> None:
    """A page in place of a folder."""
    name = folder.relative_to(ROOT)
    files = sorted(path.name for path in folder.iterdir() if path.is_file())
    lines = [f"# {name}", "", *(f"- [{file}]({file})" for file in files)]
    (to / name).mkdir(parents=True, exist_ok=True)
    (to / name / "index.md").write_text("\n".join(lines) + "\n")


def reference(to: Path) -> None:
    """A page with every public name of the Python package."""
    tree = ast.parse((ROOT / "python/lib/leafdyn/__init__.py").read_text())
    assigned = [node for node in tree.body if isinstance(node, ast.Assign)]
    names = next(ast.literal_eval(it.value) for it in assigned if getattr(it.targets[0], "id", "") == "__all__")
    public = [name for name in names if not name.startswith("_")]
    functions = [name for name in public if name[0].islower()]
    classes = [name for name in public if name[0].isupper()]
    lines = ["# Python reference", "", "[How to use it](docs/python.md) is another page.", ""]
    for title, group in (("Functions", functions), ("Results and other types", classes)):
        lines += [f"## {title}", ""]
        for name in group:
            lines += [f"::: leafdyn.{name}", ""]
    (to / "reference.md").write_text("\n".join(lines))


def first_screen(to: Path) -> None:
    """The live page on the first screen of the site, behind the first paragraph of words, if it was built."""
    if not (to / "live.html").exists():
        return
    home = to / "README.md"
    blocks = home.read_text().split("\n\n")
    # The title and the pictures come before it.
    words = next(k for k, block in enumerate(blocks) if not block.startswith(("#", "|")))
    picture = '<img src="docs/live.png" alt="A leaf on the live page, with its sliders">'
    link = f'<a class="live-leaf" href="live.html"><span>Open the live page: move a slider, and the leaf follows</span>{picture}</a>'
    home.write_text("\n\n".join([*blocks[: words + 1], link, *blocks[words + 1 :]]))


def address(scenario: Path, sliders: list[dict[str, object]]) -> str:
    """The part of an address that holds a scenario, as the live page reads it."""
    held = {"text": scenario.read_text(), "name": scenario.name, "values": [], "sliders": sliders, "view": None}
    packing = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = packing.compress(json.dumps(held).encode()) + packing.flush()
    return "#s=" + base64.urlsafe_b64encode(packed).decode().rstrip("=")


def gallery(to: Path, program: str | None) -> None:
    """A page of leaves that move: each opens the live page, if that was built."""
    live = ROOT / "web/dist/live.html"
    lines = ["# Live leaves", ""]
    if live.exists():
        shutil.copy(live, to / "live.html")
        lines += ["Each opens [the live page](docs/live.md): one file with the solver in it. Move the slider, and the leaf follows.", ""]
        lines += ["## Three questions", ""]
        lines += [f'- <a href="../live.html#q={name}">{question}</a>' for name, question in QUESTIONS.items()]
        lines += [""]
    else:
        lines += ["[The live page](docs/live.md) was not built with this site.", ""]
    for entry in GALLERY:
        name, words, sliders = entry["scenario"], entry["words"], entry["sliders"]
        scenario = ROOT / f"scenarios/{name}.toml"
        lines += [f"## {words}", ""]
        if program is not None:
            picture = to / "gallery" / scenario.stem
            command = [program, "relax", str(scenario), "--write", "svg", "--out", str(picture)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            lines += [f"![{words}](gallery/{scenario.stem}/figure.svg)", ""]
        opened = f'<a href="../live.html{address(scenario, sliders)}">Open it</a>, or take ' if live.exists() else "Take "
        lines += [f"{opened}[its scenario](scenarios/{name}.toml).", ""]
        copy = to / f"scenarios/{name}.toml"
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(scenario, copy)
    (to / "gallery.md").write_text("\n".join(lines))


def main() -> None:
    to = Path(sys.argv[1])
    shutil.rmtree(to, ignore_errors=True)
    to.mkdir(parents=True)
    documents(to)
    reference(to)
    gallery(to, sys.argv[2] if len(sys.argv) > 2 else None)
    first_screen(to)


main()
