"""Count words of user pages, help, messages and docstrings against the budget of plain English: ``make words``.

Prints a table and fails for nothing: the counts are per 10,000 words over the whole, and one word is no defect.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

PROJECT: Final = Path(__file__).resolve().parents[1]
DOCS: Final = PROJECT / "docs"
TAUGHT: Final = ("Start", "Tutorials", "Hardware", "Reference", "Explanation")
LONGEST_PAGE: Final = 1200
BUDGET: Final = (
    ("tell, told, hear", re.compile(r"\b(tell|tells|told|hears?|heard)\b", re.IGNORECASE), 3),
    ("what is, it, the", re.compile(r"\bwhat (is|it|the|was|a|they)\b", re.IGNORECASE), 8),
    ("anew, whoever, nobody", re.compile(r"\b(anew|whoever|nobody|somebody)\b", re.IGNORECASE), 1),
)
_DEFINED: Final = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def user_pages() -> list[Path]:
    """Return README and the committed pages of the site's menu."""
    menu = (PROJECT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    pages, part = [PROJECT / "README.md"], ""
    for line in menu.splitlines():
        if top := re.match(r"  - (\w+):", line):
            part = top[1]
        elif (item := re.match(r"      - .+: (\S+\.md)$", line)) and part in TAUGHT:
            pages.append(DOCS / item[1])
    return [page for page in pages if page.is_file()]


def prose(page: Path) -> str:
    """Return a page without code blocks, generated tables and link targets."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"<!-- (\w+): begin -->.*?<!-- \1: end -->", "", text, flags=re.DOTALL)
    return re.sub(r"\]\([^)]*\)", "]", text)


def count_words(text: str) -> int:
    """Return the number of words; bars and rules of tables are none."""
    return sum(any(letter.isalnum() for letter in word) for word in text.split())


def strings_of(tree: ast.Module) -> Iterator[tuple[str, bool]]:
    """Yield each docstring, and each other string constant of four words and more; true if it is a docstring."""
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, _DEFINED)]
    texts = [line for body in bodies for line in body if isinstance(line, ast.Expr)]
    # A string that stands alone documents the name above it.
    documented = {id(line.value) for line in texts if isinstance(line.value, ast.Constant)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) in documented:
                yield node.value, True
            elif len(node.value.split()) >= 4:
                yield node.value, False


def collected() -> dict[str, list[str]]:
    """Return the texts by kind."""
    found: dict[str, list[str]] = {"user pages": [prose(page) for page in user_pages()]}
    found |= {"help": [], "messages": [], "docstrings": []}
    for file in sorted((PROJECT / "python").rglob("*.py")):
        is_help = "ui/cli" in file.as_posix() or file.name in {"cli.py", "command.py"} or "cli" in file.parts
        for text, documents in strings_of(ast.parse(file.read_text(encoding="utf-8"))):
            found["docstrings" if documents else "help" if is_help else "messages"].append(text)
    return found


def retired() -> re.Pattern[str]:
    """Return a pattern of the words that the glossary says are not used."""
    table = (DOCS / "glossary.md").read_text(encoding="utf-8").split("## Words that are not used")[1]
    cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("|")][2:]
    words = [re.escape(word.strip()).replace(r"\ ", r"[\s-]+") for cell in cells for word in cell.split(",")]
    return re.compile(rf"\b(?:{'|'.join(words)})s?\b", re.IGNORECASE)


def report() -> str:
    """Return the table, then pages that are long, retired words, and pictures that no page shows."""
    texts = {kind: "\n".join(parts) for kind, parts in collected().items()}
    texts["all"] = "\n".join(texts.values())
    lines = [
        f"{'per 10,000 words':<14} {'words':>8}" + "".join(f"  {name} < {most}" for name, _, most in BUDGET)
    ]
    for kind, text in texts.items():
        n_words = count_words(text)
        rates = [1e4 * len(pattern.findall(text)) / n_words for _, pattern, _ in BUDGET]
        widths = [len(f"{name} < {most}") + 2 for name, _, most in BUDGET]
        cells = "".join(f"{rate:>{width}.1f}" for rate, width in zip(rates, widths, strict=True))
        lines.append(f"{kind:<16} {n_words:>8}{cells}")
    long = {page.name: count_words(prose(page)) for page in user_pages()}
    lines += [f"{name}: {n} words, more than {LONGEST_PAGE}" for name, n in long.items() if n > LONGEST_PAGE]
    pattern = retired()
    for page in user_pages():
        message = prose(page).partition("## Words that are not used")[0]
        lines += [f"{page.name}: retired word {word!r}" for word in sorted(set(pattern.findall(message)))]
    sources = [*PROJECT.glob("*.md"), *DOCS.rglob("*.md"), PROJECT / "mkdocs.yml"]
    displayed = "\n".join(page.read_text("utf-8") for page in sources)
    pictures = sorted(path for path in (DOCS / "images").glob("*.*") if path.suffix != ".py")
    lines += [f"no page shows {path.name}" for path in pictures if f"images/{path.name}" not in displayed]
    return "\n".join(lines)


if __name__ == "__main__":
    print(report())  # noqa: T201  # this is a program
