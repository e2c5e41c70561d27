"""Generate the site's reference pages and those of the notebooks, and mark links that leave the docs.

Called by mkdocs, see mkdocs.yml.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from jinja2 import Environment
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter

sys.path.insert(0, str(Path(__file__).resolve().parent))
from lift_player import lift_page
from reference_pages import commands_page, drivers_page, public_modules, settings_page, stages_page

MOVED = {
    **{
        name: f"evidence/{name}"
        for name in ("emg-decoders", "faults", "loop", "safety", "sim-touch", "touch-live")
    },
    "detect": "evidence/scene",
    "faults-streams": "evidence/faults",
    "performance": "evidence/pareto",
    "soak": "evidence/faults",
    "stress": "evidence/installing",
    "evidence/files": "evidence/recording",
    "evidence/letting-go": "evidence/faults",
    "evidence/mutants": "evidence/installing",
    "sim-operator": "evidence/sim",
    "sim-world": "evidence/sim",
    "skips": "evidence/pareto",
    "study-silico": "evidence/study",
    "evidence/devices": "hardware/what-to-buy",
    "hardware/emg-signal": "device-emg",
    "hardware/franka": "device-arm",
    "hardware/motor-onset": "device-vest",
    "hardware/openxr": "device-tracker",
    "hardware/vest-troubles": "device-vest",
}
NOTEBOOKS = Path(__file__).resolve().parents[1] / "examples" / "notebooks"
ABBREVIATIONS = {"CCI": "contact concentration index", "EDA": "effective deformation area"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    modules = public_modules(Path(config.docs_dir))
    listed = "\n".join(f"- [`{m}`](python/{m}.md)" for m in modules)
    pages = {
        "reference/commands.md": commands_page(),
        "reference/settings.md": settings_page(),
        "reference/drivers.md": drivers_page(),
        "reference/stages.md": stages_page(),
        "reference/python.md": "# Python\n\nThe public modules; each page is made from the docstrings.\n\n"
        + listed,
    }
    for module in modules:
        pages[f"reference/python/{module}.md"] = f"# {module}\n\n::: {module}\n"
    for name, text in pages.items():
        level = InclusionLevel.NOT_IN_NAV if "/python/" in name else InclusionLevel.INCLUDED
        files.append(File.generated(config, name, content=text, inclusion=level))
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        text, made = MarkdownExporter().from_filename(str(path), resources={"unique_key": path.stem})
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
        for name, picture in made["outputs"].items():
            files.append(File.generated(config, f"notebooks/{name}", content=picture))
    return files


def on_env(env: Environment, config: MkDocsConfig, files: Files) -> Environment:  # noqa: ARG001
    """Have the search work from the disk without a network: the plugin `offline` fetches what it takes from one."""
    config.extra_javascript[:] = [
        "file-worker.js" if "iframe-worker" in str(script) else script for script in config.extra_javascript
    ]
    return env


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Name files of the checkout that a page links to, and add what CCI and EDA stand for."""
    here = Path(config.docs_dir, page.file.src_uri).parent
    docs = Path(config.docs_dir)

    def outside(match: re.Match[str]) -> str:
        said, target = match.groups()
        path = (here / target.partition("#")[0]).resolve()
        if "://" in target or not target.startswith("..") or path.is_relative_to(docs):
            return match.group()
        if path.parent == NOTEBOOKS:
            place = os.path.relpath(docs / "notebooks" / f"{path.stem}.md", here)
            return f"[{said}]({Path(place).as_posix()})"
        name = path.relative_to(docs.parent).as_posix()
        return f"`{name}`" if said.strip("`") in name else f"{said} (`{name}` in the checkout)"

    spelt = "\n".join(f"*[{short}]: {long}" for short, long in ABBREVIATIONS.items())
    return re.sub(r"(?<!!)\[([^\]]+)\]\(([^)]+)\)", outside, markdown) + f"\n\n{spelt}\n"


def on_post_build(config: MkDocsConfig) -> None:
    """Write the page of a recorded lift, and lead from old addresses of pages to their new ones."""
    Path(config.site_dir, "lift.html").write_text(
        lift_page(Path(config.docs_dir, "lift.viser")), encoding="utf-8"
    )
    for name, page in MOVED.items():
        link = f"{'../' * name.count('/')}{page}.html"
        Path(config.site_dir, f"{name}.html").write_text(
            f'<!doctype html><title>{name}</title><meta http-equiv="refresh" content="0; url={link}">'
            f'<a href="{link}">This page moved.</a>\n',
            encoding="utf-8",
        )
