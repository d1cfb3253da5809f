"""The pages of docs: none is too long to read at once, every link leads somewhere, and docs/README.md names all."""

from __future__ import annotations

import pathlib
import re
import unittest

_ROOT = pathlib.Path(__file__).resolve().parents[2]
_MAX_WORDS = 2500
_PAGES = [*_ROOT.glob("*.md"), *_ROOT.glob("docs/*.md"), *_ROOT.glob("client/python/*.md"), *_ROOT.glob("tests/*/*.md")]


def outside_fences(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(page: pathlib.Path) -> set[str]:
    """As GitHub makes them of headings."""
    headings = re.findall(r"^#+ +(.*)$", outside_fences(page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def links(page: pathlib.Path) -> list[str]:
    found = re.findall(r"\]\(([^)\s]+)\)", outside_fences(page.read_text()))
    return [link for link in found if "://" not in link]


class Pages(unittest.TestCase):
    """All pages but the changelog, which grows."""

    def test_none_is_too_long(self) -> None:
        words = {page.name: len(page.read_text().split()) for page in _ROOT.glob("docs/*.md")}
        self.assertEqual({name: count for name, count in words.items() if count > _MAX_WORDS}, {})

    def test_every_link_leads_somewhere(self) -> None:
        lost = []
        for page in _PAGES:
            for link in links(page):
                file, _, anchor = link.partition("#")
                target = page.parent / file if file else page
                if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
                    lost.append(f"{page.relative_to(_ROOT)}: {link}")
        self.assertEqual(lost, [])

    def test_the_index_names_every_page(self) -> None:
        index = _ROOT / "docs/README.md"
        named = {link.partition("#")[0] for link in links(index)}
        pages = {page.name for page in _ROOT.glob("docs/*.md")} - {index.name}
        self.assertEqual(pages - named, set())


if __name__ == "__main__":
    unittest.main()
