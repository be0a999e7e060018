"""The documentation can be read: short pages, and short sentences where a newcomer begins."""

import re

import pytest

from tests.doc_pages import PAGES, prose

LONGEST_PAGE = 1500
LONGEST_SENTENCE = 35
"""Words."""

FIRST = ("README", "index", "own-controller")
_WORD = re.compile(r"\w[\w'’-]*")


@pytest.mark.parametrize("page", sorted(PAGES.keys() - {"api"}))
def test_no_page_is_long(page):
    assert sum(len(_WORD.findall(part)) for part in prose(page)) <= LONGEST_PAGE


@pytest.mark.parametrize("page", FIRST)
def test_sentences_of_the_first_pages_are_short(page):
    sentences = [one for part in prose(page) for one in re.split(r"(?<=[.!?])\s+", part)]
    assert [one for one in sentences if len(_WORD.findall(one)) > LONGEST_SENTENCE] == []
