#!/usr/bin/env python3
"""The examples in each rule of check_words.py, and a tree with retired words in texts and in a file's name."""

import unittest

from planted_tree import planted

import check_words


def rules_that_find(text):
    return {plain for _, _, plain in check_words.findings_in("a.md", f"first\n{text}\n")}


class CheckWords(unittest.TestCase):
    def test_examples(self):
        for _, plain, wanted, allowed in check_words.RULES:
            for text in wanted:
                self.assertIn(plain, rules_that_find(text), text)
            for text in allowed:
                self.assertNotIn(plain, rules_that_find(text), text)

    def test_tree(self):
        with planted({"CHANGELOG.md": "was a knob\n", "docs/a.md": "plain\na knob\n", "price_list.cc": "x\n",
                      "a.bin": "knob\0", "build/a.md": "a knob\n"}) as root:
            self.assertEqual(check_words.check_tree(root),
                             [("docs/a.md", 2, "knob", "parameter"), ("price_list.cc", 0, "price_", "cost")])


if __name__ == "__main__":
    unittest.main()
